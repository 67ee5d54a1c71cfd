"""The slow twin of every decoder of codec `block`: numpy float64, written for reading."""

import numpy as np
from numpy.typing import NDArray

from ntc.codec.block.blocks import image_of, unpacked_codes
from ntc.codec.block.config import BlockCodecConfig
from ntc.codec.block.model import BlockDecoder, BlockTexture, scale_values
from ntc.codec.block.trellis import branch_tables, level_table
from ntc.codec.latents import LatentLevel, latent_levels

Array = NDArray[np.float64]


def decode_coefficients(codes: NDArray[np.uint32], decoder: BlockDecoder, config: BlockCodecConfig) -> Array:
    """[blocks, coefficients] float64 that `codes` [blocks, block_words] stand for.

    Any words are valid codes: whatever a file holds decodes to finite numbers.
    """
    modes, indices = unpacked_codes(codes, decoder, config)
    levels = level_table().astype(np.float64)
    following, subsets = branch_tables()
    scales = scale_values(decoder.scales)[modes]
    depths = decoder.depths[modes].astype(np.int64)
    values = np.zeros(depths.shape)
    state = np.zeros(len(codes), np.int64)
    for k in range(depths.shape[1]):
        active = depths[:, k] > 0
        branch, place = (indices[:, k] & 1).astype(np.int64), (indices[:, k] >> 1).astype(np.int64)
        number = 4 * place + subsets[state, branch]
        values[:, k] = np.where(active, levels[depths[:, k], number] * scales[:, k], 0.0)
        state = np.where(active, following[state, branch], state)
    return values


def block_values(
    texture: BlockTexture, codes: NDArray[np.uint32], decoder: BlockDecoder, config: BlockCodecConfig
) -> Array:
    """[blocks, texels of a block, channels] float64, not clamped, in the texture's colour space: what `codes` decode to."""
    coefficients = decode_coefficients(codes, decoder, config) * decoder.basis_scale.astype(np.float64)
    normalised = np.einsum("nk,ktc->ntc", coefficients, decoder.basis.astype(np.float64), optimize=True)
    values: Array = texture.mean.astype(np.float64) + normalised @ texture.axes.astype(np.float64).T
    return values


def texel_values(
    texture: BlockTexture,
    decoder: BlockDecoder,
    config: BlockCodecConfig,
    level: LatentLevel,
    column: NDArray[np.int64],
    row: NDArray[np.int64],
) -> Array:
    """[N, channels] float64, not clamped: the texels at `column` and `row` [N] of a level."""
    side = config.block_side
    block = level.first_cell + row // side * level.width + column // side
    used, place = np.unique(block, return_inverse=True)
    values = block_values(texture, texture.codes[used], decoder, config)
    return np.asarray(values[place.reshape(-1), row % side * side + column % side])


def decode_blocks(texture: BlockTexture, decoder: BlockDecoder, config: BlockCodecConfig) -> Array:
    """[blocks, texels of a block, channels] float64 in [0, 1], in the texture's colour space: all blocks of all levels."""
    shown: Array = np.clip(block_values(texture, texture.codes, decoder, config), 0.0, 1.0)
    return shown


def decode_image(
    texture: BlockTexture, decoder: BlockDecoder, config: BlockCodecConfig, level: int = 0
) -> NDArray[np.uint8]:
    """[h, w, channels] uint8 in the texture's colour space: mip `level`."""
    geometry = latent_levels(texture.width, texture.height, config)[level]
    first, count = geometry.first_cell, geometry.cells
    part = BlockTexture(texture.width, texture.height, texture.codes[first : first + count], texture.mean, texture.axes)
    values = image_of(decode_blocks(part, decoder, config), geometry, config.block_side)
    pixels: NDArray[np.uint8] = np.rint(values * 255.0).astype(np.uint8)
    return pixels
