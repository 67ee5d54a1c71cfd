"""Scenes that move: the GPU's vertices are those of the float64 twin, and pictures those of a scene read at that moment."""

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.gl.render.test_without_compute import without_compute
from tests.support.gltf_builder import GltfBuilder, noise, png
from viewer.gl.context import GraphicsContext
from viewer.render.passes.pose_vertices import VertexMover
from viewer.render.renderer import Renderer
from viewer.render.resources.pack_buffers import scene_programs
from viewer.render.resources.scene_buffers import SceneBuffers
from viewer.scene.gltf.container import parse_gltf
from viewer.scene.gltf.geometry import unit_normals, unit_tangents
from viewer.scene.load import build_scene
from viewer.scene.model import Camera, Pose, Scene
from viewer.scene.moving import Deformation, Influences, MorphTarget, MovingVertices, VertexFrames
from viewer.state.view_state import ViewState

CAMERA = Camera("front", (0.5, 1.0, 6.0), (0.5, 1.0, 0.0), fov_degrees=45.0)
SIZE = (96, 64)
SECONDS = (0.0, 0.4, 1.0, 3.0)
SIDE = 9


def column() -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.uint16]]:
    """Positions, UVs and indices of a sheet of SIDE x SIDE vertices, 1 wide and 2 high."""
    v, u = np.mgrid[0:SIDE, 0:SIDE] / (SIDE - 1.0)
    positions = np.stack([u, 2.0 * v, np.zeros_like(u)], axis=-1).reshape(-1, 3).astype(np.float32)
    corner = (np.arange(SIDE - 1)[:, None] * SIDE + np.arange(SIDE - 1)).reshape(-1)
    triangles = np.stack([corner, corner + 1, corner + SIDE + 1, corner, corner + SIDE + 1, corner + SIDE], axis=1)
    return positions, np.stack([u, 1.0 - v], axis=-1).reshape(-1, 2).astype(np.float32), triangles.astype(np.uint16)


def moving_scene(pose: Pose | None = None) -> Scene:
    """A skinned sheet, a morphing one and a turning one, animated together."""
    builder = GltfBuilder()
    positions, uvs, triangles = column()
    normals = np.tile(np.array([[0.0, 0.0, 1.0]], np.float32), (len(positions), 1))
    image = builder.add("images", bufferView=builder.view(png(noise(16, 16))), mimeType="image/png")
    builder.add("textures", source=image)
    builder.add("materials", pbrMetallicRoughness={"baseColorTexture": {"index": 0}}, doubleSided=True)
    attributes: dict[str, Any] = {
        "POSITION": builder.accessor(positions),
        "TEXCOORD_0": builder.accessor(uvs),
        "NORMAL": builder.accessor(normals),
    }
    indices = builder.accessor(triangles.reshape(-1))
    share = np.clip(positions[:, 1] / 2.0, 0.0, 1.0)
    weights = np.zeros((len(positions), 4), np.float32)
    weights[:, 0], weights[:, 1] = 1.0 - share, 3.0 * share
    joints = np.zeros((len(positions), 4), np.uint8)
    joints[:, 1] = 1
    skinned = {**attributes, "JOINTS_0": builder.accessor(joints), "WEIGHTS_0": builder.accessor(weights)}
    bulge = np.zeros_like(positions)
    bulge[:, 2] = np.sin(np.pi * positions[:, 0])
    slope = np.zeros_like(positions)
    slope[:, 0] = -np.cos(np.pi * positions[:, 0])
    targets = [{"POSITION": builder.accessor(bulge), "NORMAL": builder.accessor(slope)}]
    for own, more in ((skinned, {}), (attributes, {"targets": targets}), (attributes, {})):
        primitive = {"attributes": own, "indices": indices, "material": 0, **more}
        builder.add("meshes", primitives=[primitive])
    builder.add("nodes", mesh=0, skin=0)
    builder.add("nodes", mesh=1, translation=[1.5, 0.0, 0.0])
    builder.add("nodes", mesh=2, translation=[-1.5, 0.0, 0.0])
    builder.add("nodes", children=[4])
    builder.add("nodes", translation=[0.0, 1.0, 0.0])
    inverse = np.tile(np.eye(4, dtype=np.float32), (2, 1, 1))
    inverse[1, 1, 3] = -1.0
    builder.add(
        "skins", joints=[3, 4], inverseBindMatrices=builder.accessor(inverse.transpose(0, 2, 1).reshape(-1, 16))
    )
    times = builder.accessor(np.array([0.0, 1.0, 2.0], np.float32))
    turn = np.array([[0, 0, 0, 1], [0, 0, 0.38268343, 0.92387953], [0.38268343, 0, 0, 0.92387953]], np.float32)
    samplers, channels = [], []
    values = {
        (4, "rotation"): turn,
        (2, "rotation"): turn[:, [2, 0, 1, 3]],
        (1, "weights"): np.array([0.0, 1.0, -0.5], np.float32),
    }
    for number, ((node, path), keys) in enumerate(values.items()):
        samplers.append({"input": times, "output": builder.accessor(keys)})
        channels.append({"sampler": number, "target": {"node": node, "path": path}})
    builder.add("animations", name="move", samplers=samplers, channels=channels)
    return build_scene(parse_gltf(builder.glb(), "moving.glb", None), "moving", None, pose=pose)


