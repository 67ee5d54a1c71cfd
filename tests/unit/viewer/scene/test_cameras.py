"""Cameras of scenes and of camera files, and how near they are to surfaces."""

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ntc.errors import InputError
from tests.support.gltf_builder import GltfBuilder, noise, png
from tests.support.scenes import built
from viewer.scene.cameras_file import find_camera, read_cameras
from viewer.scene.load import load_scene
from viewer.scene.model import Scene
from viewer.scene.surface_samples import SAMPLES, SurfaceSamples


def test_all_cameras_in_world_space() -> None:
    builder = GltfBuilder()
    builder.drawn(builder.triangle())
    wide = builder.add("cameras", type="perspective", name="wide", perspective={"yfov": math.pi / 3, "znear": 0.1})
    flat = builder.add("cameras", type="orthographic", orthographic={"xmag": 4, "ymag": 3, "znear": 0.5, "zfar": 50})
    # A quarter turn about Y looks along -X.
    turn = [0.0, math.sin(math.pi / 4), 0.0, math.cos(math.pi / 4)]
    builder.add("nodes", translation=[10, 0, 0], rotation=turn, scale=[2, 2, 2], children=[2, 3])
    builder.add("nodes", camera=wide, translation=[0, 1, 0])
    builder.add("nodes", camera=flat, name="plan")
    builder.add("nodes", camera=wide, scale=[0, 0, 0], name="squashed")
    scene = built(builder)
    first, second = scene.cameras
    assert (first.name, second.name) == ("wide", "plan")
    np.testing.assert_allclose(first.eye, [10, 2, 0], atol=1e-6)
    direction = np.subtract(first.target, first.eye)
    np.testing.assert_allclose(direction / np.linalg.norm(direction), [-1, 0, 0], atol=1e-6)
    np.testing.assert_allclose(first.up, [0, 1, 0], atol=1e-6)
    assert first.fov_degrees == pytest.approx(60)
    assert (first.near, first.far, first.orthographic_height) == (0.1, None, None)
    assert (second.orthographic_height, second.near, second.far) == (6, 0.5, 50)
    assert any("squashed" in line for line in scene.report.ignored)


def test_cameras_that_share_a_name_are_told_apart() -> None:
    builder = GltfBuilder()
    builder.drawn(builder.triangle())
    lens = builder.add("cameras", type="perspective", perspective={"yfov": 1.0, "znear": 0.1})
    builder.add("nodes", camera=lens, name="eye")
    builder.add("nodes", camera=lens, name="eye")
    assert [camera.name for camera in built(builder).cameras] == ["eye", "eye (node 2)"]


@pytest.mark.parametrize(
    "camera",
    [
        {"type": "fisheye"},
        {"type": "perspective", "perspective": {"yfov": 4}},
        {"type": "perspective", "perspective": {"yfov": "wide"}},
        {"type": "orthographic", "orthographic": {"ymag": 0}},
    ],
)
def test_broken_cameras(camera: dict[str, Any]) -> None:
    builder = GltfBuilder()
    builder.drawn(builder.triangle())
    builder.add("nodes", camera=builder.add("cameras", **camera))
    with pytest.raises(InputError, match=r"cameras\[0\]"):
        built(builder)


def test_camera_files(tmp_path: Path) -> None:
    path = tmp_path / "cameras.json"
    path.write_text(json.dumps([{"name": "a", "eye": [0, 1, 2], "target": [3, 4, 5], "fov": 45}]))
    (camera,) = read_cameras(path)
    assert (camera.name, camera.eye, camera.target, camera.fov_degrees) == ("a", (0, 1, 2), (3, 4, 5), 45)
    assert find_camera((camera,), "a") is camera
    with pytest.raises(InputError, match="there are: a"):
        find_camera((camera,), "b")
    with pytest.raises(InputError, match="cannot be read"):
        read_cameras(tmp_path / "none.json")


GOOD = {"name": "a", "eye": [0, 0, 0], "target": [0, 0, 1], "fov": 60}


CHANGES: list[dict[str, Any]] = [
    {"name": 3},
    *({"eye": eye} for eye in ([0, 0], [0, 0, "x"], [0, 0, 1])),
    {"target": [0, 0, float("nan")]},
    *({"fov": fov} for fov in (0, 180, True)),
]
BROKEN = [*([{**GOOD, **change}] for change in CHANGES), [GOOD, GOOD], [{"name": "a", "eye": [0, 0, 0]}], [], {}, [1]]


@pytest.mark.parametrize("content", ["{", *map(json.dumps, BROKEN)])
def test_broken_camera_files(tmp_path: Path, content: str) -> None:
    path = tmp_path / "cameras.json"
    path.write_text(content)
    with pytest.raises(InputError, match=r"cameras\.json"):
        read_cameras(path)


@pytest.fixture(scope="module")
def floor(tmp_path_factory: pytest.TempPathFactory) -> Scene:
    """One triangle at height 0."""
    builder = GltfBuilder()
    drawn = builder.drawn(builder.triangle(builder.material(builder.image(png(noise())))))
    return load_scene(drawn.write(tmp_path_factory.mktemp("floor") / "floor.glb"))


def test_points_lie_on_the_surfaces_and_all_over_them(floor: Scene) -> None:
    points = SurfaceSamples(floor).points
    assert len(points) == SAMPLES
    ends = [points.min(axis=0), points.max(axis=0)]
    np.testing.assert_allclose(ends, floor.bounds, atol=0.02 * float(np.ptp(floor.bounds)))
    np.testing.assert_array_equal(points, SurfaceSamples(floor).points)


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
