"""Turntables and paths."""

import math
from dataclasses import replace

import numpy as np
import pytest

from viewer.scene.model import Camera
from viewer.state.motion import PATH_SECONDS, Playback, Turntable, between

BOUNDS = np.array([[0, 0, 0], [2, 2, 4]], np.float32)
CAMERA = Camera("a", (1.0, 1.0, 7.0), (1.0, 1.0, 2.0), near=1.0, far=9.0)


def test_a_turntable_turns_about_the_centre() -> None:
    quarter, motion = Turntable(30.0).advance(CAMERA, BOUNDS, 3.0)
    assert motion == Turntable(30.0)
    np.testing.assert_allclose(quarter.eye, (6.0, 1.0, 2.0), atol=1e-9)
    np.testing.assert_allclose(quarter.target, (1.0, 1.0, 2.0), atol=1e-9)
    assert (quarter.near, quarter.far, quarter.name) == (None, None, "free")
    camera = CAMERA
    for _ in range(12 * 60):
        camera, _ = Turntable(-30.0).advance(camera, BOUNDS, 1.0 / 60.0)
    np.testing.assert_allclose(camera.eye, CAMERA.eye, atol=1e-9)


def test_a_path_is_played_to_its_end() -> None:
    cameras = tuple(replace(CAMERA, name=str(i), eye=(float(i), 0.0, 9.0)) for i in range(3))
    camera, motion = Playback(cameras).advance(CAMERA, BOUNDS, PATH_SECONDS / 2.0)
    assert camera.eye == pytest.approx((0.5, 0.0, 9.0))
    assert isinstance(motion, Playback)
    camera, motion = motion.advance(camera, BOUNDS, PATH_SECONDS)
    assert camera.eye == pytest.approx((1.5, 0.0, 9.0))
    assert motion is not None
    camera, motion = motion.advance(camera, BOUNDS, 100.0)
    assert (camera, motion) == (cameras[2], None)
    assert Playback(cameras[:1]).advance(CAMERA, BOUNDS, 0.0) == (cameras[0], None)


def test_between_never_looks_at_itself() -> None:
    other = replace(CAMERA, eye=CAMERA.target, target=CAMERA.eye)
    halfway = between(CAMERA, other, 0.5)
    assert math.dist(halfway.eye, halfway.target) > 0.0
