"""Mip 0 of an encoded texture for the measure of its quality, decoded in float64 by compiled code."""

import numpy as np
from numpy.typing import NDArray

from ntc.codec.block.codes import edge_parts
from ntc.codec.block.config import BlockConfig
from ntc.codec.block.encoding.search import compiled
from ntc.codec.block.model import BlockDecoder, BlockTexture, scale_values
from ntc.codec.block.reference import decode_image, edge_values, image_of, texture_codes
from ntc.codec.block.storage import BlockCodes
from ntc.codec.block.trellis import level_table
from ntc.codec.latents import latent_levels

BLOCKS_AT_ONCE = 1 << 14


def finest_image(texture: BlockTexture, decoder: BlockDecoder, config: BlockConfig) -> NDArray[np.uint8]:
    """Return [h, w, output channels] uint8: mip 0, but for rounding what `reference.decode_image` gives."""
    if compiled is None:
        return decode_image(texture, decoder, config)
    stored = texture_codes(texture, config, 0)
    geometry = latent_levels(texture.width, texture.height, config)[0]
    parts = []
    for start in range(0, geometry.cells, BLOCKS_AT_ONCE):
        own = slice(start, min(start + BLOCKS_AT_ONCE, geometry.cells))
        parts.append(_blocks(texture, BlockCodes(stored.codes[own], stored.sizes[own]), decoder, config))
    return np.asarray(image_of(np.concatenate(parts), geometry, config), np.uint8)


def _blocks(texture: BlockTexture, stored: BlockCodes, decoder: BlockDecoder, config: BlockConfig) -> NDArray[np.uint8]:
    """Return [blocks, texels, channels] uint8."""
    modes = (stored.codes[:, 0] & np.uint32(config.modes - 1)).astype(np.int64)
    coefficients = np.zeros((len(modes), config.coefficients))
    levels, scales = level_table(), scale_values(decoder.scales)
    for size in range(len(config.block_words)):
        own = np.nonzero(stored.sizes == size)[0]
        tables = compiled.search_tables(decoder, config, size)
        found = np.zeros((len(own), config.coefficients))
        with_bits = scales[np.arange(config.modes)[:, None], tables.rows]
        shape = (tables.counts, tables.rows, tables.depths, with_bits, tables.first)
        compiled.read_codes(stored.codes[own], modes[own], found, *shape, levels)
        coefficients[own] = found
    rows = decoder.basis * scale_values(decoder.basis_scale)[:, None]
    transformed = np.zeros((len(modes), config.block_texels, config.output_channels))
    for channel in range(config.output_channels):
        own = np.nonzero(decoder.channels == channel)[0]
        transformed[..., channel] = coefficients[:, own] @ rows[own]
    values = transformed @ texture.axes.T.astype(np.float64)
    base = np.zeros_like(values) + texture.mean[0]
    for channels, part in zip(config.planes, edge_parts(stored, decoder, config), strict=True):
        texels = np.arange(config.block_texels)
        base[np.ix_(part.blocks, texels, np.array(channels, np.int64))] = edge_values(part, config, 0)
    values += base
    return np.rint(np.clip(values, 0.0, 1.0) * 255.0).astype(np.uint8)
