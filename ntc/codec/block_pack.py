"""Textures of codec `block` as packs hold them: words as bytes, mean and axes as offset and scale."""

import numpy as np
from numpy.typing import NDArray

from ntc.codec.block.config import BlockCodecConfig
from ntc.codec.block.model import BlockTexture
from ntc.codec.block.storage import StoredRows, level_rows
from ntc.codec.latents import latent_levels
from ntc.codec.maps import plane_channels
from ntc.codec.model import AnyCodec, EncodedTexture
from ntc.codec.textures import SourceTexture

WORD = np.dtype("<u4")


def block_texture(texture: EncodedTexture, config: BlockCodecConfig) -> BlockTexture:
    """`texture` of a pack of codec `block`, with its latents as words. Nothing is copied where the machine is little-endian."""
    words = np.ascontiguousarray(texture.latents).view(WORD).reshape(-1)
    axes = axes_matrix(texture.scale, config)
    return BlockTexture(texture.width, texture.height, words.astype(np.uint32, copy=False), texture.offset, axes)


def _plane_blocks(config: BlockCodecConfig) -> list[tuple[NDArray[np.intp], ...]]:
    """By plane: what picks its part out of a matrix of channels."""
    planes = plane_channels(config.maps, config.output_channels).values()
    return [np.ix_(list(channels.values()), list(channels.values())) for channels in planes]


def axes_matrix(parts: NDArray[np.float32], config: BlockCodecConfig) -> NDArray[np.float32]:
    """[channels, channels] float32: `BlockTexture.axes` of its `parts` as packs hold them."""
    axes, first = np.zeros((config.output_channels, config.output_channels), np.float32), 0
    for own in _plane_blocks(config):
        count = own[0].size
        axes[own] = parts[first : first + count * count].reshape(count, count)
        first += count * count
    return axes


def axes_parts(axes: NDArray[np.float32], config: BlockCodecConfig) -> NDArray[np.float32]:
    """[`BlockCodecConfig.axis_numbers`] float32: for each plane the rows of its part of `axes`, one after the other."""
    return np.concatenate([axes[own].reshape(-1) for own in _plane_blocks(config)])


def latent_rows(texture: EncodedTexture, config: AnyCodec) -> tuple[StoredRows, ...]:
    """Where each level lies in `texture.latents`: cells of codec `grid`, words of codec `block`.

    Raises ValueError for latents of codec `block` that no encoder writes.
    """
    levels = latent_levels(texture.width, texture.height, config)
    if isinstance(config, BlockCodecConfig):
        return level_rows(block_texture(texture, config).words, levels, config)
    return tuple(StoredRows(level.first_cell, level.cells) for level in levels)


def encoded_block_texture(
    source: SourceTexture, group: int, block: BlockTexture, config: BlockCodecConfig
) -> EncodedTexture:
    """`source` in `group`, encoded as `block`; its PSNR is not yet known."""
    words = np.ascontiguousarray(block.words.astype(WORD, copy=False))
    return EncodedTexture(
        name=source.name,
        pixel_hash=source.pixel_hash,
        width=block.width,
        height=block.height,
        channels=source.channels,
        color_space=source.color_space,
        wrap=source.wrap,
        category=source.category,
        group=group,
        latents=words.view(np.uint8).reshape(-1, WORD.itemsize),
        scale=axes_parts(block.axes, config),
        offset=block.mean,
        maps=source.maps,
    )
