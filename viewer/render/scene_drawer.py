"""Culling and the visibility pass: from a camera to what the later passes read."""

from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from ntc.codec.maps import PLANES
from viewer.gl.context import GraphicsContext
from viewer.gl.program import ProgramFactory
from viewer.render.pass_scheduler import PassScheduler
from viewer.render.passes.cull_clusters import ClusterCulling, ClusterView
from viewer.render.passes.pose_vertices import PoseVerticesPass
from viewer.render.passes.visibility import CulledScene, VisibilityPass
from viewer.render.resources.clusters.bounds import build_clusters, cluster_count
from viewer.render.resources.clusters.records import CLUSTER_RECORD, CLUSTER_TRIANGLES
from viewer.render.resources.culling import Culling, DrawCounts, DrawList
from viewer.render.resources.scene_buffers import AnyDrawList, SceneBuffers
from viewer.render.resources.visibility_buffer import SurfaceContent, VisibilityInputs, VisibilityTarget
from viewer.scene.model import Camera, Pose, Scene
from viewer.state.camera import view_projection

LEAST_CLUSTERS = 1 << 14
"""Clusters of all instances from which on they are culled on the GPU: 2 million triangles (docs/geometry-scale.md)."""
LEAST_OF_INSTANCE = 8
"""Clusters that instances must have on the average: what is smaller is culled as well on the CPU, by instances."""


UNKNOWN_POSE: Final = Pose("", -1.0)
"""Of a scene of which some parts stand in one pose and some in another: no view asks for it."""
ON_SOFTWARE = False
"""Whether software renderers cull by small clusters, too: frames take them as long as with what the CPU culls."""


def pays_on_gpu(scene: Scene, storage_bytes: int, is_software: bool) -> bool:
    """Whether culling `scene` on the GPU is worth its three steps, and fits into buffers of `storage_bytes`."""
    # Bounds of clusters whose vertices move would have to follow them.
    if (is_software and not ON_SOFTWARE) or scene.motion is not None:
        return False
    clusters = cluster_count(scene, CLUSTER_TRIANGLES)
    if clusters * CLUSTER_RECORD.itemsize > storage_bytes:
        return False
    return clusters >= max(LEAST_CLUSTERS, LEAST_OF_INSTANCE * len(scene.instances.primitive))


