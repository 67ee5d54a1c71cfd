"""Cameras that frame scenes: how much of the picture is filled, what does not count, and that nothing hides the scene."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.support.picture_scenes import WHITE, Part, cube, placed, scene_of
from viewer.scene.model import Camera, Material, Pose, Scene, Stand
from viewer.scene.moving import Deformation, MovingVertices, VertexFrames
from viewer.state.camera import view_projection
from viewer.state.framing import SHARE, emptiest, frame_all, frame_shown

PLAIN = [Material("m", -1, WHITE)]
CUBE = scene_of([cube(0)], PLAIN)


def filled(
    camera: Camera, scene: Scene, aspect: float, points: NDArray[np.floating] | None = None
) -> tuple[float, float]:
    """Return the share of the picture's width and height that `points` take, those of the first part if None."""
    if points is None:
        points = scene.geometry.positions[: scene.primitives[0].vertex_count]
    matrix = view_projection(camera, (round(1000 * aspect), 1000), scene.bounds)
    clip = np.concatenate([points, np.ones((len(points), 1))], axis=1) @ matrix.T
    assert (clip[:, 3] > 0.0).all() or camera.orthographic_height is not None
    ends = clip[:, :2] / clip[:, 3:]
    np.testing.assert_allclose((ends.min(axis=0) + ends.max(axis=0))[np.argmax(np.ptp(ends, axis=0))], 0.0, atol=1e-3)
    width, height = (np.ptp(ends, axis=0) / 2.0).tolist()
    return width, height


@pytest.mark.parametrize("aspect", [0.5, 1.0, 1.78])
def test_a_scene_fills_four_fifths_of_the_picture(aspect: float) -> None:
    assert max(filled(frame_all(CUBE, aspect=aspect), CUBE, aspect)) == pytest.approx(SHARE, abs=2e-3)
    parallel = replace(frame_all(CUBE), orthographic_height=1.0)
    assert max(filled(frame_shown(parallel, CUBE, aspect, None), CUBE, aspect)) == pytest.approx(SHARE, abs=2e-3)


def test_a_huge_ground_and_a_dome_do_not_count() -> None:
    ground = placed(0.0, -1.0, 0.0, (500.0, 0.01, 500.0))
    dome = placed(0.0, 0.0, 0.0, (900.0, 900.0, 900.0))
    scene = scene_of([cube(0)] * 3 + [cube(0, ground), cube(0, dome)], PLAIN)
    assert max(filled(frame_all(scene), scene, 1.0)) == pytest.approx(SHARE, abs=2e-3)


class Moved:
    """A motion that shifts the vertices of the first primitive by its morph target."""

    def __init__(self, scene: Scene, shift: float) -> None:
        positions = scene.geometry.positions[: scene.primitives[0].vertex_count]
        self._scene, self._shift = scene, shift
        self.moving = (MovingVertices(0, 0, VertexFrames(positions + np.float32(shift), None, None), (), None),)

    def at(self, pose: Pose | None) -> Stand:
        return Stand(pose, self._scene.instances, {0: Deformation(0, None, ())}, {}, self._scene.bounds)


def test_the_pose_shown_is_framed() -> None:
    posed = replace(CUBE, motion=Moved(CUBE, 40.0))
    moved = frame_shown(frame_all(posed), posed, 1.0, Pose("walk", 1.0))
    np.testing.assert_allclose(np.subtract(moved.eye, frame_all(posed).eye), 40.0, atol=1e-4)
    assert frame_shown(frame_all(posed), posed, 1.0, None).eye == pytest.approx(frame_all(posed).eye)


def test_scenes_without_room_are_framed() -> None:
    for scene in (scene_of([], []), scene_of([Part(0, np.zeros((4, 3), np.float32))], PLAIN)):
        camera = frame_all(scene)
        assert np.isfinite([*camera.eye, *camera.target]).all()
        assert camera.eye != camera.target


def test_the_box_is_taken_in_which_least_is_hidden() -> None:
    # A cube above on the right of the middle.
    scene = scene_of([cube(0, placed(4.0, 3.0, 0.0))], PLAIN)
    camera = Camera("c", (0.0, 0.0, 12.0), (0.0, 0.0, 0.0))
    boxes = [(0.5, 0.0, 1.0, 0.4), (0.5, 0.6, 1.0, 1.0), (0.0, 0.6, 0.5, 1.0)]
    assert emptiest(scene, camera, (640, 480), boxes) == 1
    assert emptiest(scene, camera, (640, 480), [(0.98, 0.0, 1.0, 0.02), *boxes]) == 0
