"""Accessors, primitives, nodes and frames of vertices: triangles in the right place, with the right UVs, colours and normals."""

import io
import math
import tracemalloc
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from numpy.typing import NDArray

from ntc.errors import InputError
from tests.support.gltf_builder import TRIANGLE, TRIANGLE_UVS, GltfBuilder, noise, png
from tests.support.scenes import built, sorted_triangles, world_triangles
from viewer.scene.gltf.buffers import Accessors, Buffers
from viewer.scene.gltf.container import parse_gltf
from viewer.scene.gltf.geometry import (
    SHORT_INDICES,
    TRIANGLE_FAN,
    TRIANGLE_STRIP,
    TRIANGLES,
    joined_indices,
    triangle_list,
    unit_normals,
    unit_tangents,
)
from viewer.scene.load import load_scene
from viewer.scene.model import Scene


def accessors(builder: GltfBuilder) -> Accessors:
    file = parse_gltf(builder.glb(), "test.glb", None)
    return Accessors(file, Buffers(file))


@pytest.mark.parametrize("dtype", ["int8", "uint8", "int16", "uint16", "uint32", "float32"])
@pytest.mark.parametrize(("stride", "offset"), [(0, 0), (24, 0), (0, 8), (32, 4)])
def test_every_component_type_stride_and_offset(dtype: str, stride: int, offset: int) -> None:
    values = np.arange(15).reshape(5, 3).astype(dtype)
    builder = GltfBuilder()
    index = builder.accessor(values, stride=stride, offset=offset)
    read = accessors(builder).raw(index, "test", ("VEC3",))
    assert read.dtype == values.dtype
    np.testing.assert_array_equal(read, values)


@pytest.mark.parametrize(
    ("dtype", "stored", "expected"),
    [
        ("uint8", [0, 51, 255], [0.0, 0.2, 1.0]),
        ("int8", [-128, -127, 127], [-1.0, -1.0, 1.0]),
        ("uint16", [0, 13107, 65535], [0.0, 0.2, 1.0]),
        ("int16", [-32768, 0, 32767], [-1.0, 0.0, 1.0]),
    ],
)
def test_normalised_integers(dtype: str, stored: list[int], expected: list[float]) -> None:
    builder = GltfBuilder()
    index = builder.accessor(np.array(stored, dtype), normalized=True)
    plain = builder.accessor(np.array(stored, dtype))
    reader = accessors(builder)
    np.testing.assert_allclose(reader.floats(index, "test", ("SCALAR",))[:, 0], expected, atol=1e-6)
    np.testing.assert_array_equal(reader.floats(plain, "test", ("SCALAR",))[:, 0], stored)


@pytest.mark.parametrize("with_base", [True, False])
def test_sparse(with_base: bool) -> None:
    base = np.arange(12, dtype=np.float32).reshape(4, 3)
    builder = GltfBuilder()
    index = builder.accessor(base)
    sparse = {
        "count": 2,
        "indices": {"bufferView": builder.view(np.array([1, 3], np.uint16).tobytes()), "componentType": 5123},
        "values": {"bufferView": builder.view(np.array([[7, 8, 9], [4, 5, 6]], np.float32).tobytes())},
    }
    builder.json["accessors"][index]["sparse"] = sparse
    if not with_base:
        del builder.json["accessors"][index]["bufferView"]
    expected = base.copy() if with_base else np.zeros_like(base)
    expected[[1, 3]] = [[7, 8, 9], [4, 5, 6]]
    np.testing.assert_array_equal(accessors(builder).raw(index, "test", ("VEC3",)), expected)


def test_padded_matrix_columns() -> None:
    builder = GltfBuilder()
    columns = np.array([[1, 2, 3, 99], [4, 5, 6, 99], [7, 8, 9, 99]], np.uint8)
    view = builder.view(columns.tobytes())
    index = builder.add("accessors", bufferView=view, componentType=5121, count=1, type="MAT3")
    none = builder.add("accessors", bufferView=view, componentType=5121, count=0, type="MAT3")
    np.testing.assert_array_equal(accessors(builder).raw(index, "test", ("MAT3",)), [[1, 2, 3, 4, 5, 6, 7, 8, 9]])
    assert accessors(builder).raw(none, "test", ("MAT3",)).shape == (0, 9)


