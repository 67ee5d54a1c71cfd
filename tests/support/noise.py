"""shaders/common/noise.glsl in numpy, to the bit: thresholds in units of 2^-32 as uint32."""

import numpy as np
from numpy.typing import NDArray

Words = NDArray[np.uint32]


def words(values: object) -> Words:
    """Whole numbers modulo 2^32, as GLSL turns int into uint."""
    return (np.asarray(values).astype(np.int64) & 0xFFFFFFFF).astype(np.uint32)


def _product(left: Words, right: Words | int) -> tuple[Words, Words]:
    """Upper and lower words of products, as `umulExtended` gives them."""
    whole = left.astype(np.uint64) * np.asarray(right, np.uint64)
    return (whole >> np.uint64(32)).astype(np.uint32), words(whole & np.uint64(0xFFFFFFFF))


def pixel_noise(x: Words, y: Words) -> Words:
    """Interleaved gradient noise of pixels."""
    high, low = _product(words(x * np.uint32(288237660) + y * np.uint32(25070368)), 3555623499)
    return (high << np.uint32(6)) | (low >> np.uint32(26))


def filter_threshold(x: Words, y: Words, number: Words) -> Words:
    """Threshold of sample `number` of the stochastic filter."""
    return pixel_noise(x, y) + number * np.uint32(2654435769)


def second_taken(threshold: Words, limit: Words, share: Words) -> tuple[NDArray[np.bool_], Words, Words]:
    """Return whether the second of two choices is taken, and the rest of threshold and range (`limit`, where 0 is 2^32)."""
    second = np.where(limit == 0, share, _product(limit, share)[0])
    taken = threshold < second
    return taken, np.where(taken, threshold, threshold - second), np.where(taken, second, limit - second)


def scrambled(value: Words) -> Words:
    """`hash`: PCG RXS-M-XS."""
    state = value * np.uint32(747796405) + np.uint32(2891336453)
    word = ((state >> ((state >> np.uint32(28)) + np.uint32(4))) ^ state) * np.uint32(277803737)
    return (word >> np.uint32(22)) ^ word


def permuted(number: Words, seed: Words) -> Words:
    """`number`, 0 to 15, by the permutation of a seed."""
    low = np.uint32(15)
    number = (number ^ seed) * np.uint32(0xE170893D)
    number = (number ^ (seed >> np.uint32(16)) ^ (seed >> np.uint32(8))) * np.uint32(0x0929EB3F)
    number = number ^ (seed >> np.uint32(23))
    number = (number ^ ((number & low) >> np.uint32(1))) * (np.uint32(1) | (seed >> np.uint32(27)))
    number = number * np.uint32(0x6935FA69) * np.uint32(0x74DCB303)
    number = (number ^ ((number & low) >> np.uint32(2))) * np.uint32(0x9E501CC3)
    number = (number ^ ((number & low) >> np.uint32(2))) * np.uint32(0xC860A3DF)
    return (number + seed) & low


def blend_threshold(x: Words, y: Words, layer: Words, number: Words) -> Words:
    """Threshold of sample `number`, 0 to 15, of BLEND surfaces."""
    seed = scrambled(layer + scrambled(x + scrambled(y)))
    moved = permuted(number, seed)
    moved = np.where(moved == 0, permuted(np.zeros_like(seed), seed), moved)
    return pixel_noise(x, y) + np.where(number == 0, np.uint32(0), moved << np.uint32(28))


def is_covered(alpha: NDArray[np.float32], threshold: Words) -> NDArray[np.bool_]:
    """Return whether a surface covers a pixel."""
    return alpha >= ((threshold >> np.uint32(9)) * np.uint32(2) + np.uint32(1)).astype(np.float64) / (1 << 24)
