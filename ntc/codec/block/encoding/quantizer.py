"""The search for a block's best path through the trellis (`ntc.codec.block.trellis`), many blocks side by side, in torch."""

from functools import lru_cache
from typing import Any

import numpy as np
import torch

from ntc.codec.block.trellis import BRANCHES, LARGEST_DEPTH, STATES, level_table

compiled: Any
try:
    from ntc.codec.block.encoding import compiled_modes as compiled
except ImportError:
    compiled = None

LOOKUP_RANGE = 8.5
"""Coefficients beyond this many times their scale take the outermost levels."""
LOOKUP_CELLS = 2048
"""Cells over the range: finer than the closest levels."""

SHORTLIST = 2
"""Modes at most that are compared by the table of errors: with more of them, pictures were not nearer."""
LEAST_SHARE = 0.5
"""Of the error expected of coefficients near 0: no block is expected to have less."""


def lookup_cells(values: torch.Tensor) -> torch.Tensor:
    """Cell of each value in units of its scale, int64."""
    cell = (values + LOOKUP_RANGE) * (LOOKUP_CELLS / (2.0 * LOOKUP_RANGE))
    return cell.clamp_(0.0, LOOKUP_CELLS - 1.0).to(torch.int64)


@lru_cache(maxsize=1)
def error_table() -> torch.Tensor:
    """[(LARGEST_DEPTH + 1) * LOOKUP_CELLS] float32: squared error of a value in units of its scale, mean over the two pairs of subsets
    that states allow; at depth 0 the square of the value."""
    levels = level_table()
    centres = (np.arange(LOOKUP_CELLS) + 0.5) * (2.0 * LOOKUP_RANGE / LOOKUP_CELLS) - LOOKUP_RANGE
    table = np.zeros((LARGEST_DEPTH + 1, LOOKUP_CELLS), np.float32)
    table[0] = np.square(centres)
    for depth in range(1, LARGEST_DEPTH + 1):
        for first in (0, 1):
            own = np.sort(np.concatenate([levels[depth, s : 2 << depth : 4] for s in (first, first + 2)]))
            error = centres - own[np.searchsorted((own[1:] + own[:-1]) / 2.0, centres)]
            table[depth] += 0.5 * np.square(error)
    return torch.from_numpy(table.reshape(-1))


@lru_cache(maxsize=1)
def _polynomials() -> torch.Tensor:
    """[LARGEST_DEPTH + 1, 3] float32: `error_table` by depth as a + b u^2 + c u^4 of a value u in units of its scale, nearest where
    values of pictures are."""
    centres = (np.arange(LOOKUP_CELLS) + 0.5) * (2.0 * LOOKUP_RANGE / LOOKUP_CELLS) - LOOKUP_RANGE
    terms = np.stack([np.ones_like(centres), centres**2, centres**4], axis=1)
    weights = np.sqrt(np.exp(-np.sqrt(2.0) * np.abs(centres)) + 1e-5)
    table = error_table().numpy().reshape(LARGEST_DEPTH + 1, LOOKUP_CELLS).astype(np.float64)
    found = [np.linalg.lstsq(terms * weights[:, None], errors * weights, rcond=None)[0] for errors in table]
    return torch.from_numpy(np.stack(found).astype(np.float32))


def expected_errors(values: torch.Tensor, depths: torch.Tensor, scales: torch.Tensor) -> torch.Tensor:
    """[blocks, sizes, modes] about the squared error of each block by size of its code and mode, without searching the trellis.

    Of `values` [blocks, coefficients] under `depths` int64 [sizes, modes, coefficients] and `scales` float32 [modes, coefficients].
    """
    constant, square, fourth = _polynomials()[depths].flatten(0, 1).unbind(-1)
    variances = scales.square().repeat(len(depths), 1)
    squares = values.square()
    powers, factors = torch.cat([squares, squares.square()], dim=1), torch.cat([square, fourth / variances], dim=1)
    rough = torch.addmm((constant * variances).sum(1), powers, factors.T)
    # Polynomials may fall below what the closest levels leave, and even below 0.
    least = LEAST_SHARE * (constant.clamp(min=0.0) * variances).sum(1)
    torch.maximum(rough, least, out=rough)
    return rough.view(len(values), *depths.shape[:2])


def best_modes(
    values: torch.Tensor, expected: torch.Tensor, depths: torch.Tensor, scales: torch.Tensor
) -> torch.Tensor:
    """[blocks] int64: the mode in which each block has about the least squared error.

    `expected` [blocks, modes] errors name two modes, or the only one, and the table of errors chooses among them; `depths` [modes,
    coefficients] int64, `scales` [modes, coefficients] float32.
    """
    if compiled is not None:
        found = np.empty(len(values), np.int64)
        table = (error_table().numpy(), np.float32(LOOKUP_RANGE), LOOKUP_CELLS)
        compiled.better_of_two(values.numpy(), expected.numpy(), depths.numpy(), scales.numpy(), *table, found)
        return torch.from_numpy(found)
    shortlist = expected.topk(min(SHORTLIST, expected.shape[1]), dim=1, largest=False).indices
    errors = [_looked_up(values, depths[modes], scales[modes]) for modes in shortlist.unbind(1)]
    return shortlist.gather(1, torch.stack(errors, dim=1).argmin(1, keepdim=True))[:, 0]