@pytest.mark.parametrize(
    "change",
    [
        *({"count": value} for value in (4, 10**12, -1, 1.5)),
        *({"byteOffset": value} for value in (1, 2**60)),
        *({"bufferView": value} for value in (9, -1)),
        {"componentType": 5124},
        *({"type": value} for value in ("VEC4", 3)),
    ],
)
def test_out_of_range_is_an_input_error(change: dict[str, object]) -> None:
    builder = GltfBuilder()
    index = builder.accessor(TRIANGLE)
    builder.json["accessors"][index].update(change)
    with pytest.raises(InputError, match=r"test\.glb"):
        accessors(builder).raw(index, "test", ("VEC3",))


def test_sparse_index_out_of_range() -> None:
    builder = GltfBuilder()
    index = builder.accessor(TRIANGLE)
    builder.json["accessors"][index]["sparse"] = {
        "count": 1,
        "indices": {"bufferView": builder.view(b"\x03"), "componentType": 5121},
        "values": {"bufferView": builder.view(bytes(12))},
    }
    with pytest.raises(InputError, match="3 in an accessor of 3"):
        accessors(builder).raw(index, "test", ("VEC3",))


def grid_builder() -> GltfBuilder:
    """A three-level node tree with TRS and matrices, and one mesh placed four times, once mirrored."""
    rng = np.random.default_rng(1)
    builder = GltfBuilder()
    position = builder.accessor(rng.normal(size=(9, 3)).astype(np.float32), min=[-9.0, -9.0, -9.0], max=[9.0, 9.0, 9.0])
    index = builder.accessor(rng.permutation(9).astype(np.uint16))
    mesh = builder.mesh({"attributes": {"POSITION": position}, "indices": index})
    turn = [0.0, math.sin(0.4), 0.0, math.cos(0.4)]
    builder.add("nodes", name="root", translation=[1.0, 2.0, 3.0], rotation=turn, children=[1, 2])
    builder.add("nodes", mesh=mesh, scale=[2.0, 1.0, -1.0], children=[3])
    matrix = np.eye(4)
    matrix[:3] = [[0, -1, 0, 5], [1, 0, 0, 6], [0, 0, 1, 7]]
    builder.add("nodes", mesh=mesh, matrix=[float(value) for value in matrix.T.reshape(-1)])
    builder.add("nodes", mesh=mesh, rotation=[0.5, 0.5, 0.5, 0.5], translation=[0.0, 1.0, 0.0])
    builder.add("nodes", mesh=mesh)
    builder.add("scenes", nodes=[0, 4])
    builder.json["scene"] = 0
    return builder


def test_world_positions_agree_with_trimesh() -> None:
    builder = grid_builder()
    scene = built(builder)
    other = trimesh.load_scene(io.BytesIO(builder.glb()), file_type="glb", process=False)
    mesh = other.to_geometry()
    assert isinstance(mesh, trimesh.Trimesh)
    expected = mesh.triangles
    ours, theirs = sorted_triangles(world_triangles(scene)), sorted_triangles(np.asarray(expected))
    np.testing.assert_allclose(ours, theirs, atol=1e-3)
    assert len(scene.primitives) == 1
    assert len(scene.geometry.positions) == 9
    assert list(scene.instances.node) == [1, 3, 2, 4]
    points = world_triangles(scene).reshape(-1, 3)
    np.testing.assert_allclose(scene.bounds, [points.min(axis=0), points.max(axis=0)], atol=1e-4)
    assert any("negative determinant" in line for line in scene.report.honoured)


