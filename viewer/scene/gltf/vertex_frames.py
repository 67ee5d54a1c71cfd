"""Normals and tangents of vertices, made unit vectors or zero."""

import numpy as np
from numpy.typing import NDArray

SHORTEST = 1e-6
"""Vectors below this length have no direction."""

UNIT = 1e-5
"""Squared lengths that are this near to 1 are taken to be it."""


def _unit(vectors: NDArray[np.float32]) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """(unit vectors of `vectors` [N, 3], zero where there is no direction; which have one [N])."""
    with np.errstate(over="ignore", invalid="ignore"):
        squares = np.einsum("nc,nc->n", vectors, vectors)
        if bool((np.abs(squares - 1) < UNIT).all()):
            return vectors, np.ones(len(vectors), np.bool_)
    # Squares of numbers that float32 holds overflow it.
    wide = vectors.astype(np.float64)
    lengths = np.sqrt(np.einsum("nc,nc->n", wide, wide))
    with np.errstate(invalid="ignore"):
        directed = (lengths >= SHORTEST) & np.isfinite(lengths)
    if directed.all():
        return (wide / lengths[:, None]).astype(np.float32), directed
    unit = np.zeros_like(vectors)
    unit[directed] = wide[directed] / lengths[directed, None]
    return unit, directed


def unit_normals(normals: NDArray[np.float32]) -> tuple[NDArray[np.float32], int]:
    """([N, 3] unit vectors of `normals` [N, 3], zero for those that are not finite or of zero length; how many those are)."""
    unit, directed = _unit(normals)
    return unit, int((~directed).sum())


def unit_tangents(tangents: NDArray[np.float32]) -> tuple[NDArray[np.float32], int]:
    """([N, 4] `tangents` with unit xyz and a w of 1 or -1, all zero where xyz or w give no direction; how many those are).

    A w between the two counts by its sign: quantised files store it so (glTF 2.0, Sec. 3.7.2.1).
    """
    unit, directed = _unit(tangents[:, :3])
    directed &= np.isfinite(tangents[:, 3]) & (tangents[:, 3] != 0.0)
    signs = np.where(tangents[:, 3] < 0.0, np.float32(-1.0), np.float32(1.0))
    whole = np.concatenate([unit, signs[:, None]], axis=1)
    whole[~directed] = 0.0
    return whole, int((~directed).sum())
