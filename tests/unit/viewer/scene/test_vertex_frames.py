"""Normals and tangents of vertices: unit, zero where there is no direction, from every kind of accessor."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.support.gltf_builder import TRIANGLE, GltfBuilder, noise, png
from tests.support.scenes import built
from viewer.scene.gltf.vertex_frames import unit_normals, unit_tangents
from viewer.scene.load import load_scene
from viewer.scene.model import Scene

UP = np.tile(np.array([0, 0, 1], np.float32), (3, 1))
ALONG = np.tile(np.array([1, 0, 0, -1], np.float32), (3, 1))


def scene_with(attributes: dict[str, NDArray[Any]], edit: dict[str, Any] | None = None, bumpy: bool = True) -> Scene:
    """A triangle with `attributes`; `edit` changes the entry of the last accessor."""
    builder = GltfBuilder()
    image = builder.image(png(noise()))
    maps: dict[str, Any] = {"normalTexture": {"index": builder.add("textures", source=image)}} if bumpy else {}
    primitive = builder.triangle(builder.material(**maps), **attributes)
    builder.json["accessors"][-1].update(edit or {})
    return built(builder.drawn(primitive))


def test_unit_vectors_are_kept_as_they_are() -> None:
    scene = scene_with({"NORMAL": UP, "TANGENT": ALONG})
    assert scene.geometry.normals is not None
    assert scene.geometry.tangents is not None
    np.testing.assert_array_equal(scene.geometry.normals, UP)
    np.testing.assert_array_equal(scene.geometry.tangents, ALONG)
    assert {"vertex normals: primitives", "vertex tangents: primitives"} <= set(scene.report.honoured)
    assert scene.report.missing == ()


def test_scenes_without_normals_have_none_and_tangents_need_a_normal_map() -> None:
    plain = scene_with({}, bumpy=False)
    assert (plain.geometry.normals, plain.geometry.tangents, plain.geometry.second_uvs) == (None, None, None)
    flat = scene_with({"NORMAL": UP, "TANGENT": ALONG}, bumpy=False)
    assert flat.geometry.normals is not None
    assert flat.geometry.tangents is None


def test_vectors_without_a_direction_become_zero() -> None:
    largest = np.finfo(np.float32).max
    normals = np.array([[0, 0, 0], [np.nan, 0, 1], [0, largest, largest]], np.float32)
    unit, broken = unit_normals(normals)
    np.testing.assert_allclose(unit, [[0, 0, 0], [0, 0, 0], [0, np.sqrt(0.5), np.sqrt(0.5)]], atol=1e-6)
    assert broken == 2
    tangents = np.array([[0, 0, 0, 1], [2, 0, 0, -0.5], [1, 0, 0, np.inf], [1, 0, 0, 0]], np.float32)
    whole, broken = unit_tangents(tangents)
    np.testing.assert_array_equal(whole, [[0, 0, 0, 0], [1, 0, 0, -1], [0, 0, 0, 0], [0, 0, 0, 0]])
    assert broken == 3
    scene = scene_with({"NORMAL": normals, "TANGENT": tangents[:3]})
    assert any("normals without a direction in 2 vertices" in line for line in scene.report.missing)
    assert any("tangents without a direction in 2 vertices" in line for line in scene.report.missing)
    assert scene.geometry.normals is not None
    assert np.isfinite(scene.geometry.normals).all()


def test_quantised_normals_and_tangents() -> None:
    tangents = np.array([[127, 0, 0, 127], [0, -127, 0, -127], [90, 90, 0, 127]], np.int8)
    scene = scene_with({"NORMAL": UP, "TANGENT": tangents}, {"normalized": True})
    half = np.sqrt(0.5)
    expected = [[1, 0, 0, 1], [0, -1, 0, -1], [half, half, 0, 1]]
    assert scene.geometry.tangents is not None
    np.testing.assert_allclose(scene.geometry.tangents, expected, atol=1e-6)


def test_sparse_normals() -> None:
    builder = GltfBuilder()
    primitive = builder.triangle(None, NORMAL=UP)
    sparse = {
        "count": 1,
        "indices": {"bufferView": builder.view(np.array([1], np.uint16).tobytes()), "componentType": 5123},
        "values": {"bufferView": builder.view(np.array([0, 2, 0], np.float32).tobytes())},
    }
    builder.json["accessors"][primitive["attributes"]["NORMAL"]]["sparse"] = sparse
    normals = built(builder.drawn(primitive)).geometry.normals
    assert normals is not None
    np.testing.assert_array_equal(normals, [[0, 0, 1], [0, 1, 0], [0, 0, 1]])


@pytest.mark.parametrize(
    ("name", "values", "instead"),
    [
        ("NORMAL", UP[:2], "has 2 elements for 3 positions [the triangles' own are used]"),
        ("NORMAL", ALONG, "is needed"),
        ("TANGENT", UP, "[they follow from the UVs]"),
    ],
)
def test_frames_that_cannot_be_read_are_reported_and_the_rest_is_shown(
    name: str, values: NDArray[Any], instead: str
) -> None:
    scene = scene_with({name: values})
    assert scene.geometry.normals is None
    assert scene.geometry.tangents is None
    assert any(instead in line for line in scene.report.missing)


def test_primitives_without_normals_have_zeros_among_those_that_have() -> None:
    builder = GltfBuilder()
    plain, bent = builder.triangle(), builder.triangle(None, NORMAL=UP)
    normals = built(builder.drawn(plain, bent)).geometry.normals
    assert normals is not None
    np.testing.assert_array_equal(normals, np.concatenate([np.zeros((3, 3)), UP]))


def test_the_same_vertices_with_and_without_tangents_are_two_ranges() -> None:
    builder = GltfBuilder()
    info = {"index": builder.add("textures", source=builder.image(png(noise())))}
    primitive = builder.triangle(builder.material(normalTexture=info), NORMAL=UP, TANGENT=ALONG)
    smooth = {**primitive, "material": builder.material()}
    scene = built(builder.drawn(primitive, smooth, {**primitive}))
    assert [each.base_vertex for each in scene.primitives] == [0, 3, 0]
    assert scene.geometry.tangents is not None
    assert len(scene.geometry.positions) == 6


def test_draco_gives_the_normals_and_tangents_of_the_plain_file(data_folder: Path) -> None:
    scenes = [load_scene(data_folder / f"scenes/lantern/{kind}/Lantern.gltf") for kind in ("glTF", "glTF-Draco")]
    for name in ("normals", "tangents"):
        means = [np.abs(getattr(scene.geometry, name)).mean(axis=0) for scene in scenes]
        np.testing.assert_allclose(means[0], means[1], atol=5e-3)


def test_other_formats_keep_their_normals(tmp_path: Path) -> None:
    path = tmp_path / "a.obj"
    corners = "".join(f"v {x:g} {y:g} {z:g}\n" for x, y, z in TRIANGLE)
    path.write_text(corners + "vn 0 1 0\nvn 0 1 0\nvn 0 1 0\nf 1//1 2//2 3//3\n")
    normals = load_scene(path).geometry.normals
    assert normals is not None
    np.testing.assert_allclose(normals, np.tile([0, 1, 0], (3, 1)), atol=1e-6)