def test_triangle_modes() -> None:
    indices = np.arange(5, dtype=np.uint32)
    assert triangle_list(indices, TRIANGLES).tolist() == [0, 1, 2]
    assert triangle_list(indices, TRIANGLE_STRIP).reshape(-1, 3).tolist() == [[0, 1, 2], [1, 3, 2], [2, 3, 4]]
    assert triangle_list(indices, TRIANGLE_FAN).reshape(-1, 3).tolist() == [[1, 2, 0], [2, 3, 0], [3, 4, 0]]
    joined = np.array([0, 1, 2, 2, 3, 3, 4, 5], np.uint32)
    assert triangle_list(joined, TRIANGLE_STRIP).reshape(-1, 3).tolist() == [[0, 1, 2], [3, 5, 4]]
    for mode in (TRIANGLES, TRIANGLE_STRIP, TRIANGLE_FAN):
        assert len(triangle_list(indices[:2], mode)) == 0


@pytest.mark.parametrize("indexed", [True, False])
@pytest.mark.parametrize("mode", [4, 5, 6])
def test_strips_fans_and_lists_load(mode: int, indexed: bool) -> None:
    corners = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [2, 2, 0], [3, 2, 0]], np.float32)
    builder = GltfBuilder()
    primitive = {"attributes": {"POSITION": builder.accessor(corners)}, "mode": mode}
    if indexed:
        primitive["indices"] = builder.accessor(np.arange(6, dtype=np.uint8))
    scene = built(builder.drawn(primitive))
    assert scene.primitives[0].index_count == {4: 6, 5: 12, 6: 12}[mode]
    expected = corners[triangle_list(np.arange(6, dtype=np.uint32), mode)].reshape(-1, 3, 3)
    np.testing.assert_array_equal(world_triangles(scene), expected)


def test_points_and_lines_are_reported_and_left_out() -> None:
    builder = GltfBuilder()
    lines = {**builder.triangle(), "mode": 1}
    scene = built(builder.drawn(lines, builder.triangle()))
    assert len(scene.primitives) == 1
    assert "primitives of lines" in scene.report.ignored
    only_lines = GltfBuilder()
    with pytest.raises(InputError, match="no triangles"):
        built(only_lines.drawn({**only_lines.triangle(), "mode": 0}))


def test_second_uv_set_and_texture_transform_are_baked() -> None:
    builder = GltfBuilder()
    image = builder.image(png(noise()))
    transform = {"offset": [0.5, 0.25], "rotation": math.pi / 2, "scale": [2.0, 3.0]}
    first = builder.material(image)
    second = builder.material(
        image, info={"texCoord": 0, "extensions": {"KHR_texture_transform": {**transform, "texCoord": 1}}}
    )
    other = np.array([[0, 0], [1, 0], [0, 1]], np.float32) + 10
    primitive = builder.triangle(first, TEXCOORD_1=other)
    scene = built(builder.drawn(primitive, {**primitive, "material": second}))
    ranges = [slice(p.base_vertex, p.base_vertex + p.vertex_count) for p in scene.primitives]
    np.testing.assert_array_equal(scene.geometry.uvs[ranges[0]], TRIANGLE_UVS)
    # A quarter turn takes (u, v) to (v, -u), after the scale.
    expected = np.stack([other[:, 1] * 3 + 0.5, -other[:, 0] * 2 + 0.25], axis=1)
    np.testing.assert_allclose(scene.geometry.uvs[ranges[1]], expected, atol=1e-5)
    assert scene.primitives[0].first_index == scene.primitives[1].first_index
    assert len(scene.textures) == 1


def test_vertex_colours() -> None:
    builder = GltfBuilder()
    plain = builder.triangle()
    bytes3 = np.array([[255, 0, 0], [0, 255, 0], [0, 0, 51]], np.uint8)
    shorts4 = np.full((3, 4), 65535, np.uint16)
    scene = built(builder.drawn(plain, builder.triangle(COLOR_0=bytes3), builder.triangle(COLOR_0=shorts4)))
    colors = scene.geometry.colors
    assert colors is not None
    np.testing.assert_array_equal(colors[:3], 1.0)
    np.testing.assert_allclose(colors[3:6], np.array([[1, 0, 0, 1], [0, 1, 0, 1], [0, 0, 0.2, 1]]), atol=1e-6)
    np.testing.assert_array_equal(colors[6:], 1.0)
    single = GltfBuilder()
    assert built(single.drawn(single.triangle())).geometry.colors is None


