"""What is at one pixel of the picture, and around it, in both slots."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ntc.codec.color import linear_to_srgb8

REACH = 7
"""Pixels that are shown on each side of the one in the middle."""


@dataclass(frozen=True, eq=False)
class PixelPatch:
    """One slot around the pixel."""

    linear: NDArray[np.float32]
    """[15, 15, 3] linear light; 0 outside the picture."""

    @property
    def srgb8(self) -> NDArray[np.uint8]:
        """[15, 15, 3] 8-bit sRGB."""
        return linear_to_srgb8(self.linear)

    @property
    def middle(self) -> tuple[tuple[float, ...], tuple[int, ...]]:
        """The pixel itself: linear light, and 8-bit sRGB."""
        return tuple(self.linear[REACH, REACH].tolist()), tuple(self.srgb8[REACH, REACH].tolist())


@dataclass(frozen=True, eq=False)
class PixelContent:
    """One pixel."""

    x: int
    y: int
    """Counted from the upper left corner of the picture, from 0."""
    picture: tuple[int, int]
    """(width, height) in pixels."""
    a: PixelPatch | None
    """None while the slot has not been drawn."""
    b: PixelPatch | None
    inside: tuple[int, int, int, int]
    """Left, top, right, bottom of the part of the patches that lies inside the picture."""
    material_name: str | None
    """None for the background."""
    texture_id: int
    """-1 for none."""
    texture_name: str
    uv: tuple[float, float]
    """Not wrapped."""
    lod: float | None
    """Level of detail that the surface asks for, from 0 for the largest mip; None without a texture."""
    decoders: Mapping[str, int]
    """Decoder of the texture by the source's name; -1 where nothing is decoded."""
    block_decoders: Mapping[str, int]
    """D of the pixel's block by the source's name."""

    @property
    def rectangle(self) -> tuple[float, float, float, float]:
        """Left, top, right, bottom of the patch as shares of the picture."""
        width, height = self.picture
        return (
            (self.x - REACH) / width,
            (self.y - REACH) / height,
            (self.x + REACH + 1) / width,
            (self.y + REACH + 1) / height,
        )


@dataclass(frozen=True)
class PatchPlace:
    """Which pixels are read back for a patch around (x, y) of a picture of `picture` (width, height) pixels."""

    x: int
    y: int
    picture: tuple[int, int]

    @classmethod
    def at(cls, share: tuple[float, float], picture: tuple[int, int]) -> "PatchPlace":
        """Around a place given as shares of the picture from its upper left corner."""
        x, y = (min(max(int(value * side), 0), side - 1) for value, side in zip(share, picture, strict=True))
        return cls(x, y, picture)

    @property
    def pixels(self) -> tuple[int, int, int, int]:
        """Left, top, right, bottom in pixels; cut off at the picture's edge."""
        width, height = self.picture
        return (
            max(self.x - REACH, 0),
            max(self.y - REACH, 0),
            min(self.x + REACH + 1, width),
            min(self.y + REACH + 1, height),
        )

    @property
    def inside(self) -> tuple[int, int, int, int]:
        """The same, counted from the patch's own upper left corner."""
        left, top, right, bottom = self.pixels
        x, y = self.x - REACH, self.y - REACH
        return left - x, top - y, right - x, bottom - y

    def patch(self, read: NDArray[np.float32]) -> PixelPatch:
        """The patch whose part inside the picture is `read` [h, w, 3]."""
        side = 2 * REACH + 1
        linear = np.zeros((side, side, 3), np.float32)
        left, top, right, bottom = self.inside
        linear[top:bottom, left:right] = read
        return PixelPatch(linear)
