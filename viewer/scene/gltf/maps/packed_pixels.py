"""Images that only a pack holds: found out about without decoding, decoded when their pixels are needed."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ntc.codec.maps import MapName, map_slices
from ntc.codec.model import EncodedTexture, Pack
from ntc.codec.reference import decode_image
from ntc.errors import InputError
from ntc.pack.file import read_pack
from viewer.scene.gltf.container import GltfFile
from viewer.scene.gltf.packed_textures import PackOption, pack_path
from viewer.scene.pixels import ImageFacts, MapFacts, PixelCache


@dataclass(frozen=True, eq=False)
class DecodedTexture:
    """All channels of a texture of a pack."""

    pixels: NDArray[np.uint8]
    """[H, W, channels]."""
    slices: Mapping[MapName, slice]
    """Slice of the channels that each map has."""

    @property
    def nbytes(self) -> int:
        """Bytes of memory."""
        return self.pixels.nbytes

    def channels(self, name: MapName) -> NDArray[np.uint8] | None:
        """Return [H, W, channels of the map], None where the texture has no such map; base colours always have 3."""
        place = self.slices.get(name)
        if place is None:
            return None
        own = self.pixels[..., place]
        if name == "base":
            own = np.repeat(own[..., :1], 3, axis=2) if own.shape[2] < 3 else own[..., :3]
        return np.ascontiguousarray(own)


@dataclass(frozen=True, eq=False)
class PackedTexture:
    """A texture of a pack that stands for images of the scene."""

    pack: Pack
    layer: int

    @property
    def encoded(self) -> EncodedTexture:
        """Texture as the pack holds it."""
        return self.pack.textures[self.layer]

    def facts(self, maps: set[MapName]) -> ImageFacts:
        """Return what is known of `maps` of it, as of an image."""
        encoded = self.encoded
        size = encoded.width, encoded.height
        own = maps.intersection(encoded.maps)
        identity = f"{encoded.pixel_hash} in a pack"
        further = {name: MapFacts(f"{identity} {name}") for name in sorted(own - {"base"})}
        kept = size[0] * size[1] * encoded.channels
        return ImageFacts(size, kept, kept, identity if "base" in own else "", maps=further)

    def decode(self) -> DecodedTexture:
        """Return the largest level, decoded."""
        encoded = self.encoded
        return DecodedTexture(decode_image(self.pack, self.layer, 0), map_slices(encoded.maps, encoded.channels))


class PackedTextures:
    """The textures of packs that the images of one file stand for; each pack is read once."""

    def __init__(self, file: GltfFile, cache: PixelCache) -> None:
        self._file, self._cache = file, cache
        self._packs: dict[Path, Pack] = {}

    def find(self, option: PackOption) -> PackedTexture:
        """Return the texture that `option` names, by its identity where it tells that. Raises InputError."""
        path = pack_path(self._file, option.image)
        if path not in self._packs:
            self._packs[path] = read_pack(path)
        pack = self._packs[path]
        layers = range(len(pack.textures))
        if option.pixel_hash:
            layer = next((k for k in layers if pack.textures[k].pixel_hash == option.pixel_hash), -1)
        else:
            layer = option.layer
        if layer not in layers:
            raise InputError(f"{path}: does not hold the texture that the scene takes from it; export the scene again")
        return PackedTexture(pack, layer)

    def decoded(self, texture: PackedTexture) -> DecodedTexture:
        """Return all channels of `texture`, from memory or decoded."""
        return self._cache.get((texture.encoded.pixel_hash, "decoded"), texture.decode)
