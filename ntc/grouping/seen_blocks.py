"""Which textures are seen together in one block: all that divergence depends on."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from ntc.metrics.divergence import BLOCK, distinct_ids


@dataclass(frozen=True, eq=False)
class SeenBlocks:
    """The distinct texture sets of blocks with two textures or more; others cannot diverge."""

    members: sparse.csr_array
    """[sets, textures] float64, 1 where the set holds the texture."""
    weights: NDArray[np.float64]
    """[sets] number of blocks with this set."""
    blocks: int
    """All blocks of all views, those without excess too."""

    def excess(self, groups: NDArray[np.int64]) -> float:
        """Sum of D - 1 over all blocks when texture t is decoded by decoder `groups[t]` (paper, Sec. 2)."""
        choice = np.zeros((len(groups), int(groups.max(initial=-1)) + 1))
        choice[np.arange(len(groups)), groups] = 1.0
        distinct = ((self.members @ choice) > 0.0).sum(axis=1)
        return float(self.weights @ (distinct - 1.0)) if len(self.weights) else 0.0


def seen_blocks(views: Sequence[NDArray[np.int32]], textures: int, block: tuple[int, int] = BLOCK) -> SeenBlocks:
    """The texture sets of `views`, each [H, W] int32 texture ids with -1 for none, row 0 on top.

    Raises ValueError for an id that is not below `textures`.
    """
    sets: dict[bytes, int] = {}
    blocks = 0
    for view in views:
        if view.size and int(view.max()) >= textures:
            raise ValueError(f"texture id {int(view.max())} in a scene of {textures} textures")
        rows = distinct_ids(view, block).reshape(-1, block[0] * block[1])
        blocks += len(rows)
        several = rows[(rows >= 0).sum(axis=1) > 1]
        distinct, counts = np.unique(np.sort(several, axis=1), axis=0, return_counts=True)
        for row, count in zip(distinct, counts.tolist(), strict=True):
            key = row[row >= 0].tobytes()
            sets[key] = sets.get(key, 0) + count
    ids = [np.frombuffer(key, np.int32) for key in sets]
    starts = np.concatenate([[0], np.cumsum([len(row) for row in ids])]).astype(np.int64)
    columns = np.concatenate(ids) if ids else np.zeros(0, np.int32)
    members = sparse.csr_array((np.ones(len(columns)), columns, starts), shape=(len(ids), textures))
    return SeenBlocks(members, np.array(list(sets.values()), np.float64), blocks)
