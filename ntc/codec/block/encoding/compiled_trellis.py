"""The search for a block's best path through the trellis, and the writing of its code, compiled by numba.

Dynamic programming (Viterbi's algorithm): for each of the eight states, the least squared error of any path that leads there is known;
each coefficient extends all paths by its two branches and keeps the better one into each state. The level nearest to a value in each
subset is read from a table over cells of the range. At the last coefficient the best state is followed back, and branch and level
bits are written. What is minimised is the squared error of normalised values: rows of the basis are orthogonal but for rounding.
Source: Marcellin and Fischer, IEEE Trans. Comm. 38(1), 1990; the trellis is in `ntc.codec.block.trellis`.
"""

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numba import float32, float64, int64, uint8, uint32
from numpy.typing import NDArray

from ntc.codec.block.codes import first_branches, joined_words
from ntc.codec.block.config import BlockConfig
from ntc.codec.block.encoding.quantizer import LOOKUP_CELLS, LOOKUP_RANGE, cell_centres
from ntc.codec.block.model import BlockDecoder
from ntc.codec.block.trellis import BRANCHES, LARGEST_DEPTH, STATES, level_table, scale_values
from ntc.codec.compiling import Signatures, compiled_loop

_SUBSETS = np.array([subset for branches in BRANCHES for _, subset in branches], np.int64)
"""Subset of the levels by state and branch."""
_LOWER = STATES // 2


class SearchTables(NamedTuple):
    """Tables that the search reads for one size of codes: by mode, the coefficients that have bits."""

    counts: NDArray[np.int64]
    """[modes]."""
    rows: NDArray[np.int64]
    """[modes, most] coefficients that have bits."""
    depths: NDArray[np.int64]
    """[modes, most]."""
    scales: NDArray[np.float32]
    """[modes, most]."""
    first: NDArray[np.int64]
    """[modes] first branch bit."""
    nearest: NDArray[np.uint8]
    """[depths, cells, subsets] number of the level nearest to a value."""
    levels: NDArray[np.float32]
    """[depths, numbers]."""


@lru_cache(maxsize=64)
def search_tables(decoder: BlockDecoder, config: BlockConfig, size: int) -> SearchTables:
    """Return the tables for codes of size class `size`."""
    depths = decoder.depths(config)[size].astype(np.int64)
    scales = scale_values(decoder.scales).astype(np.float32)
    counts = (depths > 0).sum(1)
    # In one piece, as for all decoders: for arrays that lie otherwise numba compiles the loops once more.
    rows = np.ascontiguousarray(np.argsort(depths == 0, axis=1, kind="stable")[:, : max(1, counts.max())])
    modes = np.arange(len(depths))[:, None]
    levels = level_table()
    return SearchTables(
        counts,
        rows,
        depths[modes, rows],
        scales[modes, rows],
        first_branches(decoder, config)[size],
        nearest_levels(levels),
        levels.astype(np.float32),
    )


def nearest_levels(levels: NDArray[np.float64]) -> NDArray[np.uint8]:
    """[depths, cells, subsets] uint8: number of the level of a subset that is nearest to a value, which lies in a cell of the
    range."""
    centres = cell_centres()
    nearest = np.zeros((LARGEST_DEPTH + 1, LOOKUP_CELLS, 4), np.uint8)
    for depth in range(1, LARGEST_DEPTH + 1):
        for subset in range(4):
            subset_levels = levels[depth, subset : 2 << depth : 4]
            nearest[depth, :, subset] = (
                np.searchsorted((subset_levels[1:] + subset_levels[:-1]) / 2.0, centres) * 4 + subset
            )
    return nearest


@compiled_loop()
def _start_state(word: NDArray[np.uint32], before: int) -> int:
    state = 0
    for bit in range(before - 3, before):
        state = 2 * state + ((word[bit >> 5] >> np.uint32(bit & 31)) & 1)
    return state


@compiled_loop()
def _weigh_levels(
    value: float,
    depth: int,
    scale: float,
    nearest: NDArray[np.uint8],
    levels: NDArray[np.float32],
    numbers: NDArray[np.uint8],
    error: NDArray[np.float32],
) -> None:
    """Write the level nearest to `value` in each subset into `numbers`, and its squared error into `error`."""
    unit = value / scale
    cell = int((unit + np.float32(LOOKUP_RANGE)) * np.float32(LOOKUP_CELLS / (2.0 * LOOKUP_RANGE)))
    cell = min(max(cell, 0), LOOKUP_CELLS - 1)
    for subset in range(4):
        number = nearest[depth, cell, subset]
        numbers[subset] = number
        difference = (levels[depth, number] - unit) * scale
        error[subset] = difference * difference


@compiled_loop()
def _step(
    cost: NDArray[np.float32], following: NDArray[np.float32], error: NDArray[np.float32], came: NDArray[np.uint8]
) -> None:
    """Go through the trellis by one coefficient: `cost` by state, and in `came` from which half of the states it was reached."""
    for state in range(STATES):
        one, other = state >> 1, (state >> 1) + _LOWER
        first = cost[one] + error[_SUBSETS[2 * one + (state & 1)]]
        second = cost[other] + error[_SUBSETS[2 * other + (state & 1)]]
        came[state] = second < first
        following[state] = min(first, second)
    for state in range(STATES):
        cost[state] = following[state]


