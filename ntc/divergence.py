"""Divergence of decoders over a picture (paper, Sec. 2, Eq. 1)."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

BLOCK = (8, 8)
"""(height, width) of a block in pixels."""


def distinct_ids(ids: NDArray[np.int32], block: tuple[int, int] = BLOCK) -> NDArray[np.int32]:
    """[ceil(H / block height), ceil(W / block width), pixels of a block] int32: the ids of each block, every one once.

    `ids` [H, W] int32, row 0 on top; repeated ids and negative ones, which decode nothing, are -1. Edge blocks may be partial.
    """
    height, width = ids.shape
    rows, columns = -(-height // block[0]), -(-width // block[1])
    padded = np.full((rows * block[0], columns * block[1]), -1, np.int32)
    padded[:height, :width] = ids
    blocks = padded.reshape(rows, block[0], columns, block[1]).swapaxes(1, 2)
    ordered = np.sort(blocks.reshape(rows, columns, block[0] * block[1]), axis=-1)
    ordered[..., 1:][ordered[..., 1:] == ordered[..., :-1]] = -1
    return np.maximum(ordered, -1)


def divergence_map(ids: NDArray[np.int32], block: tuple[int, int] = BLOCK) -> NDArray[np.uint16]:
    """D: [ceil(H / block height), ceil(W / block width)] uint16, the number of distinct ids in each block (paper, Eq. 1).

    `ids` [H, W] int32, row 0 on top; negative ids decode nothing and are not counted. Edge blocks may be partial.
    """
    return (distinct_ids(ids, block) >= 0).sum(axis=-1).astype(np.uint16)


@dataclass(frozen=True)
class DivergenceStatistics:
    """A divergence map in four numbers."""

    score: float
    """Mean of max(D - 1, 0) over all blocks (paper, Eq. 1)."""
    excess: int
    """Sum of max(D - 1, 0) over all blocks."""
    divergent_blocks: int
    """Blocks with more than one decoder."""
    maximum: int
    """Most decoders in one block."""

    @classmethod
    def of(cls, divergence: NDArray[np.uint16]) -> "DivergenceStatistics":
        """Statistics of a map made by `divergence_map`."""
        excess = np.maximum(divergence.astype(np.int64) - 1, 0)
        return cls(
            score=float(excess.mean()) if excess.size else 0.0,
            excess=int(excess.sum()),
            divergent_blocks=int((excess > 0).sum()),
            maximum=int(divergence.max(initial=0)),
        )
