"""Texels in blocks, and the words of a block's code."""

import numpy as np
from numpy.typing import NDArray

from ntc.codec.block.config import BlockCodecConfig
from ntc.codec.block.model import BlockDecoder
from ntc.codec.config import WrapMode
from ntc.codec.latents import LatentLevel

_PAD_MODES = {"repeat": "wrap", "mirror": "symmetric", "clamp": "edge"}


def blocks_of(image: NDArray[np.float32], side: int, wrap: tuple[WrapMode, WrapMode]) -> NDArray[np.float32]:
    """[rows * columns, side * side, C]: `image` [H, W, C] in blocks, filled up beyond its edges by what its wrap modes (u, v) show."""
    height, width, channels = image.shape
    pad_v, pad_u = (0, -height % side), (0, -width % side)
    if pad_u[1]:
        image = np.pad(image, ((0, 0), pad_u, (0, 0)), mode=_PAD_MODES[wrap[0]])  # type: ignore[call-overload]
    if pad_v[1]:
        image = np.pad(image, (pad_v, (0, 0), (0, 0)), mode=_PAD_MODES[wrap[1]])  # type: ignore[call-overload]
    rows, columns = image.shape[0] // side, image.shape[1] // side
    parts = image.reshape(rows, side, columns, side, channels).transpose(0, 2, 1, 3, 4)
    return np.ascontiguousarray(parts.reshape(rows * columns, side * side, channels))


def image_of(blocks: NDArray[np.floating], level: LatentLevel, side: int) -> NDArray[np.floating]:
    """[height, width, C]: the inverse of `blocks_of` for the blocks [rows * columns, side * side, C] of `level`."""
    parts = blocks.reshape(level.height, level.width, side, side, -1).transpose(0, 2, 1, 3, 4)
    return parts.reshape(level.height * side, level.width * side, -1)[: level.texel_height, : level.texel_width]


def bit_offsets(decoder: BlockDecoder, config: BlockCodecConfig) -> NDArray[np.int64]:
    """[modes, coefficients] int64: where each coefficient's bits begin in a block's code, after the bits of the mode."""
    ends = np.cumsum(decoder.depths.astype(np.int64), axis=1)
    return config.mode_bits + ends - decoder.depths


def packed_codes(
    modes: NDArray[np.int64], indices: NDArray[np.uint32], decoder: BlockDecoder, config: BlockCodecConfig
) -> NDArray[np.uint32]:
    """[blocks, block_words] uint32 of modes [blocks] and stored indices [blocks, coefficients]."""
    # One word more: an index may seem to reach over the end while its high part is empty.
    words = np.zeros((len(modes), config.block_words + 1), np.uint64)
    words[:, 0] = modes.astype(np.uint64)
    offsets = bit_offsets(decoder, config)[modes]
    rows = np.arange(len(modes))
    for k in range(indices.shape[1]):
        word, shift = offsets[:, k] >> 5, (offsets[:, k] & 31).astype(np.uint64)
        word = np.minimum(word, config.block_words)
        value = indices[:, k].astype(np.uint64) << shift
        words[rows, word] |= value & np.uint64(0xFFFFFFFF)
        words[rows, np.minimum(word + 1, config.block_words)] |= value >> np.uint64(32)
    return words[:, : config.block_words].astype(np.uint32)


def unpacked_codes(
    codes: NDArray[np.uint32], decoder: BlockDecoder, config: BlockCodecConfig
) -> tuple[NDArray[np.int64], NDArray[np.uint32]]:
    """(modes [blocks] int64, stored indices [blocks, coefficients] uint32) of `codes` [blocks, block_words]."""
    modes = (codes[:, 0] & np.uint32(config.modes - 1)).astype(np.int64)
    offsets, depths = bit_offsets(decoder, config)[modes], decoder.depths[modes].astype(np.uint64)
    wide = np.concatenate([codes, np.zeros((len(codes), 2), np.uint32)], axis=1).astype(np.uint64)
    rows = np.arange(len(codes))
    indices = np.zeros(depths.shape, np.uint32)
    for k in range(depths.shape[-1]):
        word, shift = np.minimum(offsets[:, k] >> 5, config.block_words), (offsets[:, k] & 31).astype(np.uint64)
        both = wide[rows, word] | (wide[rows, word + 1] << np.uint64(32))
        indices[:, k] = ((both >> shift) & ((np.uint64(1) << depths[:, k]) - np.uint64(1))).astype(np.uint32)
    return modes, indices
