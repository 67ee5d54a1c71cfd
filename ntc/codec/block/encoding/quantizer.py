"""Errors that modes are expected to have, without the search for each block's best path (`ntc.codec.block.trellis`).

A block may take any of up to 128 modes in four sizes. To search the trellis for each of them would take too long, so modes are first
compared by estimates. A polynomial of a coefficient's square gives about its squared error at each depth: one product of matrices
then estimates all modes for all blocks. Where tables are fitted, a finer table decides between the two best.
"""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from ntc.codec.block.encoding import compiled_modes
from ntc.codec.block.trellis import LARGEST_DEPTH, level_table

Array = NDArray[np.float32]
LOOKUP_RANGE = 8.5
"""Coefficients beyond this many times their scale take the outermost levels."""
LOOKUP_CELLS = 2048
"""Cells over the range: finer than the closest levels."""
LEAST_SHARE = 0.5
"""Share of the error of coefficients at 0 that is the least expected error of any block."""


def cell_centres() -> NDArray[np.float64]:
    """[LOOKUP_CELLS] float64: value in the middle of each cell of the range, in units of its scale."""
    centres = (np.arange(LOOKUP_CELLS) + 0.5) * (2.0 * LOOKUP_RANGE / LOOKUP_CELLS) - LOOKUP_RANGE
    return np.asarray(centres, np.float64)


@lru_cache(maxsize=1)
def error_table() -> Array:
    """[(LARGEST_DEPTH + 1) * LOOKUP_CELLS] float32: squared error of a value in units of its scale, mean over the two pairs of subsets
    that states allow; at depth 0 the square of the value."""
    levels, centres = level_table(), cell_centres()
    table = np.zeros((LARGEST_DEPTH + 1, LOOKUP_CELLS), np.float32)
    table[0] = np.square(centres)
    for depth in range(1, LARGEST_DEPTH + 1):
        for first in (0, 1):
            allowed = np.sort(np.concatenate([levels[depth, s : 2 << depth : 4] for s in (first, first + 2)]))
            error = centres - allowed[np.searchsorted((allowed[1:] + allowed[:-1]) / 2.0, centres)]
            table[depth] += 0.5 * np.square(error)
    return table.reshape(-1)


@lru_cache(maxsize=1)
def _polynomials() -> Array:
    """[LARGEST_DEPTH + 1, 3] float32: `error_table` by depth as a + b u^2 + c u^4 of a value u in units of its scale, nearest where
    values of pictures are."""
    centres = cell_centres()
    terms = np.stack([np.ones_like(centres), centres**2, centres**4], axis=1)
    weights = np.sqrt(np.exp(-np.sqrt(2.0) * np.abs(centres)) + 1e-5)
    table = error_table().reshape(LARGEST_DEPTH + 1, LOOKUP_CELLS).astype(np.float64)
    fits = [np.linalg.lstsq(terms * weights[:, None], errors * weights, rcond=None)[0] for errors in table]
    return np.stack(fits).astype(np.float32)


def expected_errors(values: Array, depths: NDArray[np.integer], scales: Array) -> Array:
    """Return [blocks, sizes, modes]: about the squared error of each block by size of its code and mode, at least 0.

    `values` [blocks, coefficients] are coded under `depths` [sizes, modes, coefficients] and `scales` float32 [modes, coefficients].
    """
    terms = _polynomials()[depths].reshape(-1, depths.shape[2], 3)
    constant, square, fourth = (terms[..., term] for term in range(3))
    variances = np.tile(np.square(scales), (len(depths), 1))
    squares = np.square(values)
    powers = np.concatenate([squares, np.square(squares)], axis=1)
    rough = powers @ np.concatenate([square, fourth / variances], axis=1).T
    rough += (constant * variances).sum(1)
    # Polynomials may fall below what the closest levels leave, and even below 0.
    np.maximum(rough, LEAST_SHARE * (np.maximum(constant, 0.0) * variances).sum(1), out=rough)
    return np.asarray(rough.reshape(len(values), *depths.shape[:2]))


def best_modes(values: Array, expected: Array, depths: NDArray[np.integer], scales: Array) -> NDArray[np.int64]:
    """[blocks] int64: the mode in which each block has about the least squared error.

    `expected` [blocks, modes] errors name two modes, or the only one, and the table of errors chooses among them; `depths` [modes,
    coefficients], `scales` [modes, coefficients] float32.
    """
    chosen = np.empty(len(values), np.int64)
    table = (error_table(), np.float32(LOOKUP_RANGE), LOOKUP_CELLS)
    compiled_modes.better_of_two(
        values, np.ascontiguousarray(expected), depths.astype(np.int64), scales, *table, chosen
    )
    return chosen
