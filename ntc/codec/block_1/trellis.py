"""Trellis-coded quantisation: indices of a block's coefficients as a path through eight states.

A coefficient of depth b has 2^(b+1) levels, dealt out in turn to four subsets. The state that the coefficients before it led to allows
two subsets; one bit of its index chooses between them, the others choose a level. So b bits choose among twice as many levels as
scalar quantisation has, which is worth 0.7 to 1.9 dB at no cost to the decoder (Marcellin and Fischer, IEEE Trans. Comm. 38(1), 1990;
the trellis is that of JPEG 2000 part 2, ITU-T T.801, Annex D).
"""

import numpy as np
from numpy.typing import NDArray

from ntc.codec.block_1.config import LARGEST_DEPTH, SCALE_STEPS_PER_OCTAVE

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
"""By state and branch bit: (next state, subset)."""
_SMALL_LEVELS = (
    (0.2395, 1.2573),
    (0.1679, 0.5701, 1.1624, 2.2025),
    (0.0968, 0.2885, 0.5435, 0.8062, 1.1505, 1.5969, 2.2655, 3.5476),
)
"""Positive levels of depths 1 to 3 for a unit variance: Lloyd's iteration over trellis-coded Gaussian and Laplacian samples."""
_LARGEST_LEVEL = {4: 5.2, 5: 6.4, 6: 7.0, 7: 8.0}
_GROWTH = 2.8
"""Levels of greater depths lie at largest * (e^(2.8 u) - 1) / (e^2.8 - 1), u evenly spread over 0 to 1."""
EXPECTED_ERROR = (1.0, 0.347, 0.105, 0.031, 0.0101, 0.00275, 0.00074, 0.0002)
"""Mean squared error of a coefficient of unit variance by depth, measured on the same samples."""


def _positive_levels(depth: int) -> NDArray[np.float64]:
    if depth <= len(_SMALL_LEVELS):
        return np.array(_SMALL_LEVELS[depth - 1])
    share = (np.arange(1 << depth) + 0.5) / (1 << depth)
    levels: NDArray[np.float64] = _LARGEST_LEVEL[depth] * np.expm1(_GROWTH * share) / np.expm1(_GROWTH)
    return levels


def level_table() -> NDArray[np.float32]:
    """[LARGEST_DEPTH + 1, 2^(LARGEST_DEPTH + 1)] float32: levels by depth, rising; zeros past the last one of a depth.

    Level number 4 i + s is number i of subset s.
    """
    table = np.zeros((LARGEST_DEPTH + 1, 2 << LARGEST_DEPTH), np.float32)
    for depth in range(1, LARGEST_DEPTH + 1):
        positive = _positive_levels(depth)
        table[depth, : 2 * len(positive)] = np.concatenate([-positive[::-1], positive])
    return table


def branch_tables() -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """(next state, subset), each [STATES, 2] int64 by state and branch bit."""
    table = np.array(BRANCHES, np.int64)
    return table[..., 0], table[..., 1]


def _allocation_keys() -> NDArray[np.int64]:
    """[LARGEST_DEPTH] int64, falling: 16 log2 of what the variance is multiplied by for the error that each further bit takes away."""
    gains = -np.diff(np.asarray(EXPECTED_ERROR))
    keys: NDArray[np.int64] = np.rint(SCALE_STEPS_PER_OCTAVE * np.log2(gains)).astype(np.int64)
    return keys


def share_out_bits(scales: NDArray[np.uint8], bits: int) -> NDArray[np.uint8]:
    """[coefficients] uint8 depths that sum to `bits`: each bit goes where it lowers the expected squared error most.

    `scales` are stored scales (`ntc.codec.block_1.model.scale_values`). In integers, so that every reader comes to the same depths.
    Fewer bits where every coefficient has LARGEST_DEPTH already.
    """
    # A variance is the square of a scale, so its logarithm is twice as large.
    keys = 2 * scales.astype(np.int64)[:, None] + _allocation_keys()
    # Gains of a coefficient fall with its depth, so the greatest ones of all coefficients are a valid allocation.
    order = np.argsort(-keys, axis=None, kind="stable")[: min(bits, keys.size)]
    return np.bincount(order // LARGEST_DEPTH, minlength=len(scales)).astype(np.uint8)