class SceneDrawer:
    """Draws visibility buffers of one scene."""

    def __init__(
        self,
        context: GraphicsContext,
        programs: ProgramFactory,
        scene: Scene,
        scene_buffers: SceneBuffers,
        scheduler: PassScheduler,
    ) -> None:
        self._context, self._scene, self._buffers, self._scheduler = context, scene, scene_buffers, scheduler
        on_gpu = context.features.compute and pays_on_gpu(
            scene, context.memory.limits.storage_block_bytes, context.info.is_software
        )
        self._culling = Culling(scene, build_clusters(scene, CLUSTER_TRIANGLES) if on_gpu else None)
        self._clusters = ClusterCulling(context, programs, scene, self._culling) if on_gpu else None
        self._pass = VisibilityPass(context, programs, scene_buffers)
        self._pose = scene.pose
        self._bounds = scene.bounds
        """[2, 3] of the scene as it stands."""
        moving = scene.motion.moving if scene.motion is not None else ()
        self._pose_vertices = PoseVerticesPass(context, programs, scene_buffers, moving)
        self._read_clusters = self._culling.clusters
        self._texture_of_material = {
            plane: np.array([material.plane_texture(plane) for material in scene.materials], np.int64)
            for plane in PLANES
        }
        self._culled: CulledScene | None = None
        self._drawn: VisibilityInputs | None = None

    def stand_in(self, pose: Pose | None) -> bool:
        """Let the scene stand in a pose, None: as it was read; whether anything has moved, so that all is to be drawn anew.

        Raises GpuMemoryError, and InputError for a pose of an animation that the scene has not.
        """
        pose, motion = pose or self._scene.pose, self._scene.motion
        if motion is None or pose == self._pose:
            self._scheduler.skipped["poses"] += motion is not None
            return False
        # Until everything stands there, what is drawn is of no known pose.
        self._pose, self._culled, self._drawn = UNKNOWN_POSE, None, None
        stand = motion.at(pose)
        with self._scheduler.timer.measure("pose"):
            self._buffers.place_instances(stand.instances.transform)
            self._pose_vertices.run(stand.deformations)
        self._culling = Culling(self._scene, self._read_clusters, stand)
        self._bounds, self._pose = stand.bounds, pose
        return True

    @property
    def bounds(self) -> NDArray[np.float32]:
        """[2, 3] of the scene as it stands."""
        return self._bounds

    @property
    def culling(self) -> Culling:
        """Bounds of the scene's parts, for other views of it."""
        return self._culling

    def draw_counts(self, waits: bool) -> DrawCounts:
        """What the last visibility buffer was drawn from; unless this `waits`, perhaps one before.

        Raises RuntimeError before the first.
        """
        draw_list = self._last.draw_list
        if isinstance(draw_list, DrawList):
            return draw_list.counts
        assert self._clusters is not None
        return self._clusters.counts(waits)

    @property
    def _last(self) -> CulledScene:
        if self._culled is None:
            raise RuntimeError("draw a visibility buffer first")
        return self._culled

    def draw(self, camera: Camera, target: VisibilityTarget, blend_sample: int = 0) -> VisibilityInputs:
        """Draw what `camera` sees, unless `target` shows that already. Raises GpuMemoryError.

        `blend_sample` is the pattern of thresholds that BLEND surfaces are drawn against.
        """
        culled = self._culled
        if culled is None or (culled.camera, culled.size) != (camera, target.size):
            self._culled = None
            with self._scheduler.timer.measure_cpu("cull"):
                matrix = view_projection(camera, target.size, self._bounds)
                draw_list = self._draw_list(camera, target.size, matrix)
                self._buffers.upload(draw_list)
            culled = self._culled = CulledScene(camera, target.size, matrix, draw_list)
        if blend_sample:
            culled = replace(culled, sample=blend_sample)
        if (
            self._scheduler.run(self._pass, culled, target)
            or self._drawn is None
            or self._drawn.visibility is not target
        ):
            self._drawn = self._inputs(culled, target)
        return self._drawn

    def redraw(self, target: VisibilityTarget) -> VisibilityInputs:
        """Draw the last view into `target`, which may have another size."""
        last = self._last
        if self._clusters is None or target.size == last.size:
            self._pass.run(last, target)
        else:
            # Of small clusters other ones are seen where pixels are others.
            self._buffers.upload(self._draw_list(last.camera, target.size, last.matrix))
            self._pass.run(last, target)
            self._buffers.upload(self._draw_list(last.camera, last.size, last.matrix))
        return self._inputs(last, target)

    def _draw_list(self, camera: Camera, size: tuple[int, int], matrix: NDArray[np.float64]) -> AnyDrawList:
        if self._clusters is None:
            return self._culling.draw_list(camera, matrix)
        return self._clusters.draw_list(ClusterView(camera, size, matrix))

    def release(self) -> None:
        """Free everything."""
        self._pose_vertices.release()
        if self._clusters is not None:
            self._clusters.release()

    def texture_ids(self, camera: Camera, size: tuple[int, int], content: SurfaceContent) -> NDArray[np.int32]:
        """[H, W] int32, row 0 on top: texture ids that `camera` sees, drawn now and read back."""
        target = VisibilityTarget(self._context, size, content)
        try:
            self.draw(camera, target)
            return target.texture_ids()
        finally:
            target.release()
            self._scheduler.forget()

    def _inputs(self, culled: CulledScene, target: VisibilityTarget) -> VisibilityInputs:
        materials = np.nonzero(culled.draw_list.materials)[0]
        found = {plane: np.unique(texture[materials]) for plane, texture in self._texture_of_material.items()}
        textures = {plane: tuple(own[own >= 0].tolist()) for plane, own in found.items()}
        return VisibilityInputs(
            target,
            self._buffers,
            culled.camera,
            textures=textures["base"],
            plane_textures=textures,
            visible_materials=tuple(materials.tolist()),
            matrix=culled.matrix,
            blend_sample=culled.sample,
        )
