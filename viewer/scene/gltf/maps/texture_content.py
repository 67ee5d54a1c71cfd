"""A texture's pixels, gathered from the images of its maps when they are asked for."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ntc.codec.maps import MapName
from ntc.codec.textures import hash_channels
from ntc.errors import InputError
from viewer.scene.gltf.maps.images import SceneImage
from viewer.scene.gltf.maps.map_pixels import resampled
from viewer.scene.pixels.pixel_cache import PixelCache


@dataclass(frozen=True)
class ImageMap:
    """One map of an image, at the size of the texture that it lies in. Equal ones are the same."""

    image: SceneImage
    name: MapName
    key: str
    """Identity of its pixels at their own size."""
    size: tuple[int, int]
    """(width, height) in texels of the texture."""
    cache: PixelCache

    def pixels(self) -> NDArray[np.uint8]:
        """[H, W, channels of the map]. Raises InputError."""
        found = self.image.read().maps.get(self.name)
        if found is None:
            raise InputError(f"{self.image.origin}: has changed since the scene was opened; open it again")
        if self.image.facts.size == self.size:
            return found
        own = found
        return self.cache.get(self, lambda: resampled(own, *self.size))


@dataclass(frozen=True, eq=False)
class ImagesOfTexture:
    """The pixels of one texture (`viewer.scene.pixels.texture_pixels.TexturePixels`)."""

    base: SceneImage | None
    maps: Mapping[MapName, ImageMap]
    cache: PixelCache

    def picture(self) -> NDArray[np.uint8]:
        """[H, W, 3] uint8 sRGB."""
        if self.base is None:
            first = next(iter(self.maps))
            return self.cache.get(self, lambda: _picture(first, self.maps[first].pixels()))
        pixels = self.base.read().pixels
        if pixels is None:
            raise InputError(f"{self.base.origin}: has changed since the scene was opened; open it again")
        return pixels

    def alpha(self) -> NDArray[np.uint8] | None:
        """[H, W] uint8."""
        return None if self.base is None else self.base.read().alpha

    def further(self) -> Mapping[MapName, NDArray[np.uint8]]:
        """By map [H, W, C] uint8."""
        return _MapsWhenNeeded(self.maps)

    def set_hash(self) -> str:
        """The hash of all maps together."""
        further = list(self.further().values())
        if self.base is None:
            return hash_channels(further)
        color, alpha = self.picture(), self.alpha()
        return hash_channels([color if alpha is None else np.dstack([color, alpha]), *further])


class _MapsWhenNeeded(Mapping[MapName, NDArray[np.uint8]]):
    """Reads the image of a map when that map is asked for."""

    def __init__(self, maps: Mapping[MapName, ImageMap]) -> None:
        self._maps = maps

    def __getitem__(self, name: MapName) -> NDArray[np.uint8]:
        return self._maps[name].pixels()

    def __iter__(self) -> Iterator[MapName]:
        return iter(self._maps)

    def __len__(self) -> int:
        return len(self._maps)


def _picture(name: MapName, pixels: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """[H, W, 3] uint8 that shows a map [H, W, C]: normals with the z of a unit vector, single channels as grey."""
    if pixels.shape[2] == 1:
        return np.repeat(pixels, 3, axis=2)
    if name != "normal":
        return pixels
    blue = np.empty(pixels.shape[:2], np.uint8)
    for source, target in zip(pixels, blue, strict=True):
        xy = source.astype(np.float32) / np.float32(127.5) - 1
        z = np.sqrt(np.clip(1 - xy[:, 0] ** 2 - xy[:, 1] ** 2, 0, 1))
        target[:] = (z * 127.5 + 128.0).astype(np.uint8)
    return np.dstack([pixels, blue])
