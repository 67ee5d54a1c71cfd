"""Culling pass: the draw list of the clusters that a camera may see.

For large scenes, three compute shaders cull on the GPU and write the draw commands. `test` tests each cluster of the items (up to 64
clusters of one instance) and counts runs of visible neighbours; a run becomes one command. `scan` gives each item the place of its
first command, by a prefix sum over the items of a bucket. `write` writes the commands there. The CPU never reads their number: draws
take it from a buffer. The tests are explained in viewer/render/resources/culling.py and shaders/passes/cull_clusters.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

import moderngl
import numpy as np
from numpy.typing import NDArray

from ntc.codec.maps import PLANES, Plane
from viewer.gl.context import GraphicsContext
from viewer.gl.indirect import COMMAND_BYTES, IndirectDraws
from viewer.gl.program import ProgramFactory, set_uniforms
from viewer.gl.read_back import ReadBack
from viewer.render.pass_scheduler import RenderPass
from viewer.render.resources.clusters import (
    BUCKET_RECORD,
    CLUSTER_RECORD,
    ITEM_RECORD,
    ClusterBinding,
    ClusterTest,
    cluster_layout_glsl,
)
from viewer.render.resources.culling import (
    Culling,
    DrawCounts,
    GpuDrawList,
    InstanceCulling,
    PosedScene,
    placement_records,
)
from viewer.render.resources.scene_buffers import AnyDrawList, CulledScene, SceneBuffers
from viewer.scene.model import Camera, Scene
from viewer.state.camera import view_projection

FOLDER = "passes/cull_clusters"
ALL_TESTS = ClusterTest.FRUSTUM | ClusterTest.CONE | ClusterTest.SIZE


@dataclass(frozen=True)
class ClusterView:
    """View to cull clusters for."""

    camera: Camera
    size: tuple[int, int]
    """(width, height) of the picture in pixels. Clusters that cover no pixel centre are culled."""
    matrix: NDArray[np.float64]
    """[4, 4] float64, world to clip."""


def cluster_programs(programs: ProgramFactory, padded: bool) -> tuple[moderngl.ComputeShader, ...]:
    """Return the programs `test`, `scan` and `write`. `padded`: empty the unused commands, because the CPU draws all of them."""
    cluster_factory = programs.with_generated({"generated/clusters.glsl": cluster_layout_glsl()})
    test, write = (cluster_factory.compute(f"{FOLDER}/{name}.comp") for name in ("test", "write"))
    return test, cluster_factory.compute(f"{FOLDER}/scan.comp", {"PADDED": int(padded)}), write


class ClusterCulling:
    """Culling on the GPU: clusters of a scene, and the draw commands of the last view."""

    def __init__(
        self,
        context: GraphicsContext,
        programs: ProgramFactory,
        scene: Scene,
        culling: Culling,
        tests: int | None = None,
    ) -> None:
        """Upload the clusters. `tests`: bits of ClusterTest (None: ALL_TESTS); 0 draws everything. Raises GpuMemoryError."""
        self._context, self._memory, self._culling = context, context.memory, culling
        self._tests = ALL_TESTS if tests is None else tests
        self._draws = IndirectDraws(context)
        self._test, self._scan, self._write = cluster_programs(programs, padded=not self._draws.are_counted)
        self.instances = InstanceCulling(scene, culling)
        self.item_count = 0
        """Number of items of the last list."""
        self._what = f"clusters of {scene.name}"
        placements = placement_records(scene, culling)
        with self._memory.transaction():
            self._clusters = self._memory.buffer(self._what, self._records(), storage=True)
            self._placements = self._memory.buffer(self._what, placements.view(np.uint8), storage=True)
            self._items = self._memory.buffer(self._what, reserve=ITEM_RECORD.itemsize, dynamic=True)
            self._buckets = self._memory.buffer(
                self._what, reserve=BUCKET_RECORD.itemsize * max(1, len(culling.buckets)), dynamic=True
            )
            self._commands = self._memory.buffer(self._what, reserve=COMMAND_BYTES)
        self._back = ReadBack[int](context, f"counts of the {self._what}")
        self._counts_read = DrawCounts(0, 0, 0, 0)
        self._is_new = False

    def _records(self) -> NDArray[np.uint8]:
        clusters = self._culling.clusters
        records = np.zeros(len(clusters.cutoff), CLUSTER_RECORD)
        records["centre"][:, :3], records["extent"][:, :3] = clusters.centre, clusters.half
        # The box grows by the rounding to float32, so it still contains its triangles.
        lost = np.abs(clusters.centre - records["centre"][:, :3]) + np.spacing(np.abs(records["extent"][:, :3]))
        records["extent"][:, :3] += lost.astype(np.float32)
        records["axis"][:, :3], records["axis"][:, 3] = clusters.axis, clusters.cutoff
        records["first_index"], records["index_count"] = clusters.first_index, clusters.index_count
        return records.view(np.uint8)

    def draw_list(self, view: ClusterView) -> GpuDrawList:
        """Return the draw list of `view`; it overwrites the previous list. Raises GpuMemoryError."""
        work = self.instances.items(view.camera, view.matrix, all_instances=not self._tests)
        self.item_count = len(work.items)
        ranges = tuple(
            (self._culling.buckets[number], int(record["first_command"]), int(record["capacity"]))
            for number, record in zip(work.numbers, work.buckets, strict=True)
        )
        if self.item_count:
            self._run(view, work.items, work.buckets, work.capacity)
        self._is_new = len(ranges) > 0
        if self._is_new:
            self._back.copy([(self._buckets, BUCKET_RECORD.itemsize * len(ranges))], len(ranges))
        else:
            self._counts_read = self._counts(b"")
        return GpuDrawList(ranges, work.materials, self._commands, self._buckets, self._draws)

    def _run(self, view: ClusterView, items: NDArray[np.void], buckets: NDArray[np.void], capacity: int) -> None:
        self._items = self._memory.grown(self._what, self._items, items.nbytes, dynamic=True, storage=True)
        self._commands = self._memory.grown(self._what, self._commands, COMMAND_BYTES * capacity, storage=True)
        for buffer, records in ((self._items, items), (self._buckets, buckets)):
            buffer.orphan()
            buffer.write(records.view(np.uint8))
        bound = (self._clusters, self._placements, self._items, self._commands, self._buckets)
        for binding, buffer in zip(ClusterBinding, bound, strict=True):
            buffer.bind_to_storage_buffer(int(binding))
        flat = view.camera.orthographic_height is not None
        values = {
            "view_projection": view.matrix.T.astype("<f4").tobytes(),
            "picture_size": tuple(float(side) for side in view.size),
            "tests": self._tests & ~ClusterTest.CONE if flat else self._tests,
            "item_count": len(items),
        }
        groups = self._memory.limits.rows_of_work_groups(len(items))
        set_uniforms(self._test, values)
        self._test.run(*groups)
        self._context.gl.memory_barrier()
        self._scan.run(len(buckets))
        self._context.gl.memory_barrier()
        set_uniforms(self._write, {"item_count": len(items)})
        self._write.run(*groups)
        self._context.gl.memory_barrier()

    def counts(self, waits: bool) -> DrawCounts:
        """Return the counts of the last list. Without `waits`, those of an earlier list until the GPU has finished the last."""
        if self._is_new:
            arrived = self._back.arrived(waits)
            if arrived is not None:
                self._counts_read = self._counts(arrived[0])
                self._is_new = self._back.is_pending
        return self._counts_read

    def _counts(self, content: bytes) -> DrawCounts:
        records = np.frombuffer(content, BUCKET_RECORD)
        clusters, triangles, commands = (
            int(records[name].sum(dtype=np.int64)) for name in ("clusters", "triangles", "commands")
        )
        whole = self.instances
        return DrawCounts(whole.clusters - clusters, whole.triangles - triangles, triangles, commands)

    def items(self, count: int) -> NDArray[np.void]:
        """Return the items of the last list as the GPU has written them, [count] ITEM_RECORD. Waits; for tests."""
        return np.frombuffer(self._items.read(count * ITEM_RECORD.itemsize), ITEM_RECORD)

    def release(self) -> None:
        """Free everything."""
        self._back.release()
        for buffer in (self._clusters, self._placements, self._items, self._commands, self._buckets):
            buffer.release()


@dataclass(frozen=True)
class CameraView:
    """Camera and picture size to cull for."""

    camera: Camera
    size: tuple[int, int]
    """(width, height) of the picture in pixels."""


@dataclass(eq=False)
class Culled:
    """Visible part of the scene, as the scene buffers draw it."""

    scene: CulledScene | None = None
    """Draw list and its view; None before the first view."""
    materials: tuple[int, ...] = ()
    """Materials that may be visible, ascending."""
    textures: Mapping[Plane, tuple[int, ...]] = field(default_factory=dict)
    """Textures that may be visible, ascending, by plane of maps."""


class CullPass(RenderPass[CameraView, Culled]):
    """Pass that culls. Input: a camera's view. Output: the draw list in the scene buffers."""

    name = "cull"

    def __init__(self, posed: PosedScene, scene: Scene, buffers: SceneBuffers, clusters: ClusterCulling | None) -> None:
        self._posed, self._buffers, self._clusters = posed, buffers, clusters
        self._texture_of_material = {
            plane: np.array([material.plane_texture(plane) for material in scene.materials], np.int64)
            for plane in PLANES
        }

    def run(self, inputs: CameraView, target: Culled) -> None:
        """Cull, and upload the draw list. Raises GpuMemoryError."""
        matrix = view_projection(inputs.camera, inputs.size, self._posed.bounds)
        draw_list = self.draw_list(inputs, matrix)
        self._buffers.upload(draw_list)
        target.scene = CulledScene(inputs.camera, inputs.size, matrix, draw_list)
        materials = np.nonzero(draw_list.materials)[0]
        textures = {plane: np.unique(texture[materials]) for plane, texture in self._texture_of_material.items()}
        target.materials = tuple(materials.tolist())
        target.textures = {plane: tuple(ids[ids >= 0].tolist()) for plane, ids in textures.items()}

    def draw_list(self, view: CameraView, matrix: NDArray[np.float64]) -> AnyDrawList:
        """Return the draw list of `view`; `matrix` is its world-to-clip matrix."""
        if self._clusters is None:
            return self._posed.culling.draw_list(view.camera, matrix)
        return self._clusters.draw_list(ClusterView(view.camera, view.size, matrix))
