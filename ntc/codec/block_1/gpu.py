"""What decoders of format 1 of codec `block` hold, as shaders/ntc/block_1.glsl reads it: blocks of four 32-bit words.

First a block of zeros and the levels of the trellis, which all decoders share. Then for each decoder, four coefficients to a block,
- for each size of a code, for each mode its list of coefficients: a word for each, its scale as float32, whose lowest three bits hold
  its depth;
- for each four coefficients, for each texel, their rows of the basis: a word for each, a signed byte for each channel.

Of a codec for material sets each row is of one channel. Above a depth stand the component (2 bits) and the plane (2 bits) that the
coefficient adds to, and the basis is a word for each four coefficients and texel, a signed byte for each coefficient.
"""

from functools import lru_cache
from typing import cast

import numpy as np
from numpy.typing import NDArray

from ntc.codec.block_1.config import LARGEST_SIZES, BlockConfig
from ntc.codec.block_1.model import BlockDecoder, BlockTexture
from ntc.codec.block_1.trellis import level_table
from ntc.codec.block_storage import DIRECTORY_RUN, level_rows
from ntc.codec.block_trellis import LARGEST_DEPTH, branch_tables, scale_values
from ntc.codec.gpu import GpuTables, StoredRows, TextureFields, by_plane
from ntc.codec.latents import texture_levels
from ntc.codec.maps import PLANES, Plane, plane_channels
from ntc.codec.model import Decoder, EncodedTexture

Words = NDArray[np.uint32]
AT_ONCE = 4
"""Coefficients that shaders read at once."""
DEPTH_BITS = 3
PLANE_SHIFT = 5
"""Lowest bit of the plane in an entry of a list, above depth and component."""
NO_PLANE = 3
"""Plane of entries without bits: none of those that a codec has."""
DEPTH_MASK = np.uint32(7)
SET_MASK = np.uint32(127)
CHANNEL_TYPES = ("float", "vec2", "vec3", "vec4")


@lru_cache(maxsize=1)
def trellis_blocks() -> Words:
    """[blocks, 4] uint32: levels as float32. Depth b begins at block 2^(b - 1); each block holds one level of each subset.

    Block 0 holds zeros: what a coefficient of depth 0 has in place of a level.
    """
    levels = level_table()
    parts = [levels[depth, : 2 << depth].reshape(-1, 4) for depth in range(1, LARGEST_DEPTH + 1)]
    parts.insert(0, np.zeros((1, 4), np.float32))
    return np.concatenate(parts).astype("<f4").view("<u4")


def trellis_subsets() -> int:
    """Subset by state and branch bit, two bits each, that of branch 0 of state 0 in the lowest ones.

    The next state needs no table: it is (2 state + branch) modulo 8.
    """
    _, subsets = branch_tables()
    return sum(int(subset) << (2 * place) for place, subset in enumerate(subsets.reshape(-1)))


def entry_mask(config: BlockConfig) -> np.uint32:
    """Bits of a scale that give way to a depth, and for material sets to the row's component and plane: a relative error of 2^-22, or
    2^-18."""
    return SET_MASK if config.has_sets else DEPTH_MASK


def _row_places(config: BlockConfig) -> Words:
    """[channels] uint32: component, and plane times 4, of each channel."""
    found = np.zeros(config.output_channels, np.uint32)
    for plane, channels in plane_channels(config.maps, config.output_channels).items():
        for component, channel in channels.items():
            found[channel] = component + 4 * PLANES.index(plane)
    return found


