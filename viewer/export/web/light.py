"""Light of the page: the window's sky and sun. The sky is prefiltered here, because the page would delay its first picture for it."""

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from viewer.lighting.prefilter import mip_chain, octahedral_source, prefiltered
from viewer.lighting.sky import sky_radiance
from viewer.state.view_state import Lighting

SIDES: Final = (64, 32, 16, 8)
"""Sides in texels of the faces of the mips of the sky's cube map."""
_SOURCE_SIDE: Final = 128
_SAMPLES: Final = 48
# Axes of each face (OpenGL 4.6, Table 8.19): main axis, axis along rows, axis down columns, each with its sign.
_FACES: Final = (
    ((0, 1), (2, -1), (1, -1)),
    ((0, -1), (2, 1), (1, -1)),
    ((1, 1), (0, 1), (2, 1)),
    ((1, -1), (0, 1), (2, -1)),
    ((2, 1), (0, 1), (1, -1)),
    ((2, -1), (0, -1), (1, -1)),
)


def _face_directions(side: int) -> NDArray[np.float64]:
    """Return [6, side, side, 3] unit vectors through the texels of the faces of a cube map, row 0 first."""
    place = (np.arange(side) + 0.5) / side * 2.0 - 1.0
    down, across = np.meshgrid(place, place, indexing="ij")
    directions = np.zeros((6, side, side, 3))
    for face, ((main, sign), (row, row_sign), (column, column_sign)) in enumerate(_FACES):
        directions[face, ..., main] = sign
        directions[face, ..., row] = row_sign * across
        directions[face, ..., column] = column_sign * down
    return np.asarray(directions / np.linalg.norm(directions, axis=-1, keepdims=True))


def sky_cube(lighting: Lighting) -> bytes:
    """Return the sky without the sun's disk as a cube map for three.js: float16 RGBA, face by face, each with the mips of SIDES.

    Mip n of N is prefiltered for the roughness 1 - sqrt(1 - n / (N - 1)), where three.js samples it. three.js mirrors cube maps of
    files: +X is west.
    """
    panorama = sky_radiance(lighting.sun_elevation, azimuth=lighting.sun_azimuth).astype(np.float64)
    chain = mip_chain(octahedral_source(panorama, _SOURCE_SIDE))
    mips = []
    for level, side in enumerate(SIDES):
        roughness = 1.0 - math.sqrt(1.0 - level / (len(SIDES) - 1))
        directions = (_face_directions(side) * (-1.0, 1.0, 1.0)).reshape(-1, 3)
        radiance = prefiltered(chain, directions, roughness, _SAMPLES).reshape(6, -1, 3)
        mips.append(np.concatenate([radiance, np.ones((6, radiance.shape[1], 1))], axis=2))
    return np.concatenate(mips, axis=1).astype("<f2").tobytes()
