"""Mip 0 of an encoded texture for the measure of its quality, decoded in float64 by compiled code."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ntc.codec.block.codes import EdgePart, edge_parts
from ntc.codec.block.config import BlockConfig
from ntc.codec.block.encoding import compiled_texels, compiled_trellis
from ntc.codec.block.encoding.transform import one_thread
from ntc.codec.block.model import BlockDecoder, BlockTexture
from ntc.codec.block.reference import edge_values, image_of, texture_codes
from ntc.codec.block.storage import BlockCodes
from ntc.codec.block.trellis import level_table, scale_values
from ntc.codec.latents import texture_levels
from ntc.threads import mapped

BLOCKS_AT_ONCE = 1 << 13


def shown_channels(image: NDArray[np.uint8], places: Sequence[int]) -> NDArray[np.uint8]:
    """Return the channels `places` of `image` [h, w, channels], which are not copied where they are all."""
    return image if list(places) == list(range(image.shape[2])) else image[..., list(places)]


def finest_image(
    texture: BlockTexture, decoder: BlockDecoder, config: BlockConfig, threads: int = 1
) -> NDArray[np.uint8]:
    """Return [h, w, output channels] uint8: mip 0, but for rounding what `reference.decode_image` gives."""
    stored = texture_codes(texture, config, 0)
    geometry = texture_levels(texture, config)[0]
    runs = [
        slice(start, min(start + BLOCKS_AT_ONCE, geometry.cells)) for start in range(0, geometry.cells, BLOCKS_AT_ONCE)
    ]
    with one_thread():
        parts = mapped(
            lambda run: _blocks(texture, BlockCodes(stored.codes[run], stored.sizes[run]), decoder, config),
            runs,
            threads,
        )
    return np.asarray(image_of(np.concatenate(parts), geometry, config), np.uint8)


def coefficients_of(stored: BlockCodes, decoder: BlockDecoder, config: BlockConfig) -> NDArray[np.float64]:
    """Return [blocks, coefficients] float64: the coefficients of codes, as `reference.decode_coefficients` does."""
    modes = (stored.codes[:, 0] & np.uint32(config.modes - 1)).astype(np.int64)
    coefficients = np.zeros((len(modes), config.coefficients))
    levels, scales = level_table(), scale_values(decoder.scales)
    for size in range(len(config.block_words)):
        rows = np.nonzero(stored.sizes == size)[0]
        tables = compiled_trellis.search_tables(decoder, config, size)
        values = np.zeros((len(rows), config.coefficients))
        with_bits = scales[np.arange(config.modes)[:, None], tables.rows]
        shape = (tables.counts, tables.rows, tables.depths, with_bits, tables.first)
        compiled_trellis.read_codes(stored.codes[rows], modes[rows], values, *shape, levels)
        coefficients[rows] = values
    return coefficients


def _blocks(texture: BlockTexture, stored: BlockCodes, decoder: BlockDecoder, config: BlockConfig) -> NDArray[np.uint8]:
    """Return [blocks, texels, channels] uint8."""
    coefficients = coefficients_of(stored, decoder, config)
    rows = decoder.basis * scale_values(decoder.basis_scale)[:, None]
    transformed = np.zeros((config.output_channels, len(coefficients), config.block_texels))
    for channel in range(config.output_channels):
        channel_rows = np.nonzero(decoder.channels == channel)[0]
        np.matmul(coefficients[:, channel_rows], rows[channel_rows], out=transformed[channel])
    shown = np.empty((len(coefficients), config.block_texels, config.output_channels), np.uint8)
    compiled_texels.show(transformed, texture.mean[0].astype(np.float64), texture.axes.astype(np.float64), shown)
    parts = edge_parts(stored, decoder, config)
    with_parts = np.unique(np.concatenate([part.blocks for part in parts]))
    if len(with_parts):
        shown[with_parts] = _with_edges(texture, transformed[:, with_parts], parts, with_parts, config)
    return shown


def _with_edges(
    texture: BlockTexture,
    transformed: NDArray[np.float64],
    parts: Sequence[EdgePart],
    blocks: NDArray[np.int64],
    config: BlockConfig,
) -> NDArray[np.uint8]:
    """Return [blocks, texels, channels] uint8 of `blocks`, which have edge `parts`."""
    values = transformed.transpose(1, 2, 0) @ texture.axes.T.astype(np.float64)
    base = np.zeros_like(values) + texture.mean[0]
    for channels, part in zip(config.planes, parts, strict=True):
        places = np.ix_(np.searchsorted(blocks, part.blocks), np.arange(config.block_texels), np.array(channels))
        base[places] = edge_values(part, config, 0)
    return np.asarray(np.rint(np.clip(values + base, 0.0, 1.0) * 255.0), np.uint8)
