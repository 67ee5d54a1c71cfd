"""The settings of format 1 of codec `block`. Needs no torch."""

from dataclasses import dataclass
from typing import ClassVar, Literal

from ntc.codec.maps import BASE_ALONE, MapName, maps_fit, ordered_maps, plane_channels
from ntc.codec.model import CodecSettings

LARGEST_WORDS, LARGEST_SET_WORDS = 16, 32
"""Words of a block's code at most; of codecs for material sets, which have more to say."""
LARGEST_MODES, LARGEST_SET_MODES = 64, 128
"""Modes at most, likewise."""
LARGEST_SIZES = 4
"""Sizes of codes at most: two bits name one."""


@dataclass(frozen=True)
class BlockConfig(CodecSettings):
    """The shape of block codes and of the tables that a group shares, the same for every texture of a pack.

    A block is a latent cell: `downscale` and `smallest_top_cells` mean what they mean of codec `grid`.
    """

    kind: ClassVar[str] = "block-1"

    block_side: Literal[4, 8] = 8
    """Texels of a block along one side."""
    block_words: tuple[int, ...] = (2, 4, 5, 8)
    """Sizes of a block's code in 32-bit words, rising, at most four: each block takes one of them. 4 words of 8x8 texels are 2 bits a
    texel."""
    mean_words: float = 4.0
    """Words that the encoder gives a block on average over a pack; decoding does not depend on it."""
    coefficients: int = 96
    """Rows of the group's basis: coefficients that a block may spend bits on, in order of falling variance."""
    modes: int = 32
    """Bit allocations of a group; each block names one of them. A power of two, at most 64, or 128 with material sets."""
    output_channels: int = 3
    """Channels that the decoders write, 1 to 12: those of `maps`; a texture with fewer uses the first ones."""
    maps: tuple[MapName, ...] = BASE_ALONE
    """Maps that the channels stand for (`ntc.codec.maps`): all that any texture of the pack has."""
    levels: int | None = None
    """Encoded mips. None: all whose longer side is larger than a block, and the next one. 1: mip 0 alone."""

    def __post_init__(self) -> None:
        checks = {
            "block_side": self.block_side in (4, 8),
            "block_words": 1 <= len(self.block_words) <= LARGEST_SIZES
            and list(self.block_words) == sorted(set(self.block_words))
            and self.block_words[0] >= 1
            and self.block_words[-1] <= self.largest_words,
            "mean_words": 0.0 < self.mean_words <= self.largest_words,
            "coefficients": 1 <= self.coefficients <= self.block_values,
            "modes": 1 <= self.modes <= (LARGEST_SET_MODES if self.has_sets else LARGEST_MODES)
            and self.modes & (self.modes - 1) == 0,
            "maps": ordered_maps(self.maps),
            "output_channels": maps_fit(self.maps, self.output_channels),
            "levels": self.levels is None or 1 <= self.levels <= 16,
        }
        for field, valid in checks.items():
            if not valid:
                raise ValueError(f"codec.{field} = {getattr(self, field)!r} is out of range")

    @property
    def downscale(self) -> int:
        """Texels per latent cell along one side: those of a block."""
        return self.block_side

    @property
    def cell_bytes(self) -> int:
        """Bytes of a stored row of latents: one word."""
        return 4

    @property
    def smallest_top_cells(self) -> int:
        """The pyramid ends at the first level whose longer side is at most this many cells."""
        return 1

    @property
    def block_texels(self) -> int:
        """Texels of a block."""
        return self.block_side * self.block_side

    @property
    def block_values(self) -> int:
        """Numbers of a block: texels x channels."""
        return self.block_texels * self.output_channels

    @property
    def mode_bits(self) -> int:
        """Bits at the start of a block's code that name its mode."""
        return self.modes.bit_length() - 1

    @property
    def coefficient_bits(self) -> tuple[int, ...]:
        """By size of a code: its bits that are shared out among coefficients."""
        return tuple(32 * words - self.mode_bits for words in self.block_words)

    @property
    def multiply_adds(self) -> int:
        """Multiply-adds of one texel's values at most: each coefficient's basis row, then the texture's axes."""
        return self.coefficients * (1 if self.has_sets else self.output_channels) + self.axis_numbers

    @property
    def has_sets(self) -> bool:
        """Whether textures may be material sets: each row of the basis is then of one channel."""
        return self.maps != BASE_ALONE

    @property
    def largest_words(self) -> int:
        """Words of a block's code at most."""
        return LARGEST_SET_WORDS if self.has_sets else LARGEST_WORDS

    @property
    def row_bytes(self) -> int:
        """Stored bytes of a row of the basis; of one channel, the number of that."""
        return self.block_texels + 1 if self.has_sets else self.block_values

    @property
    def axis_numbers(self) -> int:
        """Numbers of a texture's axes: for each plane of k channels a matrix of k x k."""
        return sum(len(channels) ** 2 for channels in plane_channels(self.maps, self.output_channels).values())
