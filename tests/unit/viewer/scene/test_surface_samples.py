"""Distances to what is nearest, estimated from points on the surfaces."""

import math
from pathlib import Path

import numpy as np
import pytest

from tests.support.gltf_builder import GltfBuilder, noise, png
from viewer.scene.cameras_file import with_cameras_beside
from viewer.scene.load import load_scene
from viewer.scene.model import Scene
from viewer.scene.surface_samples import SAMPLES, SurfaceSamples
from viewer.state.navigation import fly_speed


@pytest.fixture(scope="module")
def floor(tmp_path_factory: pytest.TempPathFactory) -> Scene:
    """One triangle at height 0."""
    builder = GltfBuilder()
    drawn = builder.drawn(builder.triangle(builder.material(builder.image(png(noise())))))
    return load_scene(drawn.write(tmp_path_factory.mktemp("floor") / "floor.glb"))


def test_points_lie_on_the_surfaces_and_all_over_them(floor: Scene) -> None:
    points = SurfaceSamples(floor).points
    low, high = floor.bounds.astype(np.float64)
    assert len(points) == SAMPLES
    np.testing.assert_allclose(
        [points.min(axis=0), points.max(axis=0)], [low, high], atol=0.02 * float(np.ptp(floor.bounds))
    )


def test_distances_are_those_to_the_nearest_surface(floor: Scene) -> None:
    samples = SurfaceSamples(floor)
    inside = samples.points.mean(axis=0)
    corners = floor.geometry.positions[:3].astype(np.float64)
    normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
    normal /= np.linalg.norm(normal)
    for height in (0.5, 2.0, 50.0):
        x, y, z = (inside + normal * height).tolist()
        assert samples.distance((x, y, z)) == pytest.approx(height, rel=0.02)
    assert samples.distance((math.nan, 0.0, 0.0)) == math.inf


def test_the_same_scene_has_the_same_points(floor: Scene) -> None:
    np.testing.assert_array_equal(SurfaceSamples(floor).points, SurfaceSamples(floor).points)


def test_a_city_is_walked_at_street_level(data_folder: Path) -> None:
    scene = with_cameras_beside(load_scene(data_folder / "scenes" / "bistro" / "bistro.gltf"))
    samples = SurfaceSamples(scene)
    street = next(camera for camera in scene.cameras if camera.name == "street")
    high = (street.eye[0], 150.0, street.eye[2])
    # Metres a second: a walk in the street, and faster above the roofs.
    assert 0.5 < fly_speed(scene.bounds, samples.distance(street.eye), 0.0, False) < 3.0
    assert fly_speed(scene.bounds, samples.distance(high), 0.0, False) > 10.0
