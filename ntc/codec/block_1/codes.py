"""The bits of a block's code: its mode, then the indices of its coefficients."""

import numpy as np
from numpy.typing import NDArray

from ntc.codec.block_1.config import BlockConfig
from ntc.codec.block_1.model import BlockDecoder


def bit_offsets(depths: NDArray[np.integer], config: BlockConfig) -> NDArray[np.int64]:
    """int64 of the shape of `depths` [..., coefficients]: where each coefficient's bits begin in a code,
    after the bits of the mode."""
    wide = depths.astype(np.int64)
    return config.mode_bits + np.cumsum(wide, axis=-1) - wide


def unpacked_codes(
    codes: NDArray[np.uint32], sizes: NDArray[np.int64], decoder: BlockDecoder, config: BlockConfig
) -> tuple[NDArray[np.int64], NDArray[np.uint8], NDArray[np.uint32]]:
    """(modes [blocks], depths [blocks, coefficients], stored indices [blocks, coefficients]) of `codes` [blocks, words of the largest
    code] of size classes `sizes` [blocks]."""
    modes = (codes[:, 0] & np.uint32(config.modes - 1)).astype(np.int64)
    table = decoder.depths(config)
    offsets, depths = bit_offsets(table, config)[sizes, modes], table[sizes, modes]
    wide = np.concatenate([codes, np.zeros((len(codes), 2), np.uint32)], axis=1).astype(np.uint64)
    rows = np.arange(len(codes))
    indices = np.zeros(depths.shape, np.uint32)
    for k in range(depths.shape[-1]):
        word, shift = np.minimum(offsets[:, k] >> 5, codes.shape[1]), (offsets[:, k] & 31).astype(np.uint64)
        both = wide[rows, word] | (wide[rows, word + 1] << np.uint64(32))
        mask = (np.uint64(1) << depths[:, k].astype(np.uint64)) - np.uint64(1)
        indices[:, k] = ((both >> shift) & mask).astype(np.uint32)
    return modes, depths, indices
