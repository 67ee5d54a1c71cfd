"""Textures as the codec sees them: 8-bit pixels, identity, colour space, wrap."""

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ntc.codec.config import ColorSpace, WrapMode
from ntc.codec.maps import BASE_ALONE, SEEN_WEIGHTS, MapName, MapWeights

ROWS_HASHED = 64
"""Rows of a texture that are brought together at a time."""


def hash_pixels(pixels: NDArray[np.uint8]) -> str:
    """Identity of an image: 32 hex digits over the shape and the bytes of `pixels` [H, W, C] uint8."""
    digest = hashlib.sha256(repr(pixels.shape).encode())
    digest.update(np.ascontiguousarray(pixels).data)
    return digest.hexdigest()[:32]


def hash_channels(maps: Sequence[NDArray[np.uint8]]) -> str:
    """Return `hash_pixels` of `maps`, each [H, W, C] uint8, side by side along their channels, without taking the memory of all of
    them."""
    height, width = maps[0].shape[:2]
    digest = hashlib.sha256(repr((height, width, sum(pixels.shape[2] for pixels in maps))).encode())
    for row in range(0, height, ROWS_HASHED):
        digest.update(np.concatenate([pixels[row : row + ROWS_HASHED] for pixels in maps], axis=2).data)
    return digest.hexdigest()[:32]


@dataclass(frozen=True, eq=False)
class SourceTexture:
    """One texture to encode. Row 0 of `pixels` is at v = 0, as in glTF."""

    name: str
    pixels: NDArray[np.uint8]
    """[H, W, C] uint8, 0 to 255: the channels of `maps` (`ntc.codec.maps.map_slices`), C from 1 to 13."""
    pixel_hash: str
    """Identity (`hash_pixels`) of the image at its original size, also when `pixels` is a reduced copy."""
    color_space: ColorSpace = "srgb"
    """Colour space of the map `base`."""
    wrap: tuple[WrapMode, WrapMode] = ("repeat", "repeat")
    """Wrap modes along u and v."""
    category: str | None = None
    maps: tuple[MapName, ...] = BASE_ALONE
    """More than `base` alone: a material set."""
    cutoff: float | None = None
    """Alpha in [0, 1] from which on a texel is there, of a texture with the map `alpha` that is tested; None: alpha is blended, or
    there is none. For the encoder: it keeps each texel on its side."""
    map_weights: MapWeights = SEEN_WEIGHTS
    """Weights of errors in each map, for the encoder; of no effect where there is one map."""

    @property
    def channels(self) -> int:
        """Channels of all maps."""
        return int(self.pixels.shape[2])

    @property
    def size(self) -> tuple[int, int]:
        """(width, height) in texels."""
        return self.pixels.shape[1], self.pixels.shape[0]
