"""Divergence of decoders in a picture (paper, Sec. 2, Eq. 1; docs/explanation/sharing.md)."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

BLOCK = (8, 8)
"""(height, width) of a block in pixels."""


def distinct_ids(ids: NDArray[np.int32], block: tuple[int, int] = BLOCK) -> NDArray[np.int32]:
    """Return [ceil(H / block height), ceil(W / block width), pixels of a block] int32: the distinct ids of each block.

    `ids` [H, W] int32, row 0 on top; repeated ids and negative ones, which decode nothing, are -1. Edge blocks may be partial.
    """
    height, width = ids.shape
    rows, columns = -(-height // block[0]), -(-width // block[1])
    padded = np.full((rows * block[0], columns * block[1]), -1, np.int32)
    padded[:height, :width] = ids
    blocks = padded.reshape(rows, block[0], columns, block[1]).swapaxes(1, 2)
    ordered = np.sort(blocks.reshape(rows, columns, block[0] * block[1]), axis=-1)
    ordered[..., 1:][ordered[..., 1:] == ordered[..., :-1]] = -1
    return np.asarray(np.maximum(ordered, -1))


def divergence_map(ids: NDArray[np.int32], block: tuple[int, int] = BLOCK) -> NDArray[np.uint16]:
    """Return D, [ceil(H / block height), ceil(W / block width)] uint16: the number of distinct ids in each block (paper, Eq. 1).

    `ids` [H, W] int32, row 0 on top; negative ids decode nothing and are not counted. Edge blocks may be partial.
    """
    counts: NDArray[np.uint16] = (distinct_ids(ids, block) >= 0).sum(axis=-1, dtype=np.uint16)
    return counts


@dataclass(frozen=True)
class DivergenceStatistics:
    """Statistics of a divergence map."""

    histogram: tuple[int, ...]
    """Number of blocks with D = 0, 1, 2, ... decoders; up to the number of pixels of a block."""

    @classmethod
    def of(cls, divergence: NDArray[np.uint16]) -> "DivergenceStatistics":
        """Return the statistics of a map that `divergence_map` returned."""
        return cls(tuple(np.bincount(divergence.reshape(-1)).tolist()))

    @property
    def blocks(self) -> int:
        """Number of all blocks, also of those where nothing is decoded."""
        return sum(self.histogram)

    @property
    def covered_blocks(self) -> int:
        """Number of blocks in which something is decoded."""
        return sum(self.histogram[1:])

    @property
    def excess(self) -> int:
        """Sum of max(D - 1, 0) over all blocks."""
        return self.decoder_runs - self.covered_blocks

    @property
    def score(self) -> float:
        """Mean of max(D - 1, 0) over all blocks (paper, Eq. 1)."""
        return self.excess / self.blocks if self.blocks else 0.0

    @property
    def divergent_blocks(self) -> int:
        """Number of blocks with more than one decoder."""
        return sum(self.histogram[2:])

    @property
    def maximum(self) -> int:
        """Largest number of decoders in one block."""
        return max((count for count, blocks in enumerate(self.histogram) if blocks), default=0)

    @property
    def decoder_runs(self) -> int:
        """Sum of D over all blocks: the decoder runs of waves as large as a block, which run one decoder at a time."""
        return sum(count * blocks for count, blocks in enumerate(self.histogram))

    @property
    def mean(self) -> float:
        """Mean of D over the blocks in which something is decoded; 0 without any."""
        return self.decoder_runs / self.covered_blocks if self.covered_blocks else 0.0

    @property
    def wave_efficiency(self) -> float:
        """Covered blocks / sum of D: the ratio of the decoder runs without divergence to those with it; 1 without blocks."""
        return self.covered_blocks / self.decoder_runs if self.decoder_runs else 1.0


def cut_percent(excess: float, of_excess: float) -> float | None:
    """Return the reduction of `excess` against `of_excess` in percent; None if `of_excess` is 0."""
    return 100.0 * (1.0 - excess / of_excess) if of_excess > 0 else None
