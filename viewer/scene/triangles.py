"""Strips, fans and plain lists as triangle lists, without loops over vertices."""

import numpy as np
from numpy.typing import NDArray

TRIANGLES, TRIANGLE_STRIP, TRIANGLE_FAN = 4, 5, 6
"""glTF primitive modes."""


def triangle_list(indices: NDArray[np.uint32], mode: int) -> NDArray[np.uint32]:
    """[3 T] indices of the triangles that `indices` [N] stand for in `mode`, wound as glTF says.

    Left-over vertices are dropped, and so are strip triangles that join strips (two equal corners).
    """
    if mode == TRIANGLES:
        return indices[: len(indices) // 3 * 3]
    count = max(0, len(indices) - 2)
    step = np.arange(count)
    if mode == TRIANGLE_STRIP:
        odd = step % 2
        corners = np.stack([step, step + 1 + odd, step + 2 - odd], axis=1)
    elif mode == TRIANGLE_FAN:
        corners = np.stack([step + 1, step + 2, np.zeros_like(step)], axis=1)
    else:
        raise ValueError(f"mode {mode} is no triangle mode")
    triangles = indices[corners]
    if mode == TRIANGLE_STRIP:
        a, b, c = triangles[:, 0], triangles[:, 1], triangles[:, 2]
        triangles = triangles[(a != b) & (b != c) & (a != c)]
    return np.ascontiguousarray(triangles).reshape(-1)
