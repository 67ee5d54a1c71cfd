"""Reference decoder of BC7, BC5 and BC4 blocks in float64, for the modes that the compressing shaders write.

Sources: Khronos Data Format 1.3, Sec. 18 (RGTC) and 20 (BPTC).
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from viewer.gl.texture_arrays import GpuBlockFormat

PARTITIONS = {
    0: 0xCCCC, 1: 0x8888, 2: 0xEEEE, 3: 0xECC8, 4: 0xC880, 5: 0xFEEC, 6: 0xFEC8, 7: 0xEC80,
    8: 0xC800, 9: 0xFFEC, 10: 0xFE80, 11: 0xE800, 12: 0xFFE8, 13: 0xFF00, 14: 0xFFF0, 15: 0xF000,
}  # fmt: skip
"""Texels of the second subset, texel 0 in the lowest bit; the anchor of the second subset is texel 15."""
WEIGHTS = {
    2: (0, 21, 43, 64),
    3: (0, 9, 18, 27, 37, 46, 55, 64),
    4: (0, 4, 9, 13, 17, 21, 26, 30, 34, 38, 43, 47, 51, 55, 60, 64),
}
MODES = {1: (2, 6, 0, "shared", 3), 5: (1, 7, 8, "", 2), 6: (1, 7, 7, "own", 4), 7: (2, 5, 5, "own", 2)}
"""By mode: subsets, bits of colours and of alpha, p bits, bits of an index."""


class _Bits:
    def __init__(self, block: bytes) -> None:
        self._bits = int.from_bytes(block, "little")

    def take(self, count: int) -> int:
        taken = self._bits & ((1 << count) - 1)
        self._bits >>= count
        return taken


def _widened(value: int, bits: int) -> int:
    return value << (8 - bits) | value >> (2 * bits - 8)


def bc7_texels(block: bytes) -> NDArray[np.float64]:
    """Return [4, 4, 4] RGBA from 0 to 255 of a block of mode 1, 5, 6 or 7. Raises KeyError for other modes and partitions."""
    bits, mode = _Bits(block), 0
    while bits.take(1) == 0:
        mode += 1
    subsets, color_bits, alpha_bits, p_bits, index_bits = MODES[mode]
    second = PARTITIONS[bits.take(6)] if subsets == 2 else 0
    rotation = bits.take(2) if mode == 5 else 0
    counts = [color_bits] * 3 + ([alpha_bits] if alpha_bits else [])
    ends = [[bits.take(count) for _ in range(2 * subsets)] for count in counts]
    if p_bits:
        p_values = [bits.take(1) for _ in range(2 * subsets if p_bits == "own" else subsets)]
        p_values = p_values if p_bits == "own" else [p for p in p_values for _ in range(2)]
        ends = [[end << 1 | p for end, p in zip(channel, p_values, strict=True)] for channel in ends]
        counts = [count + 1 for count in counts]
    shown = [[_widened(end, n) for end in channel] for channel, n in zip(ends, counts, strict=True)]
    shown += [] if alpha_bits else [[255] * 2 * subsets]
    anchors = {0, 15} if subsets == 2 else {0}
    indices = [bits.take(index_bits - (texel in anchors)) for texel in range(16)]
    alphas = [bits.take(index_bits - (texel == 0)) for texel in range(16)] if mode == 5 else indices
    texels = np.zeros((16, 4))
    for texel in range(16):
        subset = second >> texel & 1
        for channel in range(4):
            weight = WEIGHTS[index_bits][alphas[texel] if channel == 3 else indices[texel]]
            low, high = shown[channel][2 * subset : 2 * subset + 2]
            texels[texel, channel] = ((64 - weight) * low + weight * high + 32) >> 6
    if rotation:
        texels[:, [rotation - 1, 3]] = texels[:, [3, rotation - 1]]
    return texels.reshape(4, 4, 4)


def bc4_texels(block: bytes) -> NDArray[np.float64]:
    """Return [4, 4, 1] values from 0 to 255, not rounded, of a block."""
    first, second = block[0], block[1]
    indices = int.from_bytes(block[2:8], "little")
    steps = 7 if first > second else 5
    palette = [first, second, *(((steps - k) * first + k * second) / steps for k in range(1, steps))]
    palette += [] if steps == 7 else [0.0, 255.0]
    return np.array([palette[indices >> 3 * texel & 7] for texel in range(16)], np.float64).reshape(4, 4, 1)


def _texels(block: bytes, block_format: GpuBlockFormat) -> NDArray[np.float64]:
    if block_format == "bc7":
        return bc7_texels(block)
    parts = [bc4_texels(block[start : start + 8]) for start in range(0, len(block), 8)]
    return np.concatenate(parts, axis=2)


def block_texels(blocks: bytes, size: tuple[int, int], block_format: GpuBlockFormat) -> NDArray[np.float64]:
    """Return [height, width, C] values from 0 to 255 of an image of `size` (width, height), those over the edge left out."""
    across, down = -(-size[0] // 4), -(-size[1] // 4)
    count = len(blocks) // (across * down)

    def rows() -> Iterator[NDArray[np.float64]]:
        for row in range(down):
            places = (count * (row * across + column) for column in range(across))
            yield np.concatenate([_texels(blocks[at : at + count], block_format) for at in places], axis=1)

    return np.concatenate(list(rows()))[: size[1], : size[0]]
