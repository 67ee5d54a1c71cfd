"""Morph targets and skinning on the GPU: writes the vertices of a pose into the scene's vertex buffers."""

from collections.abc import Mapping, Sequence
from enum import IntEnum
from typing import NamedTuple

import moderngl
import numpy as np
from numpy.typing import NDArray

from viewer.gl.context import GraphicsContext
from viewer.gl.program import ProgramFactory, set_uniforms
from viewer.render.pass_scheduler import RenderPass
from viewer.render.resources.clusters import Clusters
from viewer.render.resources.culling import Culling, PosedScene
from viewer.render.resources.scene_buffers import SceneBuffers
from viewer.scene.gltf.geometry import unit_normals, unit_tangents
from viewer.scene.model import Motion, Pose, Scene
from viewer.scene.moving import Deformation, MovingVertices

FOLDER = "passes/pose_vertices"
POSE_GROUP = 64
"""Number of vertices of a work group."""
REST_FLOATS = 10
"""Number of floats of a vertex at rest: position, normal, tangent with its sign."""
TARGET_FLOATS = 9
"""Number of floats of a vertex in a morph target: offsets of position, normal and tangent."""
JOINT_FLOATS = 12
"""Number of floats of a joint: the first three rows of its matrix."""


class PoseBinding(IntEnum):
    """Storage bindings of this program. It reads none of the usual buffers, so the numbers overlap."""

    REST = 0
    TARGETS = 1
    INFLUENCES = 2
    POSE = 3
    VERTICES = 4
    NORMALS = 5
    TANGENTS = 6


def pose_layout_glsl() -> str:
    """Return the include `generated/pose.glsl`."""
    lines = ["// Generated from viewer/render/passes/pose_vertices.py."]
    lines += [f"#define BINDING_{member.name} {member.value}" for member in PoseBinding]
    sizes = {"POSE_GROUP": POSE_GROUP, "REST_FLOATS": REST_FLOATS}
    sizes |= {"TARGET_FLOATS": TARGET_FLOATS, "JOINT_FLOATS": JOINT_FLOATS}
    return "\n".join(lines + [f"#define {name} {size}" for name, size in sizes.items()]) + "\n"


def pose_program(programs: ProgramFactory) -> moderngl.ComputeShader:
    """Return the program of the pass."""
    return programs.with_generated({"generated/pose.glsl": pose_layout_glsl()}).compute(f"{FOLDER}/pose.comp")


class _Uploaded(NamedTuple):
    """Buffers of the moving vertices of one primitive."""

    rest: moderngl.Buffer
    targets: moderngl.Buffer
    influences: moderngl.Buffer
    pose: moderngl.Buffer
    joints: int
    """Number of joints that fit into `pose`."""


def rest_floats(part: MovingVertices) -> NDArray[np.float32]:
    """Return the vertices at rest [V, REST_FLOATS]; absent attributes are 0."""
    frames, rows = part.frames, np.zeros((len(part.frames.positions), REST_FLOATS), np.float32)
    rows[:, :3] = frames.positions
    if frames.normals is not None:
        rows[:, 3:6] = frames.normals
    if frames.tangents is not None:
        rows[:, 6:] = frames.tangents
    return rows


def target_floats(part: MovingVertices) -> NDArray[np.float32]:
    """Return [targets, V, TARGET_FLOATS] offsets of the morph targets."""
    rows = np.zeros((len(part.targets), len(part.frames.positions), TARGET_FLOATS), np.float32)
    for row, target in zip(rows, part.targets, strict=True):
        for first, offsets in zip((0, 3, 6), (target.positions, target.normals, target.tangents), strict=True):
            if offsets is not None:
                row[:, first : first + 3] = offsets
    return rows


def influence_words(part: MovingVertices) -> NDArray[np.uint32]:
    """Return the influences of joints [V, influences, 2]: joint number, and the bits of its float32 weight."""
    if part.influences is None:
        return np.zeros((len(part.frames.positions), 0, 2), np.uint32)
    weights = part.influences.weights.astype(np.float32)
    return np.stack([part.influences.joints.astype(np.uint32), weights.view(np.uint32)], axis=-1)