def shown(renderer: Renderer, pose: Pose | None) -> NDArray[np.int64]:
    image = renderer.render(ViewState(CAMERA, SIZE, pose=pose), whole=True).image
    return np.frombuffer(image.read(), np.uint8).reshape(SIZE[1], SIZE[0], -1).astype(np.int64)


@pytest.mark.parametrize("computes", [True, False])
def test_a_view_in_a_pose_is_that_of_a_scene_read_in_it(graphics: GraphicsContext, computes: bool) -> None:
    moving = Renderer(graphics if computes else without_compute(graphics), moving_scene())
    pictures = []
    for seconds in (*SECONDS, None):
        pose = None if seconds is None else Pose("move", seconds)
        read = Renderer(graphics, moving_scene(pose))
        expected, found = shown(read, None), shown(moving, pose)
        assert (np.abs(found - expected).max(axis=-1) <= 1).mean() >= 0.999
        assert expected.std() > 10.0
        pictures.append(expected)
        read.release()
    assert len({picture.tobytes() for picture in pictures}) == 4, "the first stands as the nodes do"
    moving.release()


def test_what_stands_still_is_skipped(graphics: GraphicsContext) -> None:
    renderer = Renderer(graphics, moving_scene())
    view = ViewState(CAMERA, SIZE, pose=Pose("move", 0.5))
    assert "pose" in renderer.render(view).timings_ms
    again = renderer.render(view)
    assert again.timings_ms == {}
    assert again.skipped["passes"] > 0
    renderer.release()


