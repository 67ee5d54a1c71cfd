"""Places near a camera."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from viewer.scene.model import Camera
from viewer.viewpoints.scene_views import NearbyConfig, nearby_cameras


@pytest.fixture(scope="module")
def scene() -> Any:
    """Nearby cameras look at nothing of a scene but its size."""
    return SimpleNamespace(bounds=np.array([(-20.0, 0.0, -20.0), (20.0, 10.0, 20.0)]))


def test_they_are_near_and_look_elsewhere(scene: Any) -> None:
    camera = Camera("c", (0.0, 1.0, 5.0), (0.0, 0.0, 0.0), fov_degrees=40.0)
    extent = float(np.linalg.norm(scene.bounds[1] - scene.bounds[0]))
    made = nearby_cameras([camera, replace(camera, name="d")], scene, NearbyConfig(count=50))
    assert len(made) == 100
    assert len({near.name for near in made}) == 100
    away = np.array([near.eye for near in made]) - camera.eye
    assert np.abs(away).max() < 5.0 * 0.01 * extent
    directions = np.array([np.subtract(near.target, near.eye) for near in made])
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    assert len(np.unique(directions.round(6), axis=0)) == 100
    assert np.median(directions @ (np.array([0.0, -1.0, -5.0]) / np.sqrt(26.0))) > 0.85
    assert {near.fov_degrees for near in made} == {40.0}
