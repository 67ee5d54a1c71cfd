"""Images that only a pack holds. Their facts come from the pack's metadata; pixels are decoded when they are needed."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ntc.codec.maps import MapName, map_slices
from ntc.codec.model import EncodedTexture, Pack
from ntc.codec.reference import decode_image
from ntc.errors import InputError
from ntc.pack.file import read_pack
from viewer.scene.gltf.container import GltfFile
from viewer.scene.gltf.packed_textures import PackOption, pack_path
from viewer.scene.pixels import ImageContent, ImageFacts, MapFacts, PixelCache


@dataclass(frozen=True, eq=False)
class PackedTexture:
    """Texture of a pack that replaces images of the scene."""

    pack: Pack
    layer: int

    @property
    def encoded(self) -> EncodedTexture:
        """Encoded texture in the pack."""
        return self.pack.textures[self.layer]

    def facts(self, maps: set[MapName]) -> ImageFacts:
        """Return the facts of its maps among `maps`, in the form of those of an image."""
        encoded = self.encoded
        size = encoded.width, encoded.height
        held = maps.intersection(encoded.maps)
        identity = f"{encoded.pixel_hash} in a pack"
        further = {name: MapFacts(f"{identity} {name}") for name in sorted(held - {"base"})}
        decoded_bytes = size[0] * size[1] * encoded.channels
        return ImageFacts(size, decoded_bytes, decoded_bytes, identity if "base" in held else "", maps=further)

    def decode(self) -> ImageContent:
        """Return all maps of the largest level, decoded. Base colours have three channels."""
        encoded = self.encoded
        pixels = decode_image(self.pack, self.layer, 0)
        slices = map_slices(encoded.maps, encoded.channels)
        maps = {name: np.ascontiguousarray(pixels[..., place]) for name, place in slices.items()}
        base = maps.pop("base", None)
        if base is not None:
            base = np.repeat(base[..., :1], 3, axis=2) if base.shape[2] < 3 else np.ascontiguousarray(base[..., :3])
        return ImageContent(base, maps=maps)


class PackedTextures:
    """Textures of packs that one glTF file uses in place of images. Each pack is read once."""

    def __init__(self, file: GltfFile, cache: PixelCache) -> None:
        self._file, self._cache = file, cache
        self._packs: dict[Path, Pack] = {}

    def find(self, option: PackOption) -> PackedTexture:
        """Return the texture that `option` names, by its pixel hash if it has one, else by its index. Raises InputError."""
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

    def decoded(self, texture: PackedTexture) -> ImageContent:
        """Return all maps of `texture`, from the cache in memory or decoded."""
        return self._cache.get((texture.encoded.pixel_hash, "decoded"), texture.decode)