class BlockTables(GpuTables):
    """Codes as files hold them, in rows of one word; tables of the transform, the same for every precision."""

    number_type = "u4"
    decodes_quads = True
    shader = "ntc/block_1.glsl"

    def __init__(self, settings: BlockConfig) -> None:
        super().__init__(settings)
        self._config = settings
        self.first_block = len(trellis_blocks())
        self.list_blocks = -(-settings.coefficients // AT_ONCE)
        self.basis = len(settings.block_words) * settings.modes * self.list_blocks
        texels_a_block = AT_ONCE if settings.has_sets else 1
        self.decoder_blocks = self.basis + self.list_blocks * settings.block_texels // texels_a_block

    def _lists(self, decoder: BlockDecoder) -> Words:
        exact = scale_values(decoder.scales) * decoder.basis_scale.astype(np.float64)
        scales = exact.astype("<f4").view("<u4")
        depths = decoder.depths(self._config)
        mask = entry_mask(self._config)
        words = ((scales + (mask + 1) // 2) & ~mask) | depths
        if self._config.has_sets:
            words |= _row_places(self._config)[decoder.row_channels] << DEPTH_BITS
        # Entries without bits belong to no plane: as 0 they would count as plane 0, whose pixels would load rows for them.
        empty = NO_PLANE << PLANE_SHIFT if self._config.has_sets else 0
        active = np.where(depths > 0, words, empty).astype(np.uint32)
        return self._padded(active, axis=2, value=empty).reshape(-1, AT_ONCE)

    def _basis(self, decoder: BlockDecoder) -> Words:
        config = self._config
        if config.has_sets:
            own = decoder.basis[np.arange(config.coefficients), :, decoder.row_channels]
            padded = np.pad(own, ((0, -len(own) % AT_ONCE), (0, 0)))
            four = np.ascontiguousarray(padded.reshape(self.list_blocks, AT_ONCE, -1).transpose(0, 2, 1))
            return four.view("<u4").reshape(-1, AT_ONCE)
        rows = np.zeros((config.coefficients, config.block_texels, 4), np.int8)
        rows[..., : config.output_channels] = decoder.basis
        words = self._padded(rows.view("<u4")[..., 0], axis=0)
        return np.ascontiguousarray(words.reshape(self.list_blocks, AT_ONCE, -1).transpose(0, 2, 1)).reshape(
            -1, AT_ONCE
        )

    def _padded(self, words: Words, axis: int, value: int = 0) -> Words:
        """Return `words` with `value` for the coefficients that the last four lack."""
        missing = self.list_blocks * AT_ONCE - words.shape[axis]
        widths = [(0, missing if number == axis else 0) for number in range(words.ndim)]
        return np.pad(words, widths, constant_values=value)

    def shared_data(self) -> bytes:
        return trellis_blocks().tobytes()

    def decoder_data(self, decoder: Decoder) -> bytes:
        own = cast(BlockDecoder, decoder)
        return np.concatenate([self._lists(own), self._basis(own)]).astype("<u4").tobytes()

    @property
    def _planes(self) -> dict[Plane, dict[int, int]]:
        return plane_channels(self._config.maps, self._config.output_channels)

    @property
    def record_fields(self) -> TextureFields:
        planes = len(self._planes)
        return (("mean", "<f4", (planes, 4)), ("axes", "<f4", (4 * planes, 4)))

    def fill_own_fields(self, record: np.void, texture: EncodedTexture) -> None:
        """Components that the codec lacks stay 0."""
        own = cast(BlockTexture, texture)
        for place, channels in enumerate(self._planes.values()):
            components, numbers = list(channels), list(channels.values())
            record["mean"][place][components] = own.mean[numbers]
            # GLSL reads an axis at a time: a column.
            axes = own.axes[np.ix_(numbers, numbers)].T
            record["axes"][4 * place : 4 * place + 4][np.ix_(components, components)] = axes

    def level_rows(self, texture: EncodedTexture) -> tuple[StoredRows, ...]:
        levels = texture_levels(texture, self._config)
        return level_rows(cast(BlockTexture, texture).words, levels, self._config)

    def latent_words(self, texture: EncodedTexture, rows: slice) -> Words:
        return np.ascontiguousarray(cast(BlockTexture, texture).words[rows, None], "<u4")

    def defines(self) -> list[str]:
        config = self._config
        values = {
            "BLOCK_SIDE": config.block_side,
            "CODE_SIZES": len(config.block_words),
            **{f"CLASS_{number}_WORDS": words for number, words in enumerate(_four(config.block_words))},
            "DIRECTORY_RUN": DIRECTORY_RUN,
            "MODES": config.modes,
            "FIRST_TABLE_BLOCK": self.first_block,
            "TABLE_BLOCKS": self.decoder_blocks,
            "LISTS_BLOCKS": self.basis,
            "LIST_BLOCKS": self.list_blocks,
            "MODE_BITS": f"{config.mode_bits}u",
            "TRELLIS_SUBSETS": f"{trellis_subsets()}u",
            "ENTRY_MASK": f"{int(entry_mask(config))}u",
            "ROW_CHANNELS": int(config.has_sets),
        }
        lines = [f"#define {name} {value}" for name, value in values.items()]
        return lines + by_plane(config, lambda _, channels: _channel_defines(max(channels) + 1))


def _four(sizes: tuple[int, ...]) -> tuple[int, ...]:
    """Words by size class; classes that the codec lacks, and no directory names, as the smallest."""
    return (*sizes, *[sizes[0]] * (LARGEST_SIZES - len(sizes)))


def _channel_defines(components: int) -> list[str]:
    """Defines for the first `components` components of a plane, which are all that it has."""
    return [
        f"#define CHANNELS_T {CHANNEL_TYPES[components - 1]}",
        f"#define BASIS_BYTES(bits) {', '.join(f'bits << {24 - 8 * byte} >> 24' for byte in range(components))}",
        f"#define ALL_CHANNELS(channels) vec4({', '.join(['channels', *['0.0'] * (4 - components)])})",
    ]
