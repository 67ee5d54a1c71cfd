"""Data of codec `two_colors`: for each block and plane of maps two colours, and an index of two bits a texel."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from ntc.codec.encoding import EncodingOptions
from ntc.codec.maps import BASE_ALONE, MapName, Plane, maps_fit, ordered_maps, plane_channels
from ntc.codec.model import CodecSettings, EncodedTexture

SIDE = 4
"""Texels of a block along one side."""
PLANE_WORDS = 3
"""32-bit words of a block in one plane: two colours of four components, and the indices."""


@dataclass(frozen=True)
class TwoColorsConfig(CodecSettings):
    """The settings: what is stored follows from the maps alone."""

    kind: ClassVar[str] = "two_colors"
    downscale: ClassVar[int] = SIDE
    smallest_top_cells: ClassVar[int] = 1

    output_channels: int = 3
    maps: tuple[MapName, ...] = BASE_ALONE
    levels: int | None = None

    def __post_init__(self) -> None:
        checks = {
            "maps": ordered_maps(self.maps),
            "output_channels": maps_fit(self.maps, self.output_channels),
            "levels": self.levels is None or 1 <= self.levels <= 16,
        }
        for field, valid in checks.items():
            if not valid:
                raise ValueError(f"codec.{field} = {getattr(self, field)!r} is out of range")

    @property
    def multiply_adds(self) -> int:
        return self.output_channels

    @property
    def planes(self) -> dict[Plane, dict[int, int]]:
        """Components of each plane, with the channel that each shows."""
        return plane_channels(self.maps, self.output_channels)

    @property
    def block_bytes(self) -> int:
        """Number of stored bytes of a block."""
        return 4 * PLANE_WORDS * len(self.planes)


@dataclass(frozen=True, eq=False, kw_only=True)
class TwoColorsTexture(EncodedTexture):
    """Texture encoded as blocks."""

    blocks: NDArray[np.uint8]
    """[blocks, block_bytes] uint8: all levels, one after the other. By plane: four bytes of the first colour, four of the second, then
    a byte of indices for each row of texels, the leftmost in the lowest bits."""


@dataclass(frozen=True)
class TwoColorsOptions(EncodingOptions):
    """Nothing to choose: the seed is recorded, and has no effect."""

    seed: int = 0