class VertexMover:
    """Deformation of vertices: writes positions, normals and tangents of a pose into the scene's vertex buffers.

    Without compute shaders, `MovingVertices.at` computes on the CPU what the shader computes in float32.
    """

    def __init__(
        self, context: GraphicsContext, programs: ProgramFactory, buffers: SceneBuffers, parts: Sequence[MovingVertices]
    ) -> None:
        self._context, self._memory, self._buffers, self._parts = context, context.memory, buffers, tuple(parts)
        self._program = pose_program(programs) if context.features.compute and parts else None
        self._uploaded: dict[int, _Uploaded] = {}
        """Buffers by index in `parts`, made at the first pose."""

    def run(self, deformations: Mapping[int, Deformation]) -> None:
        """Write the vertices for these deformations, given by node. Raises GpuMemoryError."""
        for number, part in enumerate(self._parts):
            deformation = deformations[part.node]
            if self._program is None:
                frames = part.at(deformation)
                normals = None if frames.normals is None else unit_normals(frames.normals)[0]
                tangents = None if frames.tangents is None else unit_tangents(frames.tangents)[0]
                positions = np.nan_to_num(frames.positions, nan=0.0, posinf=0.0, neginf=0.0)
                self._buffers.write_vertices(part.base_vertex, positions, normals, tangents)
            else:
                self._compute(self._program, part, self._upload(number, part, deformation), deformation)
        if self._program is not None:
            self._context.gl.memory_barrier()

    def _upload(self, number: int, part: MovingVertices, deformation: Deformation) -> _Uploaded:
        joints = 0 if deformation.joints is None else len(deformation.joints)
        if number not in self._uploaded:
            what = f"vertices that move of node {part.node}"
            with self._memory.transaction():
                rest, targets, influences = (
                    # OpenGL has no empty buffers.
                    self._memory.buffer(what, rows.reshape(-1).view(np.uint8) if rows.size else bytes(16), storage=True)
                    for rows in (rest_floats(part), target_floats(part), influence_words(part))
                )
                size = 4 * (JOINT_FLOATS * joints + len(part.targets))
                pose = self._memory.buffer(what, reserve=max(16, size), dynamic=True, storage=True)
            self._uploaded[number] = _Uploaded(rest, targets, influences, pose, joints)
        return self._uploaded[number]

    def _compute(
        self, program: moderngl.ComputeShader, part: MovingVertices, buffers: _Uploaded, deformation: Deformation
    ) -> None:
        weights = np.zeros(len(part.targets), np.float32)
        given = np.array(deformation.weights[: len(weights)], np.float32)
        weights[: len(given)] = given
        matrices = np.zeros((buffers.joints, 3, 4), np.float32)
        if deformation.joints is not None:
            matrices[:] = deformation.joints[:, :3]
        content = np.concatenate([matrices.reshape(-1), weights])
        if len(content):
            buffers.pose.orphan()
            buffers.pose.write(content.tobytes())
        bound = (buffers.rest, buffers.targets, buffers.influences, buffers.pose, *self._buffers.moving_buffers())
        for binding, buffer in zip(PoseBinding, bound, strict=True):
            buffer.bind_to_storage_buffer(int(binding))
        count = len(part.frames.positions)
        set_uniforms(
            program,
            {
                "vertex_count": count,
                "base_vertex": part.base_vertex,
                "vertex_floats": self._buffers.vertex_floats,
                "target_count": len(part.targets),
                "influence_count": 0 if part.influences is None else part.influences.joints.shape[1],
                "joint_count": buffers.joints,
                "has_normals": part.frames.normals is not None,
                "has_tangents": part.frames.tangents is not None,
            },
        )
        program.run(*self._memory.limits.rows_of_work_groups(-(-count // POSE_GROUP)))

    def release(self) -> None:
        """Free what has been uploaded."""
        for buffers in self._uploaded.values():
            for buffer in buffers[:4]:
                buffer.release()
        self._uploaded = {}


class PosePass(RenderPass[Pose | None, PosedScene]):
    """Pass that poses the scene. Input: a pose. Output: instances and vertices on the GPU, and the PosedScene."""

    name = "pose"

    def __init__(
        self, motion: Motion, scene: Scene, buffers: SceneBuffers, vertices: VertexMover, clusters: Clusters
    ) -> None:
        """Take the `clusters` of the scene in the pose of the file."""
        self._motion, self._scene, self._buffers, self._vertices = motion, scene, buffers, vertices
        self._clusters = clusters

    def run(self, inputs: Pose | None, target: PosedScene) -> None:
        """Move instances and vertices. Raises GpuMemoryError, and InputError for a pose of an unknown animation."""
        moved = self._motion.at(inputs)
        self._buffers.place_instances(moved.instances.transform)
        self._vertices.run(moved.deformations)
        target.culling, target.bounds = Culling(self._scene, self._clusters, moved), moved.bounds
