"""Directions in world space (Y up; north is -Z, east is +X), and pictures of all of them: equirectangular, octahedral, cubes.

An equirectangular panorama has north in its middle column, east right of it, and up in its top row. The octahedral map (Engelhardt and
Dachsbacher 2008) lays the upper half of the sphere into a diamond and folds the lower one into the corners.
"""

import math

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def direction_towards(azimuth: float, elevation: float) -> tuple[float, float, float]:
    """Return the unit vector towards a place in the sky; azimuth (from north towards east) and elevation are in degrees."""
    turn, height = math.radians(azimuth), math.radians(elevation)
    flat = math.cos(height)
    return flat * math.sin(turn), math.sin(height), -flat * math.cos(turn)


def turned(directions: Array, degrees: float) -> Array:
    """Return directions [..., 3] turned about the vertical axis from north towards east."""
    sine, cosine = math.sin(math.radians(degrees)), math.cos(math.radians(degrees))
    x, y, z = np.moveaxis(directions, -1, 0)
    return np.stack([cosine * x - sine * z, y, sine * x + cosine * z], axis=-1)


def panorama_directions(height: int) -> Array:
    """Return [height, 2 * height, 3] unit vectors through the centres of the texels of an equirectangular panorama, row 0 on top."""
    elevation = (0.5 - (np.arange(height) + 0.5) / height) * np.pi
    azimuth = ((np.arange(2 * height) + 0.5) / height - 1.0) * np.pi
    flat = np.cos(elevation)[:, None]
    up = np.broadcast_to(np.sin(elevation)[:, None], (height, 2 * height))
    return np.stack([flat * np.sin(azimuth), up, -flat * np.cos(azimuth)], axis=-1)


def panorama_solid_angles(height: int) -> Array:
    """Return [height] solid angle in steradian of one texel of each row of a panorama [height, 2 * height]."""
    edges = np.cos(np.arange(height + 1) / height * np.pi)
    solid: Array = (edges[:-1] - edges[1:]) * np.pi / height
    return solid


def panorama_coordinates(directions: Array) -> Array:
    """Return [..., 2] (u, v) in [0, 1] where `directions` [..., 3] meet a panorama; v is 0 on top."""
    x, y, z = np.moveaxis(directions, -1, 0)
    u = np.arctan2(x, -z) / (2.0 * np.pi) + 0.5
    v = np.arccos(np.clip(y / np.maximum(np.linalg.norm(directions, axis=-1), 1e-30), -1.0, 1.0)) / np.pi
    return np.stack([u, v], axis=-1)


def _fold(planar: Array) -> Array:
    """Return points [..., 2] of the octahedral map in [-1, 1] with inner and outer triangles exchanged."""
    signs = np.where(planar >= 0.0, 1.0, -1.0)
    folded: Array = (1.0 - np.abs(planar[..., ::-1])) * signs
    return folded


def octahedral_coordinates(directions: Array) -> Array:
    """Return [..., 2] in [0, 1] where `directions` [..., 3], not zero, lie in the octahedral map."""
    scaled = directions / np.maximum(np.sum(np.abs(directions), axis=-1, keepdims=True), 1e-30)
    planar = scaled[..., [0, 2]]
    return np.where(scaled[..., 1:2] >= 0.0, planar, _fold(planar)) * 0.5 + 0.5


def octahedral_directions(coordinates: Array) -> Array:
    """Return [..., 3] unit vectors of places [..., 2] in the octahedral map, in [0, 1]."""
    planar = coordinates * 2.0 - 1.0
    y = 1.0 - np.abs(planar[..., 0]) - np.abs(planar[..., 1])
    flat = np.where(y[..., None] >= 0.0, planar, _fold(planar))
    unnormalized = np.stack([flat[..., 0], y, flat[..., 1]], axis=-1)
    directions: Array = unnormalized / np.linalg.norm(unnormalized, axis=-1, keepdims=True)
    return directions


def cube_coordinates(directions: Array) -> tuple[NDArray[np.int64], Array]:
    """Return ([...] faces, [..., 2] places on them in [0, 1]) where `directions` [..., 3] meet a cube.

    Faces 0 to 5 are +X, +Y, +Z, -X, -Y, -Z. The two coordinates on a face run along the two axes that follow the face's axis in the
    order X, Y, Z, X, Y.
    """
    size = np.abs(directions)
    axis = np.argmax(size, axis=-1)
    component = np.take_along_axis(directions, axis[..., None], axis=-1)
    others = np.stack([axis + 1, axis + 2], axis=-1) % 3
    places = np.take_along_axis(directions, others, axis=-1) / np.maximum(np.abs(component), 1e-30)
    return axis + 3 * (component[..., 0] < 0.0), places * 0.5 + 0.5


def cube_directions(side: int) -> Array:
    """Return [side + 2, 6, side + 2, 3] unit vectors through the texels of the six faces of a cube, each with a border of one texel.

    The border continues the plane of its face, so that bilinear filtering at an edge needs no other face.
    """
    place = ((np.arange(-1, side + 1) + 0.5) / side) * 2.0 - 1.0
    down, across = np.meshgrid(place, place, indexing="ij")
    directions = np.zeros((side + 2, 6, side + 2, 3))
    for face in range(6):
        axis = face % 3
        directions[:, face, :, axis] = 1.0 if face < 3 else -1.0
        directions[:, face, :, (axis + 1) % 3] = across
        directions[:, face, :, (axis + 2) % 3] = down
    return np.asarray(directions / np.linalg.norm(directions, axis=-1, keepdims=True))


def sample_bilinear(image: Array, x: Array, y: Array, repeat_x: bool = False) -> Array:
    """Sample `image` [H, W, C] at texel coordinates (0.5: the first centre), clamped at its edges, or repeated along x: [..., C]."""
    height, width = image.shape[:2]
    x, y = x - 0.5, y - 0.5
    left, top = np.floor(x).astype(np.int64), np.floor(y).astype(np.int64)
    across, down = (x - left)[..., None], (y - top)[..., None]
    columns = [(left + step) % width if repeat_x else np.clip(left + step, 0, width - 1) for step in (0, 1)]
    rows = [np.clip(top + step, 0, height - 1) for step in (0, 1)]
    upper, lower = (image[row, columns[0]] * (1.0 - across) + image[row, columns[1]] * across for row in rows)
    return np.asarray(upper * (1.0 - down) + lower * down)
