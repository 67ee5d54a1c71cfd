"""Moving a camera: orbit round a point, or fly through the scene. Pure functions from camera to camera."""

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from viewer.scene.model import Camera

Vector = NDArray[np.float64]
RADIANS_PER_HEIGHT = math.pi
"""Turn by a drag over the whole height of the picture: half a circle."""
POLE_MARGIN = math.radians(1.0)
"""Smallest angle between the view direction and straight up or down, in radians."""
ZOOM_STEP = 1.12
"""Factor of distance for one notch of the wheel."""
FASTER_STEP = 1.25
"""Factor of the speed of flight for one notch of the wheel."""
NEAR_SHARE = 1.5
"""Speed of flight: multiples of the distance to the nearest surface, per second. Near the ground that is walking speed."""
FARTHEST = 1.5
"""Largest distance of flight from the scene, in diagonals of the scene."""
FREE = "free"
"""Name of a camera that was moved by hand."""


def rotated(vectors: Vector, axis: Vector, radians: float) -> Vector:
    """Return `vectors` [..., 3] turned about `axis` [3] of length 1, anticlockwise as seen from its tip (Rodrigues)."""
    along = (vectors @ axis)[..., None] * axis
    turned: Vector = along + (vectors - along) * math.cos(radians) + np.cross(axis, vectors) * math.sin(radians)
    return turned


def _unit(vector: Vector) -> Vector:
    length = float(np.linalg.norm(vector))
    return vector / length if length > 1e-30 else np.array([0.0, 0.0, -1.0])


def _vector(values: tuple[float, float, float]) -> Vector:
    return np.array(values, np.float64)


def _tuple(vector: Vector) -> tuple[float, float, float]:
    x, y, z = vector.tolist()
    return x, y, z


def _axes(camera: Camera) -> tuple[Vector, Vector, Vector]:
    """Return the vectors (right, up, forward) of the view, each of length 1."""
    forward = _unit(_vector(camera.target) - _vector(camera.eye))
    right = np.cross(forward, _unit(_vector(camera.up)))
    if np.linalg.norm(right) < 1e-9:
        right = np.cross(forward, [0.0, 0.0, 1.0] if abs(forward[2]) < 0.9 else [1.0, 0.0, 0.0])
    right = _unit(right)
    return right, np.cross(right, forward), forward


def _turned(camera: Camera, yaw: float, pitch: float) -> Vector:
    """Return the view direction after a turn to the left by `yaw` and upwards by `pitch` radians, limited near the poles."""
    up = _unit(_vector(camera.up))
    right, _, forward = _axes(camera)
    level = np.cross(up, right)
    elevation = math.asin(float(np.clip(forward @ up, -1.0, 1.0)))
    limit = math.pi / 2.0 - POLE_MARGIN
    elevation = min(max(elevation + pitch, -limit), limit)
    level = rotated(level, up, yaw)
    return level * math.cos(elevation) + up * math.sin(elevation)


def _free(camera: Camera, eye: Vector, target: Vector) -> Camera:
    # Clip distances of a scene's camera fit only its position.
    return replace(camera, name=FREE, eye=_tuple(eye), target=_tuple(target), near=None, far=None)


def orbit(camera: Camera, drag: tuple[float, float], height: float) -> Camera:
    """Orbit around the target by a drag of (right, down) pixels in a picture of `height` pixels: the scene follows the mouse."""
    angle = RADIANS_PER_HEIGHT / max(height, 1.0)
    target = _vector(camera.target)
    distance = float(np.linalg.norm(target - _vector(camera.eye)))
    direction = _turned(camera, -drag[0] * angle, -drag[1] * angle)
    return _free(camera, target - direction * distance, target)


def look(camera: Camera, drag: tuple[float, float], height: float) -> Camera:
    """Turn the view by a drag of (right, down) pixels: it follows the mouse."""
    angle = RADIANS_PER_HEIGHT / max(height, 1.0) * 0.5
    eye = _vector(camera.eye)
    distance = float(np.linalg.norm(_vector(camera.target) - eye))
    direction = _turned(camera, -drag[0] * angle, -drag[1] * angle)
    return _free(camera, eye, eye + direction * distance)


def turned(camera: Camera, degrees: float) -> Camera:
    """Turn the camera to the left, at the same place. It keeps its name and clip distances."""
    eye = _vector(camera.eye)
    direction = rotated(_vector(camera.target) - eye, _unit(_vector(camera.up)), math.radians(degrees))
    return replace(camera, target=_tuple(eye + direction))


def pan(camera: Camera, drag: tuple[float, float], height: float) -> Camera:
    """Shift eye and target so that the target follows a drag of (right, down) pixels."""
    right, up, _ = _axes(camera)
    eye, target = _vector(camera.eye), _vector(camera.target)
    if camera.orthographic_height is not None:
        world_height = camera.orthographic_height
    else:
        distance = float(np.linalg.norm(target - eye))
        world_height = 2.0 * distance * math.tan(math.radians(camera.fov_degrees) / 2.0)
    shift = (-right * drag[0] + up * drag[1]) * world_height / max(height, 1.0)
    return _free(camera, eye + shift, target + shift)


def zoom(camera: Camera, steps: float) -> Camera:
    """Move towards the target by `steps` notches (away for negative ones); an orthographic view shrinks."""
    factor = ZOOM_STEP**-steps
    eye, target = _vector(camera.eye), _vector(camera.target)
    moved = _free(camera, target + (eye - target) * factor, target)
    if camera.orthographic_height is not None:
        moved = replace(moved, orthographic_height=camera.orthographic_height * factor)
    return moved


def fly(camera: Camera, direction: tuple[float, float, float], distance: float) -> Camera:
    """Move by `distance` scene units along `direction` = (right, up, forward) of the view; zero stays."""
    right, up, forward = _axes(camera)
    move = right * direction[0] + up * direction[1] + forward * direction[2]
    length = float(np.linalg.norm(move))
    if length < 1e-9:
        return camera
    shift = move / length * distance
    return _free(camera, _vector(camera.eye) + shift, _vector(camera.target) + shift)


def fly_speed(bounds: NDArray[np.float32], near: float, notches: float, fast: bool) -> float:
    """Return the speed of flight in scene units per second: NEAR_SHARE times `near`, the distance to the nearest surface.

    It is at least a thousandth of the scene per second, so that walls can be passed, and at most a twelfth. A notch is FASTER_STEP
    times faster, Shift 4 times.
    """
    size = max(float(np.linalg.norm(bounds[1].astype(np.float64) - bounds[0])), 1e-6)
    usual = min(max(NEAR_SHARE * near, size / 1000.0), size / 12.0)
    return float(usual * FASTER_STEP ** float(np.clip(notches, -40.0, 40.0)) * (4.0 if fast else 1.0))


def kept_in_sight(before: Camera, moved: Camera, bounds: NDArray[np.float32]) -> Camera:
    """Return `moved`; `before` where it would fly on away from a scene in `bounds` [2, 3] that is already far."""
    low, high = bounds.astype(np.float64)
    reach = max(float(np.linalg.norm(high - low)), 1e-6) * FARTHEST

    def away(camera: Camera) -> float:
        eye = _vector(camera.eye)
        return float(np.linalg.norm(eye - np.clip(eye, low, high)))

    return before if away(moved) > max(reach, away(before)) else moved