def hostile(seed: int, vertices: int, joints: int, influences: int, targets: int) -> tuple[MovingVertices, Deformation]:
    """Random vertices; some joints are singular, mirrored, huge or shrink to a point, some weights 0."""
    random = np.random.default_rng(seed)

    def vectors(columns: int = 3) -> NDArray[np.float32]:
        return random.normal(size=(vertices, columns)).astype(np.float32)

    tangents = vectors(4)
    tangents[:, 3] = random.choice([-1.0, 1.0], vertices)
    found = tuple(
        MorphTarget(vectors(), vectors() if k % 2 else None, vectors() if k % 3 else None) for k in range(targets)
    )
    weights = random.random((vertices, influences)) * (random.random((vertices, influences)) < 0.7)
    weights[:, 0] += weights.sum(axis=1) == 0.0
    weights /= weights.sum(axis=1, keepdims=True)
    own = Influences(random.integers(0, joints, weights.shape), weights) if joints else None
    matrices = np.tile(np.eye(4), (max(1, joints), 1, 1))
    matrices[:, :3] = random.normal(size=(len(matrices), 3, 4))
    if joints > 1:
        matrices[0, :3, :3] = 0.0
        matrices[joints // 2, 0, :3] = matrices[joints // 2, 1, :3]
        matrices[-1, :3] *= 1e4
    part = MovingVertices(0, 3, VertexFrames(vectors(), vectors(), tangents), found, own)
    return part, Deformation(0, matrices if joints else None, tuple(random.normal(size=targets).tolist()))


@pytest.mark.computes
@pytest.mark.parametrize(
    ("joints", "influences", "targets"), [(0, 4, 3), (1, 4, 0), (7, 4, 0), (40, 8, 2), (200, 16, 5)]
)
def test_vertices_are_those_of_the_twin(graphics: GraphicsContext, joints: int, influences: int, targets: int) -> None:
    count = 333
    part, deformation = hostile(joints + targets, count, joints, influences, targets)
    scene = moving_scene()
    geometry = scene.geometry
    assert geometry.normals is not None
    wide = 3 + count + 2
    geometry = type(geometry)(
        np.full((wide, 3), 7.0, np.float32),
        np.full((wide, 2), 5.0, np.float32),
        None,
        geometry.indices,
        np.full((wide, 3), 6.0, np.float32),
        np.full((wide, 4), 4.0, np.float32),
    )
    changed = Scene(**{**scene.__dict__, "geometry": geometry})
    buffers = SceneBuffers(graphics, changed)
    poser = VertexMover(graphics, scene_programs(graphics), buffers, [part])
    poser.run({0: deformation})
    vertices, normals, tangents = (
        np.frombuffer(buffer.read(), np.float32)[: wide * columns].reshape(wide, columns)
        for buffer, columns in zip(buffers.moving_buffers(), (5, 3, 4), strict=True)
    )
    expected = part.at(deformation)
    assert expected.normals is not None
    assert expected.tangents is not None
    moved = slice(3, 3 + count)
    scale = 1.0 + np.abs(expected.positions).max()
    np.testing.assert_allclose(vertices[moved, :3], expected.positions, atol=2e-6 * scale)
    np.testing.assert_array_equal(vertices[:, 3:], 5.0)
    for found, all_of, length in (
        (normals, unit_normals(expected.normals)[0], np.linalg.norm(expected.normals, axis=1)),
        (tangents, unit_tangents(expected.tangents)[0], np.linalg.norm(expected.tangents[:, :3], axis=1)),
    ):
        # What is nearly of no length has no direction that rounding leaves alone.
        sure = length > 1e-3 * max(1.0, float(np.median(length)))
        assert sure.mean() > 0.5
        np.testing.assert_allclose(found[moved][sure], all_of[sure], atol=2e-3)
        assert np.isfinite(found).all()
    for outside in (slice(0, 3), slice(3 + count, None)):
        np.testing.assert_array_equal(vertices[outside, :3], 7.0)
        np.testing.assert_array_equal(normals[outside], 6.0)
        np.testing.assert_array_equal(tangents[outside], 4.0)
    low, high = part.box(deformation)
    assert (expected.positions >= low).all()
    assert (expected.positions <= high).all()
    poser.release()
    buffers.release()


def test_bounds_hold_what_moves() -> None:
    scene = moving_scene()
    assert scene.motion is not None
    for seconds in SECONDS:
        stand, read = scene.motion.at(Pose("", seconds)), moving_scene(Pose("", seconds))
        np.testing.assert_allclose(stand.instances.transform, read.instances.transform, atol=1e-6)
        assert (stand.bounds[0] <= read.bounds[0] + 1e-5).all()
        assert (stand.bounds[1] >= read.bounds[1] - 1e-5).all()
