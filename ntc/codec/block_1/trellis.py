"""The levels of trellis-coded quantisation (`ntc.codec.block_trellis`) in format 1."""

import numpy as np
from numpy.typing import NDArray

from ntc.codec.block_trellis import LARGEST_DEPTH

_SMALL_LEVELS = (
    (0.2395, 1.2573),
    (0.1679, 0.5701, 1.1624, 2.2025),
    (0.0968, 0.2885, 0.5435, 0.8062, 1.1505, 1.5969, 2.2655, 3.5476),
)
"""Positive levels of depths 1 to 3 for a unit variance: Lloyd's iteration over trellis-coded Gaussian and Laplacian samples."""
_LARGEST_LEVEL = {4: 5.2, 5: 6.4, 6: 7.0, 7: 8.0}
_GROWTH = 2.8
"""Levels of greater depths lie at largest * (e^(2.8 u) - 1) / (e^2.8 - 1), u evenly spread over 0 to 1."""


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
