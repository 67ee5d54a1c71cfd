"""The settings of codec `block`, and the geometry of a texture's blocks."""

from dataclasses import dataclass
from typing import Literal

LARGEST_DEPTH = 7
"""Bits of a coefficient at most."""
SCALE_STEPS_PER_OCTAVE = 16
"""Stored scales are powers of two in steps of 1/16 octave."""
SCALE_ORIGIN = 192
"""A stored scale of 192 is 1."""


@dataclass(frozen=True)
class BlockCodecConfig:
    """The shape of block codes and of the tables that a group shares, the same for every texture of a pack."""

    block_side: Literal[4, 8] = 8
    """Texels of a block along one side."""
    block_words: int = 4
    """32-bit words of a block's code: 4 words of 8x8 texels are 2 bits a texel."""
    coefficients: int = 96
    """Rows of the group's basis: coefficients that a block may spend bits on, in order of falling variance."""
    modes: int = 32
    """Bit allocations of a group; each block names one of them. A power of two, at most 64."""
    channels: int = 3
    """Channels of the textures, 1 to 4."""
    levels: int | None = None
    """Encoded mips. None: all whose longer side is larger than a block, and the next one."""

    def __post_init__(self) -> None:
        checks = {
            "block_side": self.block_side in (4, 8),
            "block_words": 1 <= self.block_words <= 16,
            "coefficients": 1 <= self.coefficients <= self.block_values,
            "modes": 1 <= self.modes <= 64 and self.modes & (self.modes - 1) == 0,
            "channels": 1 <= self.channels <= 4,
            "levels": self.levels is None or 1 <= self.levels <= 16,
        }
        for field, valid in checks.items():
            if not valid:
                raise ValueError(f"codec.{field} = {getattr(self, field)!r} is out of range")

    @property
    def block_texels(self) -> int:
        """Texels of a block."""
        return self.block_side * self.block_side

    @property
    def block_values(self) -> int:
        """Numbers of a block: texels x channels."""
        return self.block_texels * self.channels

    @property
    def mode_bits(self) -> int:
        """Bits at the start of a block's code that name its mode."""
        return self.modes.bit_length() - 1

    @property
    def coefficient_bits(self) -> int:
        """Bits of a block's code that its mode shares out among coefficients."""
        return 32 * self.block_words - self.mode_bits

    @property
    def bits_per_texel(self) -> float:
        """Bits of block codes per texel of one mip, side information left out."""
        return 32.0 * self.block_words / self.block_texels


@dataclass(frozen=True)
class BlockLevel:
    """The blocks of one mip, stored row by row, the row at v = 0 first."""

    width: int
    """Texels along u."""
    height: int
    """Texels along v."""
    columns: int
    """Blocks along u."""
    rows: int
    """Blocks along v."""
    first_block: int
    """Index of the mip's first block among all blocks of the texture."""


def block_levels(width: int, height: int, config: BlockCodecConfig) -> tuple[BlockLevel, ...]:
    """The encoded mips of a `width` x `height` texel texture, finest first; never empty.

    Mip l has max(1, side >> l) texels a side. The last one is the first that a single block holds.
    """
    levels: list[BlockLevel] = []
    first = 0
    while config.levels is None or len(levels) < config.levels:
        w, h = max(1, width >> len(levels)), max(1, height >> len(levels))
        columns, rows = -(-w // config.block_side), -(-h // config.block_side)
        levels.append(BlockLevel(w, h, columns, rows, first))
        first += columns * rows
        if columns == rows == 1:
            break
    return tuple(levels)
