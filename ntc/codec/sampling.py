"""Filters of textures in numpy float64: wrap modes, bilinear and trilinear lookups, which every reference decoder shares."""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from ntc.codec.config import WrapMode
from ntc.codec.latents import LatentLevel

Array = NDArray[np.float64]


def wrap_coordinate(coordinate: Array, mode: WrapMode) -> Array:
    """Return texture coordinates [N] wrapped into [0, 1]."""
    if mode == "repeat":
        return coordinate - np.floor(coordinate)
    if mode == "clamp":
        return np.clip(coordinate, 0.0, 1.0)
    turned = coordinate - 2.0 * np.floor(coordinate / 2.0)
    return np.where(turned > 1.0, 2.0 - turned, turned)


def _neighbour(cell: NDArray[np.int64], cells: int, mode: WrapMode) -> NDArray[np.int64]:
    return cell % cells if mode == "repeat" else np.clip(cell, 0, cells - 1)


def bilinear(
    fetch: Callable[[NDArray[np.int64], NDArray[np.int64]], Array],
    size: tuple[int, int],
    uv: Array,
    wrap: tuple[WrapMode, WrapMode],
) -> Array:
    """Return [N, K] at wrapped `uv` [N, 2] of a grid of `size` (along u, along v), whose values `fetch` gives by column and row."""
    x, y = uv[:, 0] * size[0] - 0.5, uv[:, 1] * size[1] - 0.5
    left, top = np.floor(x).astype(np.int64), np.floor(y).astype(np.int64)
    fraction_x, fraction_y = (x - left)[:, None], (y - top)[:, None]

    def value(column: NDArray[np.int64], row: NDArray[np.int64]) -> Array:
        return fetch(_neighbour(column, size[0], wrap[0]), _neighbour(row, size[1], wrap[1]))

    upper = value(left, top) * (1.0 - fraction_x) + value(left + 1, top) * fraction_x
    lower = value(left, top + 1) * (1.0 - fraction_x) + value(left + 1, top + 1) * fraction_x
    return upper * (1.0 - fraction_y) + lower * fraction_y


def trilinear(
    levels: Sequence[LatentLevel],
    sample: Callable[[LatentLevel, Array], Array],
    width: int,
    uv: Array,
    lod: Array,
    wrap: tuple[WrapMode, WrapMode],
) -> Array:
    """Return [N, width]: what `sample` gives for a level and wrapped `uv` [N, 2], blended between the two levels around `lod` [N],
    which lies in their range."""
    uv = np.where(np.isfinite(uv), uv, 0.0)
    wrapped = np.stack([wrap_coordinate(uv[:, axis], wrap[axis]) for axis in range(2)], axis=-1)
    lower = np.floor(lod).astype(np.int64)
    upper = np.minimum(lower + 1, len(levels) - 1)
    share = lod - lower
    blended = np.zeros((len(uv), width))
    for number, level in enumerate(levels):
        weight = np.where(lower == number, 1.0 - share, 0.0) + np.where(upper == number, share, 0.0)
        used = np.nonzero(weight)[0]
        if used.size:
            blended[used] += sample(level, wrapped[used]) * weight[used, None]
    return blended


def clamped_lod(lod: Array, levels: int) -> Array:
    return np.clip(np.where(np.isfinite(lod), lod, 0.0), 0.0, levels - 1)


def texel_centres(width: int, height: int) -> Array:
    """Return [height * width, 2] float64 texture coordinates of all texel centres, row by row."""
    u, v = (np.arange(width) + 0.5) / width, (np.arange(height) + 0.5) / height
    return np.stack([np.tile(u, height), np.repeat(v, width)], axis=-1)
