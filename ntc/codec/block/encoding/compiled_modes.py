"""The choice of modes by expected errors, compiled by numba."""

import numpy as np
from numba import float32, int64, uint8
from numpy.typing import NDArray

from ntc.codec.compiling import Signatures, compiled_loop


@compiled_loop()
def _two_least(errors: NDArray[np.float32]) -> tuple[int, int]:
    """Return places of the least and the second least of `errors`; the same place twice where there is only one."""
    first, second = 0, min(1, len(errors) - 1)
    if errors[second] < errors[first]:
        first, second = second, first
    for place in range(2, len(errors)):
        if errors[place] < errors[second]:
            second = place
            if errors[place] < errors[first]:
                first, second = place, first
    return first, second


@compiled_loop()
def two_least(expected: NDArray[np.float32], errors: NDArray[np.float32], modes: NDArray[np.uint8]) -> None:
    """Write the least of `expected` [blocks, sizes, modes] into `errors` [blocks, sizes], and the two modes of the least ones into
    `modes` [blocks, sizes, 2]."""
    for block in range(expected.shape[0]):
        for size in range(expected.shape[1]):
            first, second = _two_least(expected[block, size])
            errors[block, size] = expected[block, size, first]
            modes[block, size, 0], modes[block, size, 1] = first, second


@compiled_loop()
def _looked_up(
    values: NDArray[np.float32],
    depths: NDArray[np.int64],
    scales: NDArray[np.float32],
    table: NDArray[np.float32],
    reach: np.float32,
    cells: int,
) -> float:
    """Return the sum over coefficients of `table` [depths x cells], squared errors in units of scales."""
    total, share = np.float32(0.0), np.float32(cells) / (np.float32(2.0) * reach)
    for k in range(len(values)):
        unit = values[k] / scales[k]
        cell = int((min(max(unit, -reach), reach) + reach) * share)
        error = table[depths[k] * cells + min(cell, cells - 1)]
        beyond = max(abs(unit) - reach, np.float32(0.0))
        total += (error + beyond * beyond) * scales[k] * scales[k]
    return float(total)


@compiled_loop()
def better_of_two(
    values: NDArray[np.float32],
    expected: NDArray[np.float32],
    depths: NDArray[np.int64],
    scales: NDArray[np.float32],
    table: NDArray[np.float32],
    reach: np.float32,
    cells: int,
    chosen: NDArray[np.int64],
) -> None:
    """Write into `chosen` [blocks] which of the two modes of the least `expected` [blocks, modes] has the smaller error of `values`
    [blocks, coefficients] by `table`; `depths` and `scales` [modes, coefficients]."""
    for block in range(len(values)):
        first, second = _two_least(expected[block])
        one = _looked_up(values[block], depths[first], scales[first], table, reach, cells)
        other = _looked_up(values[block], depths[second], scales[second], table, reach, cells)
        chosen[block] = second if other < one else first


SIGNATURES: Signatures = {
    two_least: (float32[:, :, ::1], float32[:, ::1], uint8[:, :, ::1]),
    better_of_two: (
        float32[:, ::1],
        float32[:, ::1],
        int64[:, ::1],
        float32[:, ::1],
        float32[::1],
        float32,
        int64,
        int64[::1],
    ),
}
