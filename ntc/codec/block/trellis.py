"""The levels of trellis-coded quantisation (`ntc.codec.block_trellis`), and the bits that name them."""

import numpy as np
from numpy.typing import NDArray

from ntc.codec.block_trellis import LARGEST_DEPTH, SCALE_STEPS_PER_OCTAVE, branch_tables

LEVEL_STEPS = (0, -3, 2, 11, 17, 20, 23, 24)
"""By depth: the outermost level's scale in steps of 1/16 octave, for coefficients of unit variance."""
SHALLOW_CURVE, DEEP_CURVE = (0.0, 1.625), (-1.5, 3.0)
"""(linear, square) terms of levels of depths below DEEP_DEPTH, and of the others."""
DEEP_DEPTH = 3


def level_shape(depth: int) -> NDArray[np.float64]:
    """[2^(depth + 1)] float64: levels of `depth` without their scale, s (1 + a |s| + b s^2) at even steps of s."""
    count = 2 << depth
    place = (2.0 * np.arange(count) + 1.0) / count - 1.0
    linear, square = DEEP_CURVE if depth >= DEEP_DEPTH else SHALLOW_CURVE
    magnitude = np.abs(place)
    shape: NDArray[np.float64] = place * (1.0 + magnitude * (linear + magnitude * square))
    return shape


def level_table() -> NDArray[np.float64]:
    """[LARGEST_DEPTH + 1, 2^(LARGEST_DEPTH + 1)] float64: levels by depth for a unit variance, rising; zeros past the last one of a
    depth.

    Level number 4 i + s is number i of subset s.
    """
    table = np.zeros((LARGEST_DEPTH + 1, 2 << LARGEST_DEPTH))
    for depth in range(1, LARGEST_DEPTH + 1):
        table[depth, : 2 << depth] = level_shape(depth) * 2.0 ** (LEVEL_STEPS[depth] / SCALE_STEPS_PER_OCTAVE)
    return table


def indices_of(
    numbers: NDArray[np.integer], depths: NDArray[np.integer], starts: NDArray[np.integer]
) -> NDArray[np.uint32]:
    """[blocks, coefficients] uint32: the bits that are stored: the branch in the lowest bit, the place in the subset above it.

    `numbers` are level numbers along a path that starts in the states `starts` [blocks]. Raises ValueError where they are none.
    """
    stored = np.zeros(numbers.shape, np.uint32)
    state = starts.astype(np.int64)
    following, subsets = branch_tables()
    for k in range(numbers.shape[1]):
        subset, active = numbers[:, k] & 3, depths[:, k] > 0
        if not active.any():
            continue
        branch = (subsets[state, 1] == subset).astype(np.int64)
        if (active & (subsets[state, branch] != subset)).any():
            raise ValueError("level numbers that no path through the trellis has")
        stored[:, k] = np.where(active, (numbers[:, k] >> 2) * 2 + branch, 0)
        state = np.where(active, following[state, branch], state)
    return stored
