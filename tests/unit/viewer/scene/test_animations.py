"""Animations, skins and morph targets: key frames against scipy, vertices against matrices written out."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.interpolate import CubicHermiteSpline
from scipy.spatial.transform import Rotation, Slerp

from ntc.errors import InputError
from tests.support.gltf_builder import TRIANGLE, GltfBuilder
from tests.support.scenes import world_triangles
from viewer.scene.gltf.container import parse_gltf
from viewer.scene.gltf.motion.animations import AnimatedPath, Channel
from viewer.scene.gltf.schema import Interpolation
from viewer.scene.load import build_scene, load_scene
from viewer.scene.model import Pose, Scene

TIMES = np.array([0.5, 1.0, 3.0])
MOMENTS = np.linspace(0.5, 3.0, 41)


def channel(path: AnimatedPath, interpolation: Interpolation, values: NDArray[np.float64]) -> Channel:
    return Channel(0, path, interpolation, TIMES, values)


def test_positions_are_interpolated_along_lines() -> None:
    values = np.random.default_rng(0).normal(size=(3, 3))
    found = [channel("translation", "LINEAR", values).at(t) for t in MOMENTS]
    expected = [[np.interp(t, TIMES, values[:, axis]) for axis in range(3)] for t in MOMENTS]
    np.testing.assert_allclose(found, expected, atol=1e-12)


def test_rotations_are_interpolated_along_arcs() -> None:
    rotations = Rotation.random(3, random_state=1)
    # The other quaternion of the same rotation: the way round must still be the short one.
    values = rotations.as_quat() * np.array([[1.0], [-1.0], [1.0]])
    expected = Slerp(TIMES, rotations)(MOMENTS)
    found = Rotation.from_quat([channel("rotation", "LINEAR", values).at(t) for t in MOMENTS])
    np.testing.assert_allclose((found * expected.inv()).magnitude(), 0.0, atol=1e-7)


def test_splines_are_those_of_hermite() -> None:
    values = np.random.default_rng(2).normal(size=(3, 3, 3))
    # A tangent towards a key need not be the one from it: each span has its own.
    for after in (1, 2):
        span = slice(after - 1, after + 1)
        slopes = np.stack([values[after - 1, 2], values[after, 0]])
        spline = CubicHermiteSpline(TIMES[span], values[span, 1], slopes)
        for moment in np.linspace(TIMES[after - 1], TIMES[after], 9, endpoint=False):
            found = channel("scale", "CUBICSPLINE", values).at(float(moment))
            np.testing.assert_allclose(found, spline(moment), atol=1e-12)


@pytest.mark.parametrize("interpolation", ["LINEAR", "STEP"])
def test_outside_of_the_key_frames_the_ends_hold(interpolation: Interpolation) -> None:
    values = np.array([[1.0], [2.0], [4.0]])
    weights = channel("weights", interpolation, values)
    assert [weights.at(t)[0] for t in (-9.0, 0.5, 3.0, 9.0)] == [1.0, 1.0, 4.0, 4.0]
    assert weights.at(0.9)[0] == (1.0 if interpolation == "STEP" else pytest.approx(1.8))


def test_a_rotation_of_no_length_is_none() -> None:
    np.testing.assert_array_equal(channel("rotation", "LINEAR", np.zeros((3, 4))).at(1.0), [0.0, 0.0, 0.0, 1.0])


def animated(builder: GltfBuilder, node: int, path: str, values: NDArray[Any], **sampler: Any) -> None:
    """Add an animation "move" of one property over TIMES."""
    accessors = {"input": builder.accessor(TIMES.astype(np.float32)), "output": builder.accessor(values)}
    channels = [{"sampler": 0, "target": {"node": node, "path": path}}]
    builder.add("animations", name="move", samplers=[{**accessors, **sampler}], channels=channels)


def at(builder: GltfBuilder, seconds: float | None, animation: str = "") -> Scene:
    pose = None if seconds is None else Pose(animation, seconds)
    return build_scene(parse_gltf(builder.glb(), "a.glb", None), "a", None, pose=pose)


def moving_node() -> GltfBuilder:
    builder = GltfBuilder()
    mesh = builder.mesh(builder.triangle())
    builder.add("nodes", translation=[0, 0, 5], children=[1])
    builder.add("nodes", mesh=mesh)
    animated(builder, 0, "translation", np.array([[0, 0, 5], [2, 0, 5], [2, 4, 5]], np.float32))
    return builder


def test_a_node_moves_with_all_below_it() -> None:
    builder = moving_node()
    for seconds, offset in ((None, (0, 0, 5)), (0.75, (1, 0, 5)), (2.0, (2, 2, 5)), (9.0, (2, 4, 5))):
        scene = at(builder, seconds)
        np.testing.assert_allclose(world_triangles(scene)[0], TRIANGLE + offset, atol=1e-6)
        assert [(a.name, a.seconds) for a in scene.animations] == [("move", 3.0)]
    assert at(builder, 0.75).bounds[0, 0] == pytest.approx(1.0)


def test_an_animation_is_chosen_by_name(tmp_path: Path) -> None:
    builder = moving_node()
    builder.add("animations", name="rest", samplers=[], channels=[])
    path = builder.write(tmp_path / "a.glb")
    np.testing.assert_allclose(
        world_triangles(load_scene(path, pose=Pose("rest", 1.0)))[0], np.add(TRIANGLE, (0, 0, 5))
    )
    with pytest.raises(InputError, match="no animation 'walk'; there are move, rest"):
        load_scene(path, pose=Pose("walk", 1.0))
    with pytest.raises(InputError, match="has no animations"):
        at(GltfBuilder().drawn(), 1.0)


def skinned(inverse: NDArray[np.float32] | None = None) -> GltfBuilder:
    """A triangle whose first corner follows joint 0, the others both joints by halves; joint 1 is moved and turned."""
    builder = GltfBuilder()
    joints = np.array([[0, 0, 0, 0], [0, 1, 0, 0], [1, 0, 0, 0]], np.uint8)
    weights = np.array([[1, 0, 0, 0], [0.5, 0.5, 0, 0], [2, 2, 0, 0]], np.float32)
    normals = np.tile(np.array([[0, 0, 1]], np.float32), (3, 1))
    primitive = builder.triangle(JOINTS_0=joints, WEIGHTS_0=weights, NORMAL=normals)
    builder.add("nodes", mesh=builder.mesh(primitive), skin=0, translation=[100, 0, 0])
    builder.add("nodes", translation=[0, 1, 0])
    builder.add("nodes", rotation=[0, 0.70710678, 0, 0.70710678], translation=[3, 0, 0])
    skin: dict[str, Any] = {"joints": [1, 2]}
    if inverse is not None:
        skin["inverseBindMatrices"] = builder.accessor(inverse.transpose(0, 2, 1).reshape(-1, 16))
    builder.add("skins", **skin)
    return builder


def matrix(rotation: Rotation, translation: tuple[float, float, float]) -> NDArray[np.float64]:
    made = np.eye(4)
    made[:3, :3], made[:3, 3] = rotation.as_matrix(), translation
    return made


@pytest.mark.parametrize("bound", [False, True])
def test_a_skin_moves_vertices_by_its_joints_wherever_its_node_is(bound: bool) -> None:
    inverse = np.stack([matrix(Rotation.identity(), (0, 0, -2)), matrix(Rotation.identity(), (1, 1, 1))])
    scene = at(skinned(inverse.astype(np.float32) if bound else None), None)
    joints = np.stack(
        [matrix(Rotation.identity(), (0, 1, 0)), matrix(Rotation.from_rotvec([0, np.pi / 2, 0]), (3, 0, 0))]
    )
    joints = joints @ inverse if bound else joints
    mean = joints.mean(axis=0)
    by_vertex = np.stack([joints[0], mean, mean])
    corners = np.concatenate([TRIANGLE, np.ones((3, 1))], axis=1)
    expected = np.einsum("nij,nj->ni", by_vertex, corners)[:, :3]
    np.testing.assert_allclose(world_triangles(scene)[0], expected, atol=1e-5)
    assert scene.geometry.normals is not None
    np.testing.assert_allclose(scene.geometry.normals[0], [0, 0, 1], atol=1e-6)
    turned = np.linalg.inv(mean[:3, :3]).T @ [0, 0, 1]
    np.testing.assert_allclose(scene.geometry.normals[1], turned / np.linalg.norm(turned), atol=1e-5)


def test_two_nodes_with_one_mesh_and_different_skins_have_their_own_vertices() -> None:
    builder = skinned()
    builder.add("nodes", mesh=0, skin=1)
    builder.add("skins", joints=[2, 1])
    scene = at(builder, None)
    first, second = world_triangles(scene)
    assert not np.allclose(first, second)
    assert len(scene.geometry.positions) == 6


def morphing(**mesh: Any) -> GltfBuilder:
    builder = GltfBuilder()
    primitive = builder.triangle()
    wide, high = np.zeros((3, 3), np.float32), np.zeros((3, 3), np.float32)
    wide[:, 0], high[:, 1] = 1.0, 2.0
    primitive["targets"] = [{"POSITION": builder.accessor(wide)}, {"POSITION": builder.accessor(high)}]
    builder.add("nodes", mesh=builder.mesh(primitive, **mesh))
    return builder


@pytest.mark.parametrize(("owner", "weights"), [("mesh", [0.5, 0.25]), ("node", [1.0, 0.0]), ("none", [0.0, 0.0])])
def test_morph_targets_add_to_positions(owner: str, weights: list[float]) -> None:
    builder = morphing(**({"weights": weights} if owner == "mesh" else {}))
    if owner == "node":
        builder.json["nodes"][0]["weights"] = weights
    offset = (weights[0], 2.0 * weights[1], 0.0)
    np.testing.assert_allclose(world_triangles(at(builder, None))[0], TRIANGLE + offset, atol=1e-6)


@pytest.mark.parametrize("interpolation", ["LINEAR", "CUBICSPLINE"])
def test_weights_of_morph_targets_are_animated(interpolation: str) -> None:
    builder = morphing()
    keys = np.array([[0, 0], [1, 0], [1, 1]], np.float32)
    if interpolation == "CUBICSPLINE":
        flat = np.zeros((3, 3, 2), np.float32)
        flat[:, 1] = keys
        keys = flat
    animated(builder, 0, "weights", keys.reshape(-1), interpolation=interpolation)
    for seconds, offset in ((0.75, (0.5, 0.0, 0.0)), (2.0, (1.0, 1.0, 0.0))):
        np.testing.assert_allclose(world_triangles(at(builder, seconds))[0], TRIANGLE + offset, atol=1e-6)


def refusal(builder: GltfBuilder, words: str, seconds: float | None = 1.0) -> None:
    with pytest.raises(InputError, match=words) as caught:
        at(builder, seconds)
    assert "\n" not in str(caught.value)


def test_broken_animations_name_the_field() -> None:
    for change, words in (
        ({"input": 99}, r"animations\[0\]\.samplers\[0\]\.input"),
        ({"interpolation": "BOUNCE"}, "must be one of LINEAR, STEP, CUBICSPLINE"),
        ({"interpolation": "CUBICSPLINE"}, "has 3 elements for 3 key frames"),
    ):
        builder = moving_node()
        builder.json["animations"][0]["samplers"][0] |= change
        refusal(builder, words)
    backwards = moving_node()
    backwards.json["animations"][0]["samplers"][0]["input"] = backwards.accessor(TIMES[::-1].astype(np.float32).copy())
    refusal(backwards, "must be ascending times")
    lost = moving_node()
    lost.json["animations"][0]["channels"][0]["target"]["node"] = 7
    refusal(lost, "7 is not an index below 2")


def test_broken_skins_name_the_field() -> None:
    for change, words in (
        ({"joints": []}, r"skins\[0\]\.joints: must name a node"),
        ({"joints": [1, 9]}, "9 is not an index below 3"),
        ({"joints": [1]}, "names joint 1 of 1"),
    ):
        builder = skinned()
        builder.json["skins"][0] |= change
        refusal(builder, words, None)
    few = skinned()
    few.json["skins"][0]["inverseBindMatrices"] = few.accessor(np.eye(4, dtype=np.float32).reshape(1, 16))
    refusal(few, "has 1 matrices for 2 joints", None)
    bare = skinned()
    for name in ("JOINTS_0", "WEIGHTS_0"):
        bare.json["meshes"][0]["primitives"][0]["attributes"].pop(name)
    refusal(bare, "has a skin and no JOINTS_0", None)
    elsewhere = skinned()
    elsewhere.json["scenes"] = [{"nodes": [0, 1]}]
    refusal(elsewhere, "node 2 is not in the scene that is drawn", None)


@pytest.mark.parametrize("path", [["rotation"], {}, None, 3, "color"])
def test_what_is_no_property_of_a_node_is_left_out(path: Any) -> None:
    builder = moving_node()
    builder.json["animations"][0]["channels"][0]["target"]["path"] = path
    scene = at(builder, 1.0)
    assert any("animated properties" in line for line in scene.report.ignored)
    np.testing.assert_allclose(world_triangles(scene)[0], np.add(TRIANGLE, (0, 0, 5)))
