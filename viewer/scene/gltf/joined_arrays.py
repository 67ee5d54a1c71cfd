"""Parts of a large scene put together, each let go of as soon as it has been copied: the scene is never held twice."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

SHORT_INDICES = 1 << 16
"""Indices below it take two bytes each, and a scene whose primitives all have at most so many vertices has no others."""


def joined(
    parts: list[NDArray[np.float32] | None], counts: Sequence[int], components: int, absent: float = 0.0
) -> NDArray[np.float32] | None:
    """[sum of counts, components] float32, `absent` for parts that are None; None when all are. Sets all `parts` to None."""
    if all(part is None for part in parts):
        return None
    whole = np.empty((sum(counts), components), np.float32)
    start = 0
    for number, count in enumerate(counts):
        part, parts[number] = parts[number], None
        whole[start : start + count] = absent if part is None else part
        start += count
    return whole


def joined_indices(
    parts: list[NDArray[Any] | None], total: int, highest: int
) -> NDArray[np.uint16] | NDArray[np.uint32]:
    """[total] all unsigned integers of `parts`, as uint16 where `highest` fits, else uint32. Sets all `parts` to None."""
    whole: NDArray[Any] = np.empty(total, np.uint16 if highest < SHORT_INDICES else np.uint32)
    start = 0
    for number, part in enumerate(parts):
        if part is not None:
            parts[number] = None
            whole[start : start + len(part)] = part
            start += len(part)
    return whole
