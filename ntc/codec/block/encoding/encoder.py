"""Encoding a texture under a group's tables: sizes of codes, modes, trellis-coded indices. Torch on the CPU, float32."""

from collections.abc import Callable, Sequence

import numpy as np
import torch
from numpy.typing import NDArray

from ntc.codec.block.codes import packed_codes
from ntc.codec.block.config import BlockConfig
from ntc.codec.block.encoding.blocks import prepare_texture, sample_textures
from ntc.codec.block.encoding.quantizer import TrellisQuantizer, best_modes, expected_errors
from ntc.codec.block.encoding.sharing import sizes_within
from ntc.codec.block.encoding.tables import Tables, fit_decoder, one_thread
from ntc.codec.block.model import BlockDecoder, BlockTexture
from ntc.codec.block.storage import BlockCodes, stored_words
from ntc.codec.block.trellis import indices_of
from ntc.codec.codec import texture_fields
from ntc.codec.latents import LatentLevel, latent_levels
from ntc.codec.textures import SourceTexture

BLOCKS_AT_ONCE = 1 << 14


def encode_texture(
    source: SourceTexture,
    decoder: BlockDecoder,
    config: BlockConfig,
    quantizer: TrellisQuantizer,
    words: float,
    group: int = 0,
    worked: Callable[[int], None] = lambda _: None,
) -> BlockTexture:
    """A texture in `group` under its tables, of `words` words a block on average at most, where its sizes allow that.

    `worked` is called often, with the blocks that have been encoded since; what it raises ends the encoding.
    """
    texture = prepare_texture(source, config)
    with one_thread():
        tables = Tables.of(decoder, config)
        values = torch.from_numpy(texture.blocks) @ tables.projection
        parts = torch.split(values, BLOCKS_AT_ONCE)
        expected = torch.cat([expected_errors(part, tables.depths, tables.scales).amin(2) for part in parts])
        levels = latent_levels(*source.size, config)
        sizes = torch.from_numpy(_sizes(expected.numpy(), levels, config, words))
        codes = _codes(values, sizes, tables, config, quantizer, worked)
    stored = stored_words(BlockCodes(codes, sizes.numpy()), levels, config)
    axes = texture.axes
    return BlockTexture(**texture_fields(source, group), words=stored, mean=axes.mean, axes=axes.axes)


def _sizes(
    expected: NDArray[np.float32], levels: Sequence[LatentLevel], config: BlockConfig, words: float
) -> NDArray[np.int64]:
    """[blocks] size classes; every level takes `words` words a block, for a coarse mip is looked at as often as a fine one."""
    lengths, left = np.array(config.block_words), 0.0
    found: list[NDArray[np.int64]] = []
    for level in reversed(levels):
        own = expected[level.first_cell : level.first_cell + level.cells]
        # What a level cannot share out goes to the next finer one.
        found.append(sizes_within(own, config.block_words, words + left / level.cells))
        left += words * level.cells - float(lengths[found[-1]].sum())
    return np.concatenate(found[::-1])


def _codes(
    values: torch.Tensor,
    sizes: torch.Tensor,
    tables: Tables,
    config: BlockConfig,
    quantizer: TrellisQuantizer,
    worked: Callable[[int], None],
) -> NDArray[np.uint32]:
    """[blocks, words of the largest code] uint32 for coefficients `values` [blocks, coefficients] and size classes `sizes`."""
    found = np.zeros((len(values), config.block_words[-1]), np.uint32)
    # Small codes have bits for few coefficients: the search takes as many steps as the largest code among its blocks has.
    for size in range(len(config.block_words)):
        own = torch.nonzero(sizes == size)[:, 0]
        for rows in torch.split(own, BLOCKS_AT_ONCE):
            if len(rows):
                found[rows.numpy()] = _codes_of_size(values[rows], size, tables, config, quantizer)
                worked(len(rows))
    return found


def _codes_of_size(
    values: torch.Tensor,
    size: int,
    tables: Tables,
    config: BlockConfig,
    quantizer: TrellisQuantizer,
) -> NDArray[np.uint32]:
    allocation = tables.depths[size : size + 1]
    expected = expected_errors(values, allocation, tables.scales)[:, 0]
    modes = best_modes(values, expected, allocation, tables.scales)
    chosen = tables.depths[size, modes]
    numbers, _ = quantizer.quantize(values, chosen, tables.scales[modes])
    indices = indices_of(numbers.numpy(), chosen.numpy())
    return packed_codes(modes.numpy(), np.full(len(values), size), indices, tables.depths.numpy(), config)


def encode_group(
    sources: Sequence[SourceTexture], config: BlockConfig, seed: int = 0
) -> tuple[BlockDecoder, tuple[BlockTexture, ...]]:
    """Tables and codes of textures that share a decoder. `seed` decides which blocks are sampled, and so every byte."""
    decoder, quantizer = fit_decoder(sample_textures(sources, config, seed), config, seed), TrellisQuantizer()
    return decoder, tuple(encode_texture(source, decoder, config, quantizer, config.mean_words) for source in sources)