def test_quantised_positions_and_uvs() -> None:
    builder = GltfBuilder()
    builder.json.update(extensionsUsed=["KHR_mesh_quantization"], extensionsRequired=["KHR_mesh_quantization"])
    primitive = builder.triangle()
    positions = np.array([[0, 0, 0], [100, 0, 0], [0, -100, 0]], np.int16)
    uvs = np.array([[0, 0], [65535, 0], [0, 65535]], np.uint16)
    primitive["attributes"]["POSITION"] = builder.accessor(positions, stride=8)
    primitive["attributes"]["TEXCOORD_0"] = builder.accessor(uvs, normalized=True)
    builder.add("nodes", mesh=builder.mesh(primitive), scale=[0.01, 0.01, 0.01])
    scene = built(builder)
    np.testing.assert_allclose(world_triangles(scene)[0], [[0, 0, 0], [1, 0, 0], [0, -1, 0]], atol=1e-6)
    np.testing.assert_allclose(scene.geometry.uvs, [[0, 0], [1, 0], [0, 1]])
    assert "KHR_mesh_quantization" in scene.report.honoured


def test_gpu_instancing() -> None:
    builder = GltfBuilder()
    builder.json["extensionsUsed"] = ["EXT_mesh_gpu_instancing"]
    moves = np.array([[0, 0, 0], [10, 0, 0]], np.float32)
    turns = np.array([[0, 0, 0, 127], [0, 0, 90, 90]], np.int8)
    attributes = {
        "TRANSLATION": builder.accessor(moves),
        "ROTATION": builder.accessor(turns, normalized=True),
        "SCALE": builder.accessor(np.full((2, 3), 2, np.float32)),
    }
    builder.add(
        "nodes",
        mesh=builder.mesh(builder.triangle()),
        translation=[0, 0, 5],
        extensions={"EXT_mesh_gpu_instancing": {"attributes": attributes}},
    )
    triangles = world_triangles(built(builder))
    np.testing.assert_allclose(triangles[0], TRIANGLE * 2 + [0, 0, 5], atol=1e-5)
    np.testing.assert_allclose(triangles[1], [[10, 0, 5], [10, 2, 5], [8, 0, 5]], atol=1e-2)


def test_draco_agrees_with_the_plain_file(data_folder: Path) -> None:
    plain = load_scene(data_folder / "scenes/lantern/glTF/Lantern.gltf")
    packed = load_scene(data_folder / "scenes/lantern/glTF-Draco/Lantern.gltf")
    assert plain.report.used["triangles"] == packed.report.used["triangles"]
    np.testing.assert_allclose(plain.bounds, packed.bounds, atol=0.05)
    areas = [
        np.linalg.norm(np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0]), axis=1).sum()
        for t in map(world_triangles, (plain, packed))
    ]
    assert areas[0] == pytest.approx(areas[1], rel=5e-3)
    assert packed.geometry.uvs.min() >= -0.01
    assert packed.geometry.uvs.max() <= 1.01
    for name in ("normals", "tangents"):
        means = [np.abs(getattr(scene.geometry, name)).mean(axis=0) for scene in (plain, packed)]
        np.testing.assert_allclose(means[0], means[1], atol=5e-3)


def test_broken_draco_is_an_input_error() -> None:
    builder = GltfBuilder()
    builder.json["extensionsRequired"] = ["KHR_draco_mesh_compression"]
    primitive = builder.triangle()
    packed = {"bufferView": builder.view(b"DRACO" + bytes(60)), "attributes": {"POSITION": 0}}
    primitive["extensions"] = {"KHR_draco_mesh_compression": packed}
    with pytest.raises(InputError, match="Draco data does not decode"):
        built(builder.drawn(primitive))


