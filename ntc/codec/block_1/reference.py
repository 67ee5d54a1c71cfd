"""The slow twin of every decoder of codec `block`: numpy float64, written for reading."""

import numpy as np
from numpy.typing import NDArray

from ntc.codec.block_1.codes import unpacked_codes
from ntc.codec.block_1.config import BlockConfig
from ntc.codec.block_1.model import BlockDecoder, BlockTexture
from ntc.codec.block_1.trellis import level_table
from ntc.codec.block_storage import BlockCodes, level_codes, level_rows
from ntc.codec.block_trellis import branch_tables, scale_values
from ntc.codec.config import WrapMode
from ntc.codec.latents import LatentLevel, texture_levels
from ntc.codec.sampling import bilinear, clamped_lod, trilinear

Array = NDArray[np.float64]


def decode_coefficients(stored: BlockCodes, decoder: BlockDecoder, config: BlockConfig) -> Array:
    """[blocks, coefficients] float64 that the codes of blocks stand for.

    Any words are valid codes: whatever a file holds decodes to finite numbers.
    """
    modes, found, indices = unpacked_codes(stored.codes, stored.sizes, decoder, config)
    levels = level_table().astype(np.float64)
    following, subsets = branch_tables()
    scales = scale_values(decoder.scales)[modes]
    depths = found.astype(np.int64)
    values = np.zeros(depths.shape)
    state = np.zeros(len(modes), np.int64)
    for k in range(depths.shape[1]):
        active = depths[:, k] > 0
        branch, place = (indices[:, k] & 1).astype(np.int64), (indices[:, k] >> 1).astype(np.int64)
        number = 4 * place + subsets[state, branch]
        values[:, k] = np.where(active, levels[depths[:, k], number] * scales[:, k], 0.0)
        state = np.where(active, following[state, branch], state)
    return values


def block_values(texture: BlockTexture, stored: BlockCodes, decoder: BlockDecoder, config: BlockConfig) -> Array:
    """[blocks, texels of a block, channels] float64, not clamped, in the texture's colour space: what codes decode to."""
    coefficients = decode_coefficients(stored, decoder, config) * decoder.basis_scale.astype(np.float64)
    normalised = np.einsum("nk,ktc->ntc", coefficients, decoder.basis.astype(np.float64), optimize=True)
    values: Array = texture.mean.astype(np.float64) + normalised @ texture.axes.astype(np.float64).T
    return values


def texture_codes(texture: BlockTexture, config: BlockConfig, level: int) -> BlockCodes:
    """The codes of all blocks of mip `level`. Raises ValueError for words that no encoder writes."""
    levels = texture_levels(texture, config)
    rows = level_rows(texture.words, levels, config)[level]
    return level_codes(texture.words[rows.first : rows.first + rows.rows], levels[level], config)


def texel_values(
    texture: BlockTexture,
    decoder: BlockDecoder,
    config: BlockConfig,
    level: int,
    column: NDArray[np.int64],
    row: NDArray[np.int64],
) -> Array:
    """[N, channels] float64, not clamped: the texels at `column` and `row` [N] of mip `level`."""
    side = config.block_side
    width = texture_levels(texture, config)[level].width
    used, place = np.unique(row // side * width + column // side, return_inverse=True)
    stored = texture_codes(texture, config, level)
    values = block_values(texture, BlockCodes(stored.codes[used], stored.sizes[used]), decoder, config)
    return np.asarray(values[place.reshape(-1), row % side * side + column % side])


def decode_blocks(texture: BlockTexture, decoder: BlockDecoder, config: BlockConfig, level: int) -> Array:
    """[blocks, texels of a block, channels] float64 in [0, 1], in the texture's colour space: all blocks of mip `level`."""
    values = block_values(texture, texture_codes(texture, config, level), decoder, config)
    shown: Array = np.clip(values, 0.0, 1.0)
    return shown


def decode_image(
    texture: BlockTexture, decoder: BlockDecoder, config: BlockConfig, level: int = 0
) -> NDArray[np.uint8]:
    """[h, w, channels] uint8 in the texture's colour space: mip `level`."""
    geometry = texture_levels(texture, config)[level]
    values = image_of(decode_blocks(texture, decoder, config, level), geometry, config.block_side)
    pixels: NDArray[np.uint8] = np.rint(values * 255.0).astype(np.uint8)
    return pixels


def image_of(blocks: NDArray[np.floating], level: LatentLevel, side: int) -> NDArray[np.floating]:
    """[height, width, C]: the inverse of `blocks_of` for the blocks [rows * columns, side * side, C] of `level`."""
    parts = blocks.reshape(level.height, level.width, side, side, -1).transpose(0, 2, 1, 3, 4)
    return parts.reshape(level.height * side, level.width * side, -1)[: level.texel_height, : level.texel_width]


def lookup_values(
    texture: BlockTexture,
    decoder: BlockDecoder,
    config: BlockConfig,
    uv: Array,
    lod: Array,
    wrap: tuple[WrapMode, WrapMode],
) -> Array:
    """[N, output_channels] float64, not clamped, at `uv` [N, 2] and `lod` [N]: decoded texels are blended."""
    levels = texture_levels(texture, config)

    def of_level(level: LatentLevel, at: Array) -> Array:
        def texel(column: NDArray[np.int64], row: NDArray[np.int64]) -> Array:
            return texel_values(texture, decoder, config, levels.index(level), column, row)

        return bilinear(texel, (level.texel_width, level.texel_height), at, wrap)

    return trilinear(levels, of_level, config.output_channels, uv, clamped_lod(lod, len(levels)), wrap)
