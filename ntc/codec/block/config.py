"""The settings of codec `block`, and how it encodes. Needs no torch."""

from dataclasses import dataclass
from typing import ClassVar, Literal

from ntc.codec.encoding import EncodingOptions
from ntc.codec.maps import BASE_ALONE, MapName, maps_fit, ordered_maps, plane_channels
from ntc.codec.model import CodecSettings

LARGEST_WORDS, LARGEST_SET_WORDS = 16, 32
"""Largest code of a block in 32-bit words: of single textures, and of material sets."""
LARGEST_MODES, LARGEST_SET_MODES = 64, 128
"""Most modes: of single textures, and of material sets."""
LARGEST_SIZES = 4
"""Sizes of codes at most: two bits name one."""
FORMAT: Literal[2] = 2
"""Format of the codes: the one that is read and written."""
FEWEST_MODES = 8
"""Modes at least: the three bits before a code's first branch bit are the state that its path starts in."""
LARGEST_EDGE_BITS = 3
"""Index bits of a texel in an edge part at most."""
COLOUR_BITS = 8
"""Bits of a channel of an edge part's colour."""


@dataclass(frozen=True)
class BlockConfig(CodecSettings):
    """The shape of block codes and of the tables that a group shares, the same for every texture of a pack.

    A block is a latent cell: `downscale` and `smallest_top_cells` mean what they mean of codec `grid`.
    """

    kind: ClassVar[str] = "block"

    format: Literal[2] = FORMAT
    """Format of the codes."""
    mips: Literal[1, 2, 4] = 2
    """Mips that one code holds: 2 take 20 % fewer bits than 1."""
    block_side: Literal[4, 8] = 8
    """Texels of a block along one side."""
    block_words: tuple[int, ...] = (2, 4, 5, 8)
    """Sizes of a block's code in 32-bit words, rising, at most four: each block takes one of them. 4 words of 8x8 texels are 2 bits a
    texel."""
    mean_words: float = 4.0
    """Words that the encoder gives a block on average over a pack; decoding does not depend on it."""
    coefficients: int = 140
    """Rows of the group's basis, each of one channel: coefficients that a block may spend bits on."""
    modes: int = 32
    """Bit allocations of a group; each block names one of them. A power of two from 8, at most 64, or 128 with material sets."""
    output_channels: int = 3
    """Channels that the decoders write, 1 to 13: those of `maps`; a texture with fewer uses the first ones."""
    maps: tuple[MapName, ...] = BASE_ALONE
    """Maps that the channels belong to (`ntc.codec.maps`): all that any texture of the pack has."""
    levels: int | None = None
    """Encoded mips. None: all whose longer side is larger than a block, and the next one. 1: mip 0 alone."""
    tables: int | None = None
    """Version of the shipped tables for whole materials that decoders scale by gains (`ntc.codec.block.universal`). None: each
    decoder holds its tables."""

    def __post_init__(self) -> None:
        checks = {
            "format": self.format == FORMAT,
            "mips": self.mips in (1, 2, 4) and (self.mips < 4 or self.block_side == 8),
            "block_side": self.block_side in (4, 8),
            "block_words": 1 <= len(self.block_words) <= LARGEST_SIZES
            and list(self.block_words) == sorted(set(self.block_words))
            and self.block_words[0] >= 1
            and self.block_words[-1] <= self.largest_words,
            "mean_words": 0.0 < self.mean_words <= self.largest_words,
            "coefficients": 1 <= self.coefficients <= self.block_values,
            "modes": FEWEST_MODES <= self.modes <= (LARGEST_SET_MODES if self.has_sets else LARGEST_MODES)
            and self.modes & (self.modes - 1) == 0,
            "maps": ordered_maps(self.maps),
            "output_channels": maps_fit(self.maps, self.output_channels),
            "levels": self.levels is None or 1 <= self.levels <= 16,
            "tables": self.tables is None or 1 <= self.tables <= 255,
        }
        for field, valid in checks.items():
            if not valid:
                raise ValueError(f"codec.{field} = {getattr(self, field)!r:.80} is out of range")

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
    def mips_a_cell(self) -> int:
        """Mips at most that are decoded from one code."""
        return self.mips

    @property
    def code_sides(self) -> tuple[int, ...]:
        """Texels along one side that a code holds of each of its mips."""
        return tuple(self.block_side >> mip for mip in range(self.mips))

    @property
    def planes(self) -> tuple[tuple[int, ...], ...]:
        """Channels of each plane that has maps."""
        return tuple(tuple(channels.values()) for channels in plane_channels(self.maps, self.output_channels).values())

    @property
    def alpha(self) -> int | None:
        """Channel of the map `alpha`; None without one."""
        return self.output_channels - 1 if "alpha" in self.maps else None

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

    def edge_part_bits(self, plane: int, index_bits: int) -> int:
        """Bits of an edge part with so many index bits a texel: two colours of the plane's channels, then the indices."""
        if index_bits == 0:
            return 0
        return 2 * COLOUR_BITS * len(self.planes[plane]) + index_bits * self.block_texels

    @property
    def multiply_adds(self) -> int:
        """Multiply-adds of one texel's values at most: each coefficient's basis row, then the texture's axes."""
        return self.coefficients + self.axis_numbers

    @property
    def has_sets(self) -> bool:
        """True if textures may be material sets."""
        return self.maps != BASE_ALONE

    @property
    def largest_words(self) -> int:
        """Words of a block's code at most."""
        return LARGEST_SET_WORDS if self.has_sets else LARGEST_WORDS

    @property
    def row_bytes(self) -> int:
        """Stored bytes of a row of the basis: its texels, its channel and its scale."""
        return self.block_texels + 2

    @property
    def axis_numbers(self) -> int:
        """Numbers of a texture's axes: for each plane of k channels a matrix of k x k."""
        return sum(len(channels) ** 2 for channels in plane_channels(self.maps, self.output_channels).values())


@dataclass(frozen=True)
class BlockOptions(EncodingOptions):
    """Options of an encoding under given settings."""

    seed: int = 0
    """Seed of the random choice of blocks that tables are fitted to."""
    groups_apart: bool = False
    """True if words are allocated within each group, so that a group is the same whichever others are encoded. False: all textures
    of the task share all words."""
    quality_db: float | None = None
    """PSNR that each texture is to have at mip 0; it decides about the words. None: the settings do."""
    weights: tuple[float, ...] | None = None
    """Weight of an error in each texture, positive; only ratios matter. None: the same in all."""
    balance: float = 1.0
    """Goal of the bit allocation among textures: 0 minimises the mean squared error of all texels, 1 maximises the mean PSNR."""
    may_split_mips: bool = True
    """True if textures whose derived mips are worse than mip 0 may have fewer mips per code."""
    threads: int | None = None
    """Most threads; None: as many as shorten the encoding."""
    preview_side: int | None = None
    """Texels along the longer side of reduced textures that are encoded first, where groups have many times as many: a picture to show
    until they are encoded. None: none."""
    texture_words: tuple[tuple[int, float], ...] = ()
    """(texture, words a block on average) of textures to encode again under the decoders of the pack that the encoding starts from.
    All other textures stay as they are. Empty: fit tables to the groups and encode all their textures."""
