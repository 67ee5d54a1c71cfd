"""Textures of codec `block` as packs hold them: the words of codes as bytes, mean and axes as offset and scale."""

import numpy as np

from ntc.codec.block.config import BlockCodecConfig
from ntc.codec.block.model import BlockTexture
from ntc.codec.model import EncodedTexture
from ntc.codec.textures import SourceTexture

WORD = np.dtype("<u4")


def block_texture(texture: EncodedTexture, config: BlockCodecConfig) -> BlockTexture:
    """`texture` of a pack of codec `block`, with its codes as words. Nothing is copied where the machine is little-endian."""
    codes = np.ascontiguousarray(texture.latents).view(WORD).reshape(-1, config.block_words)
    axes = texture.scale.reshape(config.output_channels, config.output_channels)
    return BlockTexture(texture.width, texture.height, codes.astype(np.uint32, copy=False), texture.offset, axes)


def encoded_block_texture(source: SourceTexture, group: int, block: BlockTexture) -> EncodedTexture:
    """`source` in `group`, encoded as `block`; its PSNR is not yet known."""
    codes = np.ascontiguousarray(block.codes.astype(WORD, copy=False))
    return EncodedTexture(
        name=source.name,
        pixel_hash=source.pixel_hash,
        width=block.width,
        height=block.height,
        channels=source.pixels.shape[2],
        color_space=source.color_space,
        wrap=source.wrap,
        category=source.category,
        group=group,
        latents=codes.view(np.uint8).reshape(len(codes), -1),
        scale=block.axes.reshape(-1),
        offset=block.mean,
    )
