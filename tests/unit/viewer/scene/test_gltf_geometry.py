"""Primitives, nodes and instances: triangles in the right place, with the right UVs and colours."""

import io
import math
from pathlib import Path

import numpy as np
import pytest
import trimesh

from ntc.errors import InputError
from tests.support.gltf_builder import TRIANGLE, TRIANGLE_UVS, GltfBuilder, noise, png
from tests.support.scenes import built, sorted_triangles, world_triangles
from viewer.scene.gltf.geometry import TRIANGLE_FAN, TRIANGLE_STRIP, TRIANGLES, triangle_list
from viewer.scene.load import load_scene


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


@pytest.mark.parametrize("name", ["lantern/glTF/Lantern.gltf", "polyhaven_props/tea_set_posed.gltf"])
def test_real_scenes_agree_with_trimesh(data_folder: Path, name: str) -> None:
    path = data_folder / "scenes" / name
    scene = load_scene(path)
    mesh = trimesh.load_scene(path, process=False, skip_materials=True).to_geometry()
    assert isinstance(mesh, trimesh.Trimesh)
    other = mesh.triangles
    ours = world_triangles(scene)
    assert len(ours) == len(other)
    centers, expected = np.sort(ours.mean(axis=1), axis=0), np.sort(np.asarray(other).mean(axis=1), axis=0)
    np.testing.assert_allclose(centers, expected, atol=1e-3)


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


def test_equal_attributes_are_stored_once() -> None:
    builder = GltfBuilder()
    primitive = builder.triangle(builder.material(pbr={"baseColorFactor": [1, 0, 0, 1]}))
    scene = built(builder.drawn(primitive, {**primitive, "material": builder.material()}))
    assert len(scene.primitives) == 2
    assert len(scene.geometry.positions) == 3
    assert len(scene.geometry.indices) == 3


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
