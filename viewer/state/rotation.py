"""Turning vectors about an axis."""

import math

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]


def rotated(vectors: Vector, axis: Vector, radians: float) -> Vector:
    """`vectors` [..., 3] turned about `axis` [3], which has length 1, anticlockwise as seen from its tip (Rodrigues)."""
    along = (vectors @ axis)[..., None] * axis
    turned: Vector = along + (vectors - along) * math.cos(radians) + np.cross(axis, vectors) * math.sin(radians)
    return turned
