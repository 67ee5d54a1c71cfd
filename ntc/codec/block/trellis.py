"""Trellis-coded quantisation: indices of a block's coefficients as a path through eight states.

A coefficient of depth b has 2^(b+1) levels, dealt out in turn to four subsets. The state that the coefficients before it led to allows
two subsets; one bit of its index chooses between them, the others choose a level. So b bits choose among twice as many levels as
scalar quantisation has, which gains 0.7 to 1.9 dB at no cost to the decoder (Marcellin and Fischer, IEEE Trans. Comm. 38(1), 1990;
the trellis is that of JPEG 2000 part 2, ITU-T T.801, Annex D).
"""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

LARGEST_DEPTH = 7
"""Most bits of a coefficient."""
SCALE_STEPS_PER_OCTAVE = 16
"""Stored scales are powers of two in steps of 1/16 octave."""
SCALE_ORIGIN = 192
"""A stored scale of 192 is 1."""
STATES = 8
BRANCHES: tuple[tuple[tuple[int, int], tuple[int, int]], ...] = (
    ((0, 0), (1, 2)),
    ((2, 1), (3, 3)),
    ((4, 2), (5, 0)),
    ((6, 3), (7, 1)),
    ((0, 2), (1, 0)),
    ((2, 3), (3, 1)),
    ((4, 0), (5, 2)),
    ((6, 1), (7, 3)),
)
"""(next state, subset) by state and branch bit."""
EXPECTED_ERROR = (1.0, 0.347, 0.105, 0.031, 0.0101, 0.00275, 0.00074, 0.0002)
"""Mean squared error of a coefficient of unit variance by depth, measured on Gaussian and Laplacian samples."""
LEVEL_STEPS = (0, -3, 2, 11, 17, 20, 23, 24)
"""Scale of the outermost level by depth, in steps of 1/16 octave, for coefficients of unit variance."""
SHALLOW_CURVE, DEEP_CURVE = (0.0, 1.625), (-1.5, 3.0)
"""(linear, square) terms of levels of depths below DEEP_DEPTH, and of the others."""
DEEP_DEPTH = 3


def branch_tables() -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """(next state, subset), each [STATES, 2] int64 by state and branch bit."""
    table = np.array(BRANCHES, np.int64)
    return table[..., 0], table[..., 1]


@lru_cache(maxsize=1)
def _allocation_keys() -> NDArray[np.int64]:
    """[LARGEST_DEPTH] int64, falling: 16 log2 of what the variance is multiplied by for the error that each further bit takes away."""
    gains = -np.diff(np.asarray(EXPECTED_ERROR))
    keys: NDArray[np.int64] = np.rint(SCALE_STEPS_PER_OCTAVE * np.log2(gains)).astype(np.int64)
    return keys


def share_out_bits(scales: NDArray[np.uint8], bits: NDArray[np.integer]) -> NDArray[np.uint8]:
    """Return [sizes, modes, coefficients] uint8 depths that sum to `bits` [sizes, modes]: each bit goes where it lowers the expected
    squared error most.

    `scales` [modes, coefficients] are stored scales (`scale_values`). In integers, so that every reader comes to the same depths.
    Fewer bits where every coefficient has LARGEST_DEPTH already.
    """
    modes, coefficients = scales.shape
    # A variance is the square of a scale, so its logarithm is twice as large.
    keys = 2 * scales.astype(np.int64)[..., None] + _allocation_keys()
    # Gains of a coefficient fall with its depth, so the greatest ones of all coefficients are a valid allocation.
    # Numbers of 16 bits are sorted by their digits, which is fastest.
    order = np.argsort(-keys.astype(np.int16).reshape(modes, -1), axis=1, kind="stable")
    rank = np.empty_like(order)
    np.put_along_axis(rank, order, np.arange(order.shape[1])[None], axis=1)
    taken = rank.reshape(modes, coefficients, LARGEST_DEPTH) < bits[..., None, None]
    depths: NDArray[np.uint8] = taken.sum(axis=-1, dtype=np.uint8)
    return depths


def scale_values(stored: NDArray[np.integer]) -> NDArray[np.float64]:
    """Scales as numbers: 2^((stored - SCALE_ORIGIN) / SCALE_STEPS_PER_OCTAVE), float64 of the shape of `stored`."""
    return np.exp2((stored.astype(np.float64) - SCALE_ORIGIN) / SCALE_STEPS_PER_OCTAVE)


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