def test_hidden_nodes_and_those_below_them_are_not_drawn() -> None:
    builder = GltfBuilder()
    mesh = builder.mesh(builder.triangle())
    hidden = {"KHR_node_visibility": {"visible": False}}
    shown = {"KHR_node_visibility": {"visible": True}}
    camera = builder.add("cameras", type="perspective", perspective={"yfov": 1.0, "znear": 0.1})
    builder.json["extensions"] = {"KHR_lights_punctual": {"lights": [{"type": "point"}]}}
    light = {"KHR_lights_punctual": {"light": 0}}
    builder.add("nodes", mesh=mesh, extensions=hidden, children=[1], translation=[9, 0, 0])
    builder.add("nodes", mesh=mesh, extensions={**shown, **light}, camera=camera)
    builder.add("nodes", mesh=mesh, extensions=shown)
    builder.json["extensionsRequired"] = ["KHR_node_visibility", "KHR_animation_pointer"]
    scene = built(builder)
    np.testing.assert_array_equal(scene.instances.node, [2])
    assert not scene.lights
    assert len(scene.cameras) == 1
    assert any("KHR_animation_pointer" in line for line in scene.report.ignored)


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
    assert any("normals without a direction in 2 vertices" in line for line in scene.report.repaired)
    assert any("tangents without a direction in 2 vertices" in line for line in scene.report.repaired)
    assert scene.geometry.normals is not None
    assert np.isfinite(scene.geometry.normals).all()


def test_quantised_normals_and_tangents() -> None:
    tangents = np.array([[127, 0, 0, 127], [0, -127, 0, -127], [90, 90, 0, 127]], np.int8)
    scene = scene_with({"NORMAL": UP, "TANGENT": tangents}, {"normalized": True})
    half = np.sqrt(0.5)
    expected = [[1, 0, 0, 1], [0, -1, 0, -1], [half, half, 0, 1]]
    assert scene.geometry.tangents is not None
    np.testing.assert_allclose(scene.geometry.tangents, expected, atol=1e-6)


@pytest.mark.parametrize(
    ("name", "values", "instead"),
    [
        ("NORMAL", UP[:2], "has 2 elements for 3 positions [normals of triangles are used]"),
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
    assert any(instead in line for line in scene.report.repaired)


def test_the_same_vertices_with_and_without_tangents_are_two_ranges() -> None:
    builder = GltfBuilder()
    info = {"index": builder.add("textures", source=builder.image(png(noise())))}
    primitive = builder.triangle(builder.material(normalTexture=info), NORMAL=UP, TANGENT=ALONG)
    smooth = {**primitive, "material": builder.material()}
    scene = built(builder.drawn(primitive, smooth, {**primitive}))
    assert [each.base_vertex for each in scene.primitives] == [0, 3, 0]
    assert scene.geometry.tangents is not None
    assert len(scene.geometry.positions) == 6


@pytest.mark.parametrize(("highest", "kind"), [(SHORT_INDICES - 1, np.uint16), (SHORT_INDICES, np.uint32)])
def test_indices_take_two_bytes_where_they_fit(highest: int, kind: type[np.generic]) -> None:
    parts: list[NDArray[Any] | None] = [np.array([0, 1, 2], np.uint8), np.array([0, highest, 7], np.uint32), None]
    whole = joined_indices(parts, 6, highest)
    assert whole.dtype == kind
    assert whole.tolist() == [0, 1, 2, 0, highest, 7]
    assert parts == [None, None, None]


def test_a_large_scene_is_not_held_twice_over(tmp_path: Path) -> None:
    builder, parts = GltfBuilder(), []
    for number in range(60):
        rows = np.random.default_rng(number).normal(size=(4000, 3)).astype(np.float32)
        part = builder.triangle(POSITION=rows, TEXCOORD_0=rows[:, :2], NORMAL=np.tile(UP[:1], (4000, 1)))
        parts.append(part | {"indices": builder.accessor(np.arange(12_000, dtype=np.uint16) % np.uint16(4000))})
    builder.drawn(*parts)
    path = builder.write(tmp_path / "large.glb")
    del builder
    size = path.stat().st_size
    tracemalloc.start()
    try:
        scene = load_scene(path)
        left, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    # The file's bytes and the scene's arrays, which hold the same; then the arrays alone.
    assert peak < 2.3 * size
    assert left < 1.2 * size
    assert scene.geometry.positions.flags.owndata
