"""The search for a block's best path through the trellis (`ntc.codec.block.trellis`), many blocks side by side, in torch."""

from functools import lru_cache

import numpy as np
import torch

from ntc.codec.block.config import LARGEST_DEPTH
from ntc.codec.block.trellis import BRANCHES, STATES, level_table

LOOKUP_RANGE = 8.5
"""Coefficients beyond this many times their scale take the outermost levels."""
LOOKUP_CELLS = 2048
"""Cells over the range: finer than the closest levels."""


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


class TrellisQuantizer:
    """Finds the indices with the least squared error, for many blocks side by side. Float32, on the CPU."""

    def __init__(self) -> None:
        levels = level_table()
        centres = (np.arange(LOOKUP_CELLS) + 0.5) * (2.0 * LOOKUP_RANGE / LOOKUP_CELLS) - LOOKUP_RANGE
        nearest = np.zeros((LARGEST_DEPTH + 1, LOOKUP_CELLS, 4), np.int64)
        for depth in range(1, LARGEST_DEPTH + 1):
            for subset in range(4):
                own = levels[depth, subset : 2 << depth : 4]
                nearest[depth, :, subset] = np.searchsorted((own[1:] + own[:-1]) / 2.0, centres) * 4 + subset
        self._levels = torch.from_numpy(levels)
        self._nearest = torch.from_numpy(nearest.reshape(-1, 4))
        self._nearest_level = torch.stack(
            [
                self._levels[d][self._nearest[d * LOOKUP_CELLS : (d + 1) * LOOKUP_CELLS]]
                for d in range(LARGEST_DEPTH + 1)
            ]
        ).reshape(-1, 4)
        # A transition from each state into each: predecessors of state t, and the subset on the way.
        into: list[list[tuple[int, int]]] = [[] for _ in range(STATES)]
        for state, branches in enumerate(BRANCHES):
            for following, subset in branches:
                into[following].append((state, subset))
        self._from = torch.tensor([[state for state, _ in pairs] for pairs in into])
        self._subset = torch.tensor([[subset for _, subset in pairs] for pairs in into])

    def quantize(
        self, values: torch.Tensor, depths: torch.Tensor, scales: torch.Tensor
    ) -> tuple[torch.Tensor, torch.Tensor]:
        """(level numbers [blocks, coefficients] int64, coefficients that they stand for, float32) of `values`.

        `depths` int64 and `scales` float32 are given by block and coefficient; depth 0 stands for 0 and leaves the state alone.
        """
        blocks, coefficients = values.shape
        cost = torch.full((blocks, STATES), torch.inf)
        cost[:, 0] = 0.0
        arrived: list[torch.Tensor] = []
        entries = depths * LOOKUP_CELLS + lookup_cells(values / scales)
        unit = values / scales
        weight = scales.square()
        for k in range(coefficients):
            error = (self._nearest_level[entries[:, k]] - unit[:, k, None]).square_() * weight[:, k, None]
            candidates = cost[:, self._from] + error[:, self._subset]
            better = candidates[..., 1] < candidates[..., 0]
            following = torch.where(better, candidates[..., 1], candidates[..., 0])
            idle = depths[:, k] == 0
            cost = torch.where(idle[:, None], cost + (values[:, k] ** 2)[:, None], following)
            arrived.append(better)
        state = cost.argmin(1)
        numbers = torch.zeros_like(depths)
        for k in range(coefficients - 1, -1, -1):
            way = arrived[k].gather(1, state[:, None])[:, 0].long()
            subset = self._subset[state, way]
            number = self._nearest[entries[:, k]].gather(1, subset[:, None])[:, 0]
            active = depths[:, k] > 0
            numbers[:, k] = torch.where(active, number, 0)
            state = torch.where(active, self._from[state, way], state)
        decoded = self._levels.reshape(-1)[depths * self._levels.shape[1] + numbers] * scales
        return numbers, torch.where(depths > 0, decoded, 0.0)
