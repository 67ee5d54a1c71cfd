"""Camera matrices."""

import math
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from viewer.scene.model import Camera

Matrix = NDArray[np.float64]
NEAREST_SHARE = 2e-4
"""Near plane as a share of the far distance, where the camera stands inside the scene and names no near distance."""


def _cross(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the cross product of two vectors [3]; `numpy.cross` takes ten times as long for so few numbers."""
    (ax, ay, az), (bx, by, bz) = a.tolist(), b.tolist()
    return np.array([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx])


@lru_cache(maxsize=16)
def view_matrix(camera: Camera) -> Matrix:
    """Return the [4, 4] float64 world-to-camera matrix for column vectors, looking along -Z; read-only."""
    eye, target, up = (np.array(vector, np.float64) for vector in (camera.eye, camera.target, camera.up))
    backward = eye - target
    backward /= max(float(np.linalg.norm(backward)), 1e-30)
    right = _cross(up, backward)
    if np.linalg.norm(right) < 1e-9:
        # The view looks straight along `up`: any horizontal direction will do.
        right = _cross(np.array([0.0, 0.0, 1.0] if abs(backward[2]) < 0.9 else [1.0, 0.0, 0.0]), backward)
    right /= np.linalg.norm(right)
    rotation = np.stack([right, _cross(backward, right), backward])
    matrix = np.eye(4)
    matrix[:3, :3] = rotation
    matrix[:3, 3] = -rotation @ eye
    matrix.flags.writeable = False
    return matrix


def clip_distances(camera: Camera, bounds: NDArray[np.float32]) -> tuple[float, float]:
    """Return (near, far) distances: those of the camera if it has any, else fitted to `bounds` [2, 3]."""
    view = view_matrix(camera)
    corners = np.array(
        [[bounds[i, 0], bounds[j, 1], bounds[k, 2], 1.0] for i in (0, 1) for j in (0, 1) for k in (0, 1)]
    )
    depths = -(corners @ view.T)[:, 2]
    far = camera.far if camera.far is not None else max(float(depths.max()) * 1.01, 1e-3)
    near = camera.near if camera.near is not None else max(float(depths.min()) * 0.99, far * NEAREST_SHARE)
    return near, max(far, near * 1.001)


def projection_matrix(camera: Camera, size: tuple[int, int], near: float, far: float) -> Matrix:
    """Return the [4, 4] float64 OpenGL projection for a picture of `size` (width, height) pixels."""
    aspect = size[0] / size[1]
    matrix = np.zeros((4, 4))
    if camera.orthographic_height is not None:
        matrix[0, 0] = 2.0 / (camera.orthographic_height * aspect)
        matrix[1, 1] = 2.0 / camera.orthographic_height
        matrix[2, 2], matrix[2, 3] = -2.0 / (far - near), -(far + near) / (far - near)
        matrix[3, 3] = 1.0
        return matrix
    focal = 1.0 / math.tan(math.radians(camera.fov_degrees) / 2.0)
    matrix[0, 0], matrix[1, 1] = focal / aspect, focal
    matrix[2, 2], matrix[2, 3] = -(far + near) / (far - near), -2.0 * far * near / (far - near)
    matrix[3, 2] = -1.0
    return matrix


def view_projection(camera: Camera, size: tuple[int, int], bounds: NDArray[np.float32]) -> Matrix:
    """Return the [4, 4] float64 world-to-clip matrix."""
    near, far = clip_distances(camera, bounds)
    return projection_matrix(camera, size, near, far) @ view_matrix(camera)


def frustum_planes(matrix: Matrix) -> Matrix:
    """Return the [6, 4] planes of a world-to-clip matrix: a point p is inside where plane . (p, 1) >= 0; normals have length 1."""
    planes = np.stack([matrix[3] + sign * matrix[axis] for axis in range(3) for sign in (1.0, -1.0)])
    normalized: Matrix = planes / np.maximum(np.linalg.norm(planes[:, :3], axis=1, keepdims=True), 1e-30)
    return normalized
