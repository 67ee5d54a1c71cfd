"""Masks: alpha that a renderer compares with a cutoff.

Which side of the cutoff a texel falls on is visible; its exact alpha is not. So blocks with texels on both sides take edge parts
whose colours lie on either side, and each texel takes an index on its side. In coarse mips the share of texels above the cutoff, the
coverage, counts: without care, leaves thin out with distance (Castano, "Computing alpha mipmaps", 2010). The mean of each derived
mip is therefore shifted until about as many of its texels are above the cutoff as in mip 0.
"""

import numpy as np
from numpy.typing import NDArray

from ntc.codec.block.codes import EdgePart
from ntc.codec.block.config import LARGEST_EDGE_BITS, BlockConfig
from ntc.codec.block.encoding.blocks import Array, Axes
from ntc.codec.block.model import BlockDecoder, BlockTexture
from ntc.codec.block.reference import channel_values, texture_codes
from ntc.codec.block.storage import BlockCodes
from ntc.codec.latents import texture_levels

SIDE_WEIGHT = 12.0
"""Penalty, as a squared error, of a texel on the side of fewer texels in a block without an edge part."""
COUNTED_BLOCKS = 4096
"""Approximate number of a texture's blocks whose coverage is counted."""
LEVEL_MARGIN = 16
"""Least distance in 8-bit steps between the cutoff and the alpha of any index."""
LEAST_GAP = 1.0 / 255.0
"""Least difference of alpha between the two texels that a shifted cutoff lies between."""
LARGEST_OFFSET = 0.45


def alpha_values(blocks: Array, axes: Axes, config: BlockConfig) -> Array:
    """[blocks, texels] float32: values of the map `alpha`, which the codec has, of normalised `blocks`."""
    channel = config.output_channels - 1
    normalised = blocks.reshape(-1, config.block_texels, config.output_channels)[..., channel]
    return np.asarray(axes.mean[0, channel] + normalised * axes.axes[channel, channel], np.float32)


def mixed_blocks(blocks: Array, axes: Axes, config: BlockConfig) -> NDArray[np.bool_]:
    """Return [blocks]: whether normalised `blocks` of a mask have texels on both sides of its cutoff; none where `axes` have no
    cutoff."""
    if axes.cutoff is None:
        return np.zeros(len(blocks), np.bool_)
    above = alpha_values(blocks, axes, config) >= axes.cutoff
    return np.asarray(above.any(1) & ~above.all(1))


def side_costs(blocks: Array, bits: tuple[int, ...], axes: Axes, config: BlockConfig) -> Array:
    """Return [blocks]: SIDE_WEIGHT for each texel of normalised `blocks` of a mask on the side of fewer texels; 0 where edge parts
    with `bits` by plane code the sides."""
    if axes.cutoff is None or bits[-1]:
        return np.zeros(len(blocks), np.float32)
    above = (alpha_values(blocks, axes, config) >= axes.cutoff).sum(1)
    scale = axes.inverse[-1, -1] ** 2 * SIDE_WEIGHT
    return np.asarray(np.minimum(above, config.block_texels - above) * np.float32(scale), np.float32)


def mask_part(fitted: EdgePart, values: Array, cutoff: float) -> EdgePart:
    """Return `fitted`, the edge parts of the map `alpha` of blocks with `values` [blocks, texels], with each texel on its side of
    `cutoff`.

    Values and cutoff are in steps of 8 bits. Colours of the least squared error stay where an index leads to either side.
    """
    largest = ((1 << fitted.bits) - 1).astype(np.float32)[:, None]
    above = np.asarray(values >= cutoff, np.bool_)
    first, second = (fitted.colours[:, number].astype(np.float32) for number in (0, 1))
    numbers = np.arange(1 << LARGEST_EDGE_BITS, dtype=np.float32)
    levels = (first + (second - first) * numbers / largest)[:, None]
    wrong = np.where(above[..., None], levels < cutoff + LEVEL_MARGIN, levels >= cutoff - LEVEL_MARGIN)
    lost = np.abs(levels - values[..., None]) + np.where(wrong, np.float32(1e4), np.float32(0.0))
    lost[np.broadcast_to((numbers > largest)[:, None], lost.shape)] = np.inf
    indices = lost.argmin(2)
    torn = np.asarray(np.take_along_axis(wrong, indices[..., None], axis=2).any((1, 2)), np.bool_)
    ends = np.stack([_means(values, ~above), _means(values, above)], axis=1)
    colours = np.where(torn[:, None], np.rint(np.clip(ends, 0.0, 255.0)), fitted.colours[..., 0]).astype(np.uint8)
    chosen = np.where(torn[:, None], above * largest, indices).astype(np.uint8)
    return fitted._replace(colours=colours[..., None], indices=chosen)


def _means(values: Array, chosen: NDArray[np.bool_]) -> Array:
    """[blocks] mean of the `chosen` of `values` [blocks, texels]; of all where none is chosen."""
    used = np.where(chosen.any(1, keepdims=True), chosen, True)
    return np.asarray((values * used).sum(1) / used.sum(1), np.float32)


def mask_words(config: BlockConfig) -> int:
    """Return the words of the smallest codes that have room for an index a texel of the map `alpha`; the most where none has."""
    bits = config.mode_bits + config.edge_part_bits(len(config.planes) - 1, 1)
    return next((words for words in config.block_words if 32 * words >= bits), config.block_words[-1])


def keep_coverage(
    texture: BlockTexture, decoder: BlockDecoder, config: BlockConfig, cutoff: float, share: float
) -> None:
    """Set the means of derived mips of the map `alpha`, so that about the `share` of their texels is at or above `cutoff`."""
    levels = texture_levels(texture, config)
    channel = config.output_channels - 1
    for mip in range(1, config.mips):
        number = next((number for number, level in enumerate(levels) if level.mip_of_cell == mip), None)
        texture.mean[mip, channel] = texture.mean[0, channel]
        if number is None:
            continue
        stored = texture_codes(texture, config, number)
        rows = np.unique(np.linspace(0, len(stored.codes) - 1, COUNTED_BLOCKS).astype(np.int64))
        part = BlockCodes(stored.codes[rows], stored.sizes[rows])
        values = channel_values(texture, part, decoder, config, mip)
        texture.mean[mip, channel] += coverage_offset(values.reshape(-1), cutoff, share)


def coverage_offset(values: NDArray[np.floating], cutoff: float, share: float) -> float:
    """Return what to add to `values` [N] so that about the `share` of them is at or above `cutoff`."""
    falling = np.sort(values.astype(np.float64))[::-1]
    # A cutoff may fall before the first, behind the last, or between two that are far enough apart.
    ends = np.concatenate([[falling[0] + 1.0], falling, [falling[-1] - 1.0]])
    gaps = np.flatnonzero(ends[:-1] - ends[1:] > LEAST_GAP)
    place = int(gaps[np.abs(gaps - share * len(falling)).argmin()])
    middle = 0.5 * (ends[place] + ends[place + 1])
    return float(np.clip(cutoff - middle, -LARGEST_OFFSET, LARGEST_OFFSET))
