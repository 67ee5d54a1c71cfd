"""Raw features made comparable within a set of textures."""

import numpy as np
from numpy.typing import NDArray

_SMALLEST = 1e-12
"""Deviations and lengths below are rounding errors of equal numbers."""


def standardised_columns(raw: NDArray[np.float64]) -> NDArray[np.float64]:
    """[textures, F] float64: each column of `raw` with mean 0 and deviation 1, or 0 where it is constant."""
    if not len(raw):
        return raw
    deviation = raw.std(axis=0)
    return (raw - raw.mean(axis=0)) / np.where(deviation > _SMALLEST, deviation, 1.0)


def centred_directions(raw: NDArray[np.float64]) -> NDArray[np.float64]:
    """[textures, F] float64: the rows of `raw` at length 1, minus their mean, times one number for all.

    The number makes the mean squared distance from the centre 1, whatever F is; equal rows become 0. Columns are not
    scaled one by one, as an embedding's angles between textures are what it was trained for.
    """
    if not len(raw):
        return raw
    rows = raw / np.maximum(np.linalg.norm(raw, axis=1, keepdims=True), _SMALLEST)
    centred = rows - rows.mean(axis=0)
    spread = float(np.sqrt(np.mean(np.sum(centred**2, axis=1))))
    # Networks compute in float32, so equal pictures of different batches differ by about 1e-7.
    return centred / spread if spread > 1e-6 else np.zeros_like(centred)
