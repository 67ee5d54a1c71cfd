"""Culling and the visibility pass: from a camera to the visibility buffer."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from viewer.render.pass_scheduler import Output
from viewer.render.passes.cull import CameraView, ClusterCulling, Culled, CullPass
from viewer.render.passes.pose_vertices import PosePass, VertexMover
from viewer.render.passes.visibility import VisibilityPass
from viewer.render.render_context import RenderContext
from viewer.render.resources.clusters import (
    CLUSTER_RECORD,
    GPU_CLUSTER_TRIANGLES,
    build_clusters,
    cluster_count,
)
from viewer.render.resources.culling import Culling, DrawCounts, DrawList, PosedScene
from viewer.render.resources.scene_buffers import CulledScene
from viewer.render.resources.visibility_buffer import SurfaceContent, VisibilityInputs, VisibilityTarget
from viewer.scene.model import Camera, Pose, Scene

LEAST_CLUSTERS = 1 << 14
"""Fewest clusters of a scene, all instances counted, for culling on the GPU: 2 million triangles."""
LEAST_OF_INSTANCE = 8
"""Fewest clusters of an average instance for culling on the GPU. Smaller instances are culled on the CPU, each as a whole."""
ON_SOFTWARE = False
"""Whether software renderers cull clusters in shaders. Their frames take equally long with either."""


def pays_on_gpu(scene: Scene, storage_bytes: int, is_software: bool) -> bool:
    """Return whether culling on the GPU saves more than its three dispatches cost, and fits into buffers of `storage_bytes`."""
    # Clusters of moving vertices would need new bounds in every frame.
    if (is_software and not ON_SOFTWARE) or scene.motion is not None:
        return False
    clusters = cluster_count(scene, GPU_CLUSTER_TRIANGLES)
    if clusters * CLUSTER_RECORD.itemsize > storage_bytes:
        return False
    return clusters >= max(LEAST_CLUSTERS, LEAST_OF_INSTANCE * len(scene.instances.primitive))


class SceneDrawer:
    """Drawing of the visibility buffers of one scene."""

    def __init__(self, context: RenderContext) -> None:
        self._context, self._scheduler = context.graphics, context.scheduler
        self._scene, self._buffers = context.scene, context.scene_buffers
        graphics, programs, scene, scene_buffers = self._context, context.programs, self._scene, self._buffers
        on_gpu = graphics.features.compute and pays_on_gpu(
            scene, graphics.memory.limits.storage_block_bytes, graphics.info.is_software
        )
        culling = Culling(scene, build_clusters(scene, GPU_CLUSTER_TRIANGLES) if on_gpu else None)
        self._clusters = ClusterCulling(graphics, programs, scene, culling) if on_gpu else None
        self._visibility = VisibilityPass(graphics, programs, scene_buffers)
        self.posed, self._culled = PosedScene(culling, scene.bounds), Culled()
        motion = scene.motion
        self._vertices = VertexMover(graphics, programs, scene_buffers, () if motion is None else motion.moving)
        self._pose = None
        if motion is not None:
            self._pose = PosePass(motion, scene, scene_buffers, self._vertices, culling.clusters)
        self._cull = CullPass(self.posed, scene, scene_buffers, self._clusters)
        self.pose = Output(0)
        """Output of the last pose pass."""

    def set_pose(self, pose: Pose | None) -> None:
        """Set the pose of the scene; None: the pose of the file.

        Raises GpuMemoryError, and InputError for an animation that the scene lacks.
        """
        as_read, posed = self._scene.pose, self.posed
        target_pose = pose or as_read
        if self._pose is not None and (posed.has_moved or target_pose != as_read):
            posed.has_moved = True
            self.pose = self._scheduler.advance(self._pose, target_pose, posed)

    def draw_counts(self) -> DrawCounts:
        """Return the counts of the last visibility buffer; if the context does not wait for the GPU, perhaps of an earlier one.

        Raises RuntimeError before the first.
        """
        draw_list = self._last.draw_list
        if isinstance(draw_list, DrawList):
            return draw_list.counts
        assert self._clusters is not None
        return self._clusters.counts(self._scheduler.budget.waits)

    @property
    def coverage(self) -> int:
        """Version of the textures' coverage."""
        return self._buffers.coverage

    @property
    def _last(self) -> CulledScene:
        if self._culled.scene is None:
            raise RuntimeError("draw a visibility buffer first")
        return self._culled.scene

    def draw(self, camera: Camera, target: VisibilityTarget, blend_sample: int = 0) -> VisibilityInputs:
        """Draw the view of `camera`, unless `target` shows it already. Raises GpuMemoryError.

        `blend_sample` is the pattern of thresholds that BLEND surfaces are drawn against.
        """
        reads, timer = (self.pose,), self._scheduler.timer
        view = CameraView(camera, target.size)
        # Nothing reads the version of this output, because other cameras may have been culled since.
        self._scheduler.advance(self._cull, view, self._culled, reads, timing=timer.measure_cpu)
        culled = replace(self._last, sample=blend_sample, coverage=self.coverage)
        version = self._scheduler.advance(self._visibility, culled, target, reads).version
        return self._inputs(culled, target, version)

    def redraw(self, target: VisibilityTarget) -> VisibilityInputs:
        """Draw the last view into `target`, which may have another size."""
        last = self._last
        # Which small clusters are culled depends on the size of a pixel.
        needs_culling = self._clusters is not None and target.size != last.size
        if needs_culling:
            self._buffers.upload(self._cull.draw_list(CameraView(last.camera, target.size), last.matrix))
        culled = replace(last, coverage=self.coverage)
        version = self._scheduler.advance(self._visibility, culled, target, (self.pose,)).version
        if needs_culling:
            self._buffers.upload(self._cull.draw_list(CameraView(last.camera, last.size), last.matrix))
        return self._inputs(last, target, version)

    def release(self) -> None:
        """Free everything."""
        self._vertices.release()
        if self._clusters is not None:
            self._clusters.release()

    def texture_ids(self, camera: Camera, size: tuple[int, int], content: SurfaceContent) -> NDArray[np.int32]:
        """Return the texture ids that `camera` sees, drawn now and read back: [H, W] int32, row 0 on top."""
        target = VisibilityTarget(self._context, size, content)
        try:
            self.draw(camera, target)
            return target.texture_ids()
        finally:
            target.release()
            self._scheduler.forget()

    def _inputs(self, culled: CulledScene, target: VisibilityTarget, version: int) -> VisibilityInputs:
        textures = self._culled.textures
        return VisibilityInputs(
            target,
            self._buffers,
            culled.camera,
            version,
            textures=textures["base"],
            plane_textures=textures,
            visible_materials=self._culled.materials,
            matrix=culled.matrix,
            blend_sample=culled.sample,
        )