def _looked_up(values: torch.Tensor, depths: torch.Tensor, scales: torch.Tensor) -> torch.Tensor:
    """[blocks] squared errors by `error_table`."""
    unit = values / scales
    errors = error_table()[depths * LOOKUP_CELLS + lookup_cells(unit)]
    errors += (unit.abs() - LOOKUP_RANGE).clamp_(min=0.0).square_()
    return (errors * scales.square()).sum(1)


class TrellisQuantizer:
    """Finds the indices with the least squared error, for many blocks side by side. Float32, on the CPU."""

    def __init__(self) -> None:
        levels = level_table().astype(np.float32)
        centres = (np.arange(LOOKUP_CELLS) + 0.5) * (2.0 * LOOKUP_RANGE / LOOKUP_CELLS) - LOOKUP_RANGE
        nearest = np.zeros((4, LARGEST_DEPTH + 1, LOOKUP_CELLS), np.int64)
        for depth in range(1, LARGEST_DEPTH + 1):
            for subset in range(4):
                own = levels[depth, subset : 2 << depth : 4]
                nearest[subset, depth] = np.searchsorted((own[1:] + own[:-1]) / 2.0, centres) * 4 + subset
        self._levels = torch.from_numpy(levels.reshape(-1))
        self._row = levels.shape[1]
        # By subset, depth and cell.
        self._nearest = torch.from_numpy(nearest.reshape(4, -1))
        rows = np.arange(LARGEST_DEPTH + 1)[None, :, None]
        self._nearest_level = torch.from_numpy(levels[rows, nearest].reshape(4, -1))
        # A transition from each state into each: predecessors of state t, and the subset on the way.
        into: list[list[tuple[int, int]]] = [[] for _ in range(STATES)]
        for state, branches in enumerate(BRANCHES):
            for following, subset in branches:
                into[following].append((state, subset))
        self._from = torch.tensor([[state for state, _ in pairs] for pairs in into])
        self._subset = torch.tensor([[subset for _, subset in pairs] for pairs in into])

    def quantize(
        self, values: torch.Tensor, depths: torch.Tensor, scales: torch.Tensor, starts: torch.Tensor
    ) -> tuple[torch.Tensor, torch.Tensor]:
        """(level numbers [blocks, coefficients] int64, coefficients that they stand for, float32) of `values`.

        `depths` int64 and `scales` float32 are given by block and coefficient; depth 0 stands for 0 and leaves the state alone.
        Paths start in the states `starts` [blocks] int64.
        """
        # Those with bits first: the path goes through them alone.
        steps = int((depths > 0).sum(1).max()) if len(depths) else 0
        order = (depths == 0).to(torch.uint8).argsort(dim=1, stable=True)[:, :steps]
        numbers = torch.zeros_like(depths)
        used = depths.gather(1, order)
        numbers.scatter_(1, order, self._path(values.gather(1, order), used, scales.gather(1, order), starts))
        decoded = self._levels[depths * self._row + numbers] * scales
        return numbers, torch.where(depths > 0, decoded, 0.0)

    def _path(
        self, values: torch.Tensor, depths: torch.Tensor, scales: torch.Tensor, starts: torch.Tensor
    ) -> torch.Tensor:
        """[blocks, steps] level numbers along the best path; those of depth 0 come last."""
        blocks, steps = values.shape
        unit = values / scales
        # [steps, blocks] and [4, steps, blocks]: neighbours in memory are what one instruction works on.
        entries = (depths * LOOKUP_CELLS + lookup_cells(unit.clone())).T.contiguous()
        flat = entries.reshape(-1)
        errors = torch.stack([table[flat] for table in self._nearest_level]).view(4, steps, blocks)
        errors = (errors - unit.T).square_() * scales.square().T
        active = (depths > 0).T.contiguous()
        cost = torch.full((STATES, blocks), torch.inf)
        cost[starts, torch.arange(blocks)] = 0.0
        arrived: list[torch.Tensor] = []
        first, second = self._from.unbind(1)
        first_subset, second_subset = self._subset.unbind(1)
        everywhere = active.all(1).tolist()
        for k in range(steps):
            error = errors[:, k]
            one = cost[first] + error[first_subset]
            other = cost[second] + error[second_subset]
            arrived.append(other < one)
            following = torch.minimum(one, other)
            cost = following if everywhere[k] else torch.where(active[k], following, cost)
        state = cost.argmin(0)
        numbers = torch.zeros((steps, blocks), dtype=torch.int64)
        cells = self._nearest.shape[1]
        nearest, origins, subsets = self._nearest.reshape(-1), self._from.reshape(-1), self._subset.reshape(-1)
        for k in range(steps - 1, -1, -1):
            way = 2 * state + arrived[k].gather(0, state[None])[0]
            number = nearest[subsets[way] * cells + entries[k]]
            numbers[k] = torch.where(active[k], number, 0)
            state = torch.where(active[k], origins[way], state)
        return numbers.T
