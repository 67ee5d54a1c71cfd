"""Cameras that frame a scene: what is seen of it fills four fifths of the picture."""

import math
from collections.abc import Sequence
from dataclasses import replace
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from viewer.scene.model import Camera, Pose, Scene
from viewer.scene.parts import Part, near_parts, parts_of
from viewer.state.camera import view_matrix, view_projection

Array = NDArray[np.float64]
SHARE = 0.8
"""Share of the picture's width or height, whichever is fuller, that framed points take."""
ALL = "all"
"""Name of the camera that frames the whole scene."""
DIRECTIONS = ((0.45, 0.35, 1.0), (-0.45, 0.35, 1.0), (1.0, 0.35, 0.45), (-1.0, 0.35, 0.45), (0.45, 0.35, -1.0))
"""Directions from the scene to the camera; the first from which nothing that is left out hides the scene is taken."""
MOST_HIDDEN, POINTS_INSIDE = 256, 8
"""Number of triangles of a part that are looked for behind a box, and of points in each."""
MOST_BLOCKING = 1 << 16
"""Number of triangles of a part that are tested for hiding the scene."""
_opening: "WeakKeyDictionary[Scene, dict[tuple[float, float], Camera]]" = WeakKeyDictionary()


def framed(camera: Camera, points: Array, aspect: float) -> Camera:
    """Return `camera`, moved but not turned, so that `points` [N, 3] fill SHARE of the picture and are in its middle.

    `aspect`: width over height of the picture. The camera then turns about the middle of the points.
    """
    rotation = view_matrix(camera)[:3, :3]
    right, up, back = (points @ rotation.T).T
    is_parallel = camera.orthographic_height is not None
    tangent = 0.0 if is_parallel else SHARE * math.tan(math.radians(camera.fov_degrees) / 2.0)
    # Each side of the narrowed frustum touches the point farthest beyond it.
    across, along = tangent * aspect, tangent
    sides = [
        (float((right + across * back).max()), float((-right + across * back).max())),
        (float((up + along * back).max()), float((-up + along * back).max())),
    ]
    x, y = ((high - low) / 2.0 for high, low in sides)
    nearest, middle = float(back.max()), float((back.min() + back.max()) / 2.0)
    scale = max(float(np.ptp(points, axis=0).max()), 1e-6)
    framed = replace(camera, near=None, far=None)
    if is_parallel:
        width, height = (high + low for high, low in sides)
        depth = nearest + scale
        framed = replace(framed, orthographic_height=max(height, width / aspect, 1e-6) / SHARE)
    else:
        depth = max((sum(sides[0])) / (2.0 * across), sum(sides[1]) / (2.0 * along), nearest + 1e-3 * scale)
    eye, target = (np.array([x, y, place]) @ rotation for place in (depth, middle))
    return replace(framed, eye=tuple(eye.tolist()), target=tuple(target.tolist()))


def frame_shown(camera: Camera, scene: Scene, aspect: float, pose: Pose | None) -> Camera:
    """Return `camera`, not turned, with all of `scene` in the picture as it stands in `pose`; parts far beyond the others do not
    count."""
    return framed(camera, _points(near_parts(parts_of(scene, pose)), scene), aspect)


def frame_all(scene: Scene, fov_degrees: float = 60.0, aspect: float = 1.0) -> Camera:
    """Return a camera called ALL that frames `scene` as it was read, from the front, a little from above and from the right.

    Where a part that is not framed hides the scene from there, it looks from another side.
    """
    known = _opening.setdefault(scene, {})
    if (fov_degrees, aspect) not in known:
        known[fov_degrees, aspect] = _frame_all(scene, fov_degrees, aspect)
    return known[fov_degrees, aspect]


def emptiest(
    scene: Scene, camera: Camera, size: tuple[int, int], boxes: Sequence[tuple[float, float, float, float]]
) -> int:
    """Return the index of the box that hides least of `scene` as it was read, in a picture of `size`; the first of equal ones.

    A box is left, top, right and bottom, as shares of the picture, 0 to 1.
    """
    # Points within triangles, each for its share of their area.
    inside = np.random.default_rng(0).dirichlet((1.0, 1.0, 1.0), POINTS_INSIDE)
    samples, areas = [np.zeros((0, 3))], [np.zeros(0)]
    for part in parts_of(scene):
        triangles = part.points.reshape(-1, 3, 3)
        triangles = triangles[:: -(-len(triangles) // MOST_HIDDEN)]
        samples.append(np.einsum("pc,tcx->tpx", inside, triangles).reshape(-1, 3))
        area = np.linalg.norm(np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]), axis=1)
        areas.append(np.repeat(area * part.triangles / len(triangles), POINTS_INSIDE))
    points, weights = np.concatenate(samples), np.concatenate(areas)
    clip = np.concatenate([points, np.ones((len(points), 1))], axis=1) @ view_projection(camera, size, scene.bounds).T
    is_before = clip[:, 3] > 0.0
    clip, weights = clip[is_before], weights[is_before]
    # From the left and from the top, 0 to 1.
    places = clip[:, :2] / clip[:, 3:] * (0.5, -0.5) + 0.5

    def hidden(index: int) -> float:
        low, high = np.reshape(boxes[index], (2, 2))
        return float(weights[((places >= low) & (places <= high)).all(axis=1)].sum())

    return min(range(len(boxes)), key=hidden)


def _frame_all(scene: Scene, fov_degrees: float, aspect: float) -> Camera:
    parts = parts_of(scene)
    near = near_parts(parts)
    points = _points(near, scene)
    left_out = {part.instance for part in parts} - {part.instance for part in near}
    cameras: list[Camera] = []
    for direction in DIRECTIONS:
        camera = framed(Camera(ALL, direction, (0.0, 0.0, 0.0), fov_degrees=fov_degrees), points, aspect)
        cameras.append(camera)
        if not any(_hides(scene, instance, camera) for instance in left_out):
            return camera
    return cameras[0]


def _points(parts: Sequence[Part], scene: Scene) -> Array:
    return np.concatenate([part.points for part in parts]) if parts else scene.bounds.astype(np.float64)


def _hides(scene: Scene, instance: int, camera: Camera) -> bool:
    """Return whether a triangle of an instance lies between the camera and the point that it looks at."""
    primitive = scene.primitives[scene.instances.primitive[instance]]
    indices = scene.geometry.indices[primitive.first_index :][: min(primitive.index_count, 3 * MOST_BLOCKING)]
    transform = scene.instances.transform[instance].astype(np.float64)
    local = scene.geometry.positions[primitive.base_vertex + indices.astype(np.int64)].astype(np.float64)
    eye = np.array(camera.eye)
    ray = np.array(camera.target) - eye
    a, b, c = (local @ transform[:3, :3].T + transform[:3, 3] - eye).reshape(-1, 3, 3).transpose(1, 0, 2)
    # The ray passes a triangle where the volumes that it makes with the three sides have one sign.
    volumes = np.stack([np.cross(p, q) @ ray for p, q in ((a, b), (b, c), (c, a))])
    inside = (volumes >= 0.0).all(axis=0) | (volumes <= 0.0).all(axis=0)
    normals = np.cross(b - a, c - a)
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.einsum("ij,ij->i", normals, a) / (normals @ ray)
    return bool((inside & (share > 0.0) & (share < 1.0)).any())