@compiled_loop()
def _write(word: NDArray[np.uint32], place: int, value: int, width: int) -> None:
    """Set `width` bits, which are 0, to `value`."""
    shifted = np.uint64(value) << np.uint64(place & 31)
    word[place >> 5] |= np.uint32(shifted & np.uint64(0xFFFFFFFF))
    if (place & 31) + width > 32:
        word[(place >> 5) + 1] |= np.uint32(shifted >> np.uint64(32))


@compiled_loop()
def _without_bits(value: NDArray[np.float32], rows: NDArray[np.int64]) -> float:
    """Return the sum of squares of the coefficients that have no bits: they decode to 0."""
    total = np.float32(0.0)
    for k in range(len(value)):
        total += value[k] * value[k]
    for row in rows:
        total -= value[row] * value[row]
    return float(max(total, np.float32(0.0)))


@compiled_loop()
def write_codes(
    values: NDArray[np.float32],
    modes: NDArray[np.int64],
    words: NDArray[np.uint32],
    errors: NDArray[np.float32],
    counts: NDArray[np.int64],
    rows: NDArray[np.int64],
    depths: NDArray[np.int64],
    scales: NDArray[np.float32],
    first: NDArray[np.int64],
    nearest: NDArray[np.uint8],
    levels: NDArray[np.float32],
) -> None:
    """Writes branch and index bits of coefficients `values` [blocks, coefficients] into codes `words` [blocks, words], which hold
    modes and edge parts already, and squared errors into `errors` [blocks]. The other arguments are a `SearchTables`."""
    came = np.empty((rows.shape[1], STATES), np.uint8)
    numbers = np.empty((rows.shape[1], 4), np.uint8)
    cost, following = np.empty(STATES, np.float32), np.empty(STATES, np.float32)
    error = np.empty(4, np.float32)
    for block in range(len(values)):
        mode = modes[block]
        count, before = counts[mode], first[mode]
        cost[:] = np.inf
        cost[_start_state(words[block], before)] = 0.0
        rest = before + count
        for k in range(count):
            value, depth = values[block, rows[mode, k]], depths[mode, k]
            _weigh_levels(value, depth, scales[mode, k], nearest, levels, numbers[k], error)
            _step(cost, following, error, came[k])
            rest += depth - 1
        state = int(cost.argmin())
        errors[block] = cost[state] + _without_bits(values[block], rows[mode, :count])
        for k in range(count - 1, -1, -1):
            branch = int(state & 1)
            state = (state >> 1) + _LOWER * came[k, state]
            number, width = numbers[k, _SUBSETS[2 * state + branch]], depths[mode, k] - 1
            _write(words[block], before + k, branch, 1)
            rest -= width
            if width:
                _write(words[block], rest, number >> 2, width)


def coded(
    values: NDArray[np.float32],
    modes: NDArray[np.int64],
    size: int,
    bits: NDArray[np.uint8],
    decoder: BlockDecoder,
    config: BlockConfig,
) -> tuple[NDArray[np.uint32], NDArray[np.float32]]:
    """(codes [blocks, words of the largest code] uint32, squared errors [blocks]) of size class `size` for coefficients `values`
    [blocks, coefficients].

    `bits` [blocks, bits of the largest code] hold modes and edge parts (`bits_before_branches`).
    """
    words, errors = joined_words(bits), np.empty(len(values), np.float32)
    write_codes(np.ascontiguousarray(values), modes, words, errors, *search_tables(decoder, config, size))
    return words, errors


@compiled_loop()
def _read(word: NDArray[np.uint32], place: int, width: int) -> int:
    """Return the number of `width` bits at `place`."""
    bits = np.uint64(word[place >> 5]) >> np.uint64(place & 31)
    if (place & 31) + width > 32:
        bits |= np.uint64(word[(place >> 5) + 1]) << np.uint64(32 - (place & 31))
    return int(bits & ((np.uint64(1) << np.uint64(width)) - np.uint64(1)))


@compiled_loop()
def read_codes(
    words: NDArray[np.uint32],
    modes: NDArray[np.int64],
    values: NDArray[np.float64],
    counts: NDArray[np.int64],
    rows: NDArray[np.int64],
    depths: NDArray[np.int64],
    scales: NDArray[np.float64],
    first: NDArray[np.int64],
    levels: NDArray[np.float64],
) -> None:
    """Write the coefficients of codes `words` [blocks, words] of `modes` [blocks] into `values` [blocks, coefficients], which are 0.
    The other arguments are those of a `SearchTables`."""
    for block in range(len(words)):
        mode = modes[block]
        count, before = counts[mode], first[mode]
        state, rest = _start_state(words[block], before), before + count
        for k in range(count):
            depth = depths[mode, k]
            branch = _read(words[block], before + k, 1)
            number = _SUBSETS[2 * state + branch]
            if depth > 1:
                number += 4 * _read(words[block], rest, depth - 1)
            values[block, rows[mode, k]] = levels[depth, number] * scales[mode, k]
            state = (2 * state + branch) & (STATES - 1)
            rest += depth - 1


SIGNATURES: Signatures = {
    write_codes: (
        float32[:, ::1],
        int64[::1],
        uint32[:, ::1],
        float32[::1],
        int64[::1],
        int64[:, ::1],
        int64[:, ::1],
        float32[:, ::1],
        int64[::1],
        uint8[:, :, ::1],
        float32[:, ::1],
    ),
    read_codes: (
        uint32[:, ::1],
        int64[::1],
        float64[:, ::1],
        int64[::1],
        int64[:, ::1],
        int64[:, ::1],
        float64[:, ::1],
        int64[::1],
        float64[:, ::1],
    ),
}
