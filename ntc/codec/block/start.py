"""A pack of mean colours, shown until the first group is encoded."""

from collections.abc import Sequence

import numpy as np

from ntc.codec.block.config import BlockConfig
from ntc.codec.block.model import BlockDecoder, BlockTexture
from ntc.codec.block.storage import BlockCodes, stored_words
from ntc.codec.codec import texture_fields
from ntc.codec.latents import latent_cell_count, latent_levels
from ntc.codec.maps import channel_places
from ntc.codec.model import Grouping, Pack
from ntc.codec.textures import SourceTexture

MEANT_TEXELS = 64
"""Least number of sampled texels along each side for a texture's mean colour, where it has as many."""


def mean_colour_pack(textures: Sequence[SourceTexture], grouping: Grouping, config: BlockConfig) -> Pack:
    """Return a pack in which every texel has about the mean colour of its texture, in the groups of `grouping`.

    Codes have their largest size, so that later snapshots fit into the same memory.
    """
    channels = config.output_channels
    decoder = BlockDecoder(
        np.zeros((config.coefficients, config.block_texels), np.int8),
        np.zeros(config.coefficients, np.uint8),
        np.zeros(config.coefficients, np.uint8),
        np.zeros((config.modes, config.coefficients), np.uint8),
        np.zeros((config.modes, len(config.planes)), np.uint8),
        None if config.tables is None else np.zeros(config.coefficients, np.int8),
    )
    encoded = []
    for texture, group in zip(textures, grouping.groups, strict=True):
        levels = latent_levels(*texture.size, config)
        blocks = latent_cell_count(*texture.size, config)
        mean = np.zeros((config.mips, channels), np.float32)
        strides = (1 + side // MEANT_TEXELS for side in texture.pixels.shape[:2])
        sample = texture.pixels[tuple(slice(None, None, stride) for stride in strides)]
        places = channel_places(texture.maps, texture.channels, config.maps, channels)
        mean[:, list(places)] = sample.mean(axis=(0, 1)) / 255.0
        empty = BlockCodes(
            np.zeros((blocks, config.block_words[-1]), np.uint32), np.full(blocks, len(config.block_words) - 1)
        )
        axes = np.zeros((channels, channels), np.float32)
        words = stored_words(empty, levels, config)
        encoded.append(BlockTexture(**texture_fields(texture, group), words=words, mean=mean, axes=axes))
    return Pack(config, grouping, tuple(encoded), (decoder,) * grouping.group_count)
