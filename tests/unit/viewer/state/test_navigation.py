"""How fast a camera flies, and where flying ends."""

import numpy as np
import pytest

from viewer.scene.model import Camera
from viewer.state.navigation import FASTER_STEP, NEAR_SHARE, fly, fly_speed, kept_in_sight

TOWN = np.array([[-100.0, 0.0, -100.0], [100.0, 30.0, 100.0]], np.float32)
SIZE = float(np.linalg.norm(TOWN[1] - TOWN[0]))


def test_speed_is_that_of_what_is_near() -> None:
    assert fly_speed(TOWN, 1.7, 0.0, False) == pytest.approx(NEAR_SHARE * 1.7)
    assert fly_speed(TOWN, 3.4, 0.0, False) == pytest.approx(NEAR_SHARE * 3.4)


def test_walls_slow_down_but_are_no_end_and_the_sky_has_a_limit() -> None:
    assert fly_speed(TOWN, 0.0, 0.0, False) == pytest.approx(SIZE / 1000.0)
    assert fly_speed(TOWN, np.inf, 0.0, False) == pytest.approx(SIZE / 12.0)


def test_notches_and_shift_are_faster() -> None:
    usual = fly_speed(TOWN, 2.0, 0.0, False)
    assert fly_speed(TOWN, 2.0, 2.0, False) == pytest.approx(usual * FASTER_STEP**2)
    assert fly_speed(TOWN, 2.0, 0.0, True) == pytest.approx(usual * 4.0)


def test_flying_ends_far_from_the_scene_but_never_on_the_way_back() -> None:
    far = Camera("far", (0.0, 0.0, 1e4), (0.0, 0.0, 1e4 - 1.0))
    back, away = fly(far, (0.0, 0.0, 1.0), 5.0), fly(far, (0.0, 0.0, -1.0), 5.0)
    assert kept_in_sight(far, back, TOWN) == back
    assert kept_in_sight(far, away, TOWN) == far
    street = Camera("street", (0.0, 1.7, 0.0), (0.0, 1.7, -1.0))
    moved = fly(street, (0.0, 0.0, -1.0), 250.0)
    assert kept_in_sight(street, moved, TOWN) == moved
