"""Culling of clusters by frustum and normal cone, on the CPU or prepared for the GPU.

A cluster is a run of consecutive triangles of a primitive, with an axis-aligned box and a normal cone: the mean direction of its
normals, and the largest angle to it. Two tests cull a cluster of an instance, both conservative. (1) Its box, in world space, lies
outside a frustum plane: the distance of the box's centre plus its extent along the plane's normal is negative (Gribb and Hartmann 2001
for the planes). (2) All its triangles face away: the direction from the eye to each point of the bounding sphere makes less than 90
degrees with all normals of the cone. With axis n, sine of the cone's half angle s, centre c and radius r, that holds if
dot(c - eye, n) >= s |c - eye| + r (Shirman and Abi-Ezzi 1993). It is tested in local space, because transforms may scale unevenly.

Neighbouring visible clusters of an instance become one draw command, because a command costs more than some hidden triangles. Commands
are sorted by bucket (equal OpenGL state), then from near to far, so the depth test rejects hidden pixels early. On the CPU, `Culling`
tests clusters of CPU_CLUSTER_TRIANGLES. For many clusters, `InstanceCulling` tests whole instances, and the GPU tests their clusters
(viewer/render/passes/cull.py), with a further test for clusters that cover no pixel centre.
"""

from dataclasses import dataclass, replace

import moderngl
import numpy as np
from numpy.typing import NDArray

from viewer.gl.indirect import IndirectDraws
from viewer.render.resources.clusters import (
    BUCKET_RECORD,
    ITEM_CLUSTERS,
    ITEM_RECORD,
    NEVER_BACKFACING,
    PLACEMENT_RECORD,
    Clusters,
    build_clusters,
)
from viewer.scene.model import Camera, Sampler, Scene, Stand
from viewer.state.camera import frustum_planes

CPU_CLUSTER_TRIANGLES = 512
"""Most triangles of a cluster for culling on the CPU."""

COMMAND = np.dtype(
    [("count", "<u4"), ("instances", "<u4"), ("first_index", "<u4"), ("base_vertex", "<i4"), ("base_instance", "<u4")]
)
"""DrawElementsIndirectCommand (OpenGL 4.3, Sec. 10.4)."""

OPAQUE = -2
"""Alpha texture of a bucket that needs no alpha test."""
NO_ALPHA_TEXTURE = -1
"""Alpha texture of a bucket whose alpha comes only from factors and vertex colours."""


@dataclass(frozen=True)
class Bucket:
    """Instances that are drawn with the same OpenGL state."""

    alpha_texture: int
    """Texture id, or OPAQUE, or NO_ALPHA_TEXTURE."""
    double_sided: bool
    mirrored: bool
    """True if the transform reverses the winding of triangles."""
    alpha_sampler: Sampler | None = None
    """Sampler of the alpha texture; None without one."""

    def sort_key(self) -> tuple[object, ...]:
        """Return the key of the drawing order: opaque buckets first, because they hide fragments that cost an alpha test."""
        return self.alpha_texture, self.double_sided, self.mirrored, repr(self.alpha_sampler)


@dataclass(frozen=True)
class DrawCounts:
    """Numbers of drawn and culled parts of a scene."""

    clusters_culled: int
    triangles_culled: int
    triangles: int
    commands: int


@dataclass(frozen=True, eq=False)
class DrawList:
    """Commands that draw the clusters that one camera may see."""

    commands: NDArray[np.void]
    """[N] COMMAND, bucket by bucket."""
    ranges: tuple[tuple[Bucket, int, int], ...]
    """(bucket, first command, number of commands)."""
    materials: NDArray[np.bool_]
    """[materials] whether an instance with the material may be visible."""
    counts: DrawCounts


def instance_bucket(scene: Scene, instance: int, mirrored: bool) -> Bucket:
    """Return the bucket of an instance."""
    material = scene.materials[scene.primitives[int(scene.instances.primitive[instance])].material]
    if material.alpha_mode == "opaque":
        alpha = OPAQUE
    else:
        has_alpha = material.texture_id >= 0 and scene.textures[material.texture_id].has_alpha
        alpha = material.texture_id if has_alpha else NO_ALPHA_TEXTURE
    return Bucket(alpha, material.double_sided, mirrored, material.sampler if alpha >= 0 else None)


def _moved(clusters: Clusters, scene: Scene, stand: Stand) -> Clusters:
    """Return `clusters`, in which those of moving vertices have the primitive's box and no normal cone."""
    centre, half, cutoff = clusters.centre.copy(), clusters.half.copy(), clusters.cutoff.copy()
    for number, primitive in enumerate(scene.primitives):
        box = stand.boxes.get(primitive.base_vertex)
        if box is not None:
            rows = slice(clusters.first[number], clusters.first[number + 1])
            centre[rows], half[rows], cutoff[rows] = box.mean(axis=0), (box[1] - box[0]) / 2.0, NEVER_BACKFACING
    return replace(clusters, centre=centre, half=half, cutoff=cutoff)


class Culling:
    """Culling on the CPU: world-space bounds of every cluster of every instance, and the tests."""

    def __init__(self, scene: Scene, clusters: Clusters | None = None, stand: Stand | None = None) -> None:
        """Take `clusters` of the pose of the file (None: with CPU_CLUSTER_TRIANGLES), and `stand`, the current pose."""
        self.clusters = clusters or build_clusters(scene, CPU_CLUSTER_TRIANGLES)
        if stand is not None:
            self.clusters = _moved(self.clusters, scene, stand)
        instances = scene.instances if stand is None else stand.instances
        primitive = instances.primitive.astype(np.int64)
        counts = np.diff(self.clusters.first)[primitive]
        self._instance = np.repeat(np.arange(len(primitive)), counts)
        within = np.arange(len(self._instance)) - np.repeat(np.cumsum(counts) - counts, counts)
        self._cluster = self.clusters.first[primitive[self._instance]] + within
        transforms = instances.transform.astype(np.float64)
        rotations = transforms[:, :3, :3]
        centre, half = self.clusters.centre[self._cluster], self.clusters.half[self._cluster]
        of_row = rotations[self._instance]
        self._centre = np.einsum("nij,nj->ni", of_row, centre) + transforms[self._instance, :3, 3]
        self._half = np.einsum("nij,nj->ni", np.abs(of_row), half)
        determinant = np.linalg.det(rotations) if len(rotations) else np.zeros(0)
        invertible = np.abs(determinant) > 1e-30
        inverse = np.zeros_like(rotations)
        inverse[invertible] = np.linalg.inv(rotations[invertible])
        self._inverse, self._translation = inverse, transforms[:, :3, 3]
        self.has_inverse = invertible
        """[N] whether an instance's transform has an inverse."""
        buckets = [instance_bucket(scene, index, bool(determinant[index] < 0.0)) for index in range(len(primitive))]
        self.buckets = tuple(sorted(set(buckets), key=Bucket.sort_key))
        numbers = {bucket: number for number, bucket in enumerate(self.buckets)}
        self.bucket_of_instance = np.array([numbers[bucket] for bucket in buckets], np.int64)
        """[N] index into `buckets`."""
        self._bucket = self.bucket_of_instance[self._instance]
        single_sided = np.array([not bucket.double_sided for bucket in buckets], bool) & invertible
        self._may_face_away = single_sided[self._instance] & (self.clusters.cutoff[self._cluster] <= 1.0)
        self._radius = np.linalg.norm(half, axis=1)
        self._base_vertex = np.array([p.base_vertex for p in scene.primitives], np.int64)[primitive]
        self._material = np.array([p.material for p in scene.primitives], np.int64)[primitive]
        self._materials = len(scene.materials)
        self._triangles = self.clusters.index_count[self._cluster] // 3

    def local_eyes(self, eye: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return `eye` in the local space of each instance: [N, 3]."""
        return np.asarray(np.einsum("nij,nj->ni", self._inverse, eye - self._translation))

    def _faces_away(self, eye: NDArray[np.float64], rows: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Return whether all triangles of each cluster face away: [rows] bool."""
        instance, cluster = self._instance[rows], self._cluster[rows]
        local_eyes = self.local_eyes(eye)
        towards = self.clusters.centre[cluster] - local_eyes[instance]
        along = np.einsum("ij,ij->i", towards, self.clusters.axis[cluster])
        reach = self.clusters.cutoff[cluster] * np.linalg.norm(towards, axis=1) + self._radius[rows]
        return np.asarray(self._may_face_away[rows] & (along >= reach), np.bool_)

    def draw_list(self, camera: Camera, matrix: NDArray[np.float64]) -> DrawList:
        """Return the commands for what `camera` may see; `matrix` is its world-to-clip matrix."""
        planes = frustum_planes(matrix)
        distance = self._centre @ planes[:, :3].T + planes[:, 3] + self._half @ np.abs(planes[:, :3]).T
        rows = np.nonzero((distance >= 0.0).all(axis=1))[0]
        if camera.orthographic_height is None:
            rows = rows[~self._faces_away(np.array(camera.eye, np.float64), rows)]
        return self._commands(rows, np.array(camera.eye, np.float64))

    def _commands(self, rows: NDArray[np.int64], eye: NDArray[np.float64]) -> DrawList:
        visible_materials = np.zeros(self._materials, bool)
        visible_materials[self._material[self._instance[rows]]] = True
        away = np.maximum(np.abs(eye - self._centre[rows]) - self._half[rows], 0.0)
        nearest = np.full(len(self.bucket_of_instance), np.inf)
        np.minimum.at(nearest, self._instance[rows], np.einsum("ij,ij->i", away, away))
        order = np.lexsort((rows, nearest[self._instance[rows]], self._bucket[rows]))
        rows = rows[order]
        cluster, instance = self._cluster[rows], self._instance[rows]
        # Neighbouring clusters of one instance share a command.
        starts = (
            np.nonzero(np.concatenate([[True], (np.diff(cluster) != 1) | (np.diff(instance) != 0)]))[0]
            if len(rows)
            else rows
        )
        counts = self.clusters.index_count[cluster]
        commands = np.zeros(len(starts), COMMAND)
        if len(rows):
            commands["count"] = np.add.reduceat(counts, starts)
            commands["instances"] = 1
            commands["first_index"] = self.clusters.first_index[cluster[starts]]
            commands["base_vertex"] = self._base_vertex[instance[starts]]
            commands["base_instance"] = instance[starts]
        bucket = self._bucket[rows[starts]] if len(rows) else np.zeros(0, np.int64)
        ranges = []
        for number in np.unique(bucket):
            first = int(np.searchsorted(bucket, number))
            ranges.append(
                (self.buckets[int(number)], first, int(np.searchsorted(bucket, number, side="right")) - first)
            )
        drawn = int(self._triangles[rows].sum())
        return DrawList(
            commands,
            tuple(ranges),
            visible_materials,
            DrawCounts(len(self._cluster) - len(rows), int(self._triangles.sum()) - drawn, drawn, len(commands)),
        )


MARGIN = 1e-5
"""Bound of the rounding error of an instance's distance, relative to the largest summand."""


def placement_records(scene: Scene, culling: Culling) -> NDArray[np.void]:
    """Return the records of the scene's instances: [N] PLACEMENT_RECORD."""
    instances = scene.instances
    records = np.zeros(len(instances.primitive), PLACEMENT_RECORD)
    for number, name in enumerate(("row_x", "row_y", "row_z")):
        records[name] = instances.transform[:, number]
    records["base_vertex"] = np.array([p.base_vertex for p in scene.primitives], np.int64)[instances.primitive]
    double_sided = np.array([bucket.double_sided for bucket in culling.buckets], bool)
    records["may_face_away"] = culling.has_inverse & ~double_sided[culling.bucket_of_instance]
    return records


@dataclass(frozen=True, eq=False)
class DrawItems:
    """Items to cull on the GPU, with their buckets and materials."""

    items: NDArray[np.void]
    """[I] ITEM_RECORD, bucket by bucket, nearest instances first."""
    buckets: NDArray[np.void]
    """[B] BUCKET_RECORD of buckets that have items."""
    numbers: tuple[int, ...]
    """[B] indices of these buckets into `Culling.buckets`."""
    materials: NDArray[np.bool_]
    """[materials] whether an instance with the material may be seen."""

    @property
    def capacity(self) -> int:
        """Largest possible number of commands."""
        return int(self.buckets["capacity"].sum())


class InstanceCulling:
    """Culling of whole instances on the CPU: world-space boxes, and the test against a frustum."""

    def __init__(self, scene: Scene, culling: Culling) -> None:
        self._culling, clusters = culling, culling.clusters
        low, high = _primitive_boxes(clusters)
        self._primitive = scene.instances.primitive.astype(np.int64)
        transforms = scene.instances.transform.astype(np.float64)
        centre, half = (low + high)[self._primitive] / 2.0, (high - low)[self._primitive] / 2.0
        self._centre = np.einsum("nij,nj->ni", transforms[:, :3, :3], centre) + transforms[:, :3, 3]
        self._half = np.einsum("nij,nj->ni", np.abs(transforms[:, :3, :3]), half)
        self._material = np.array([p.material for p in scene.primitives], np.int64)[self._primitive]
        self._materials = len(scene.materials)
        self.clusters = int(np.diff(clusters.first)[self._primitive].sum())
        """Number of clusters of all instances."""
        triangles = np.add.reduceat(clusters.index_count, clusters.first[:-1]) // 3
        self.triangles = int(triangles[self._primitive].sum())

    def items(self, camera: Camera, matrix: NDArray[np.float64], all_instances: bool = False) -> DrawItems:
        """Return the items that `camera` may see; `matrix` is its world-to-clip matrix. `all_instances`: cull none."""
        planes = frustum_planes(matrix)
        distance = self._centre @ planes[:, :3].T + planes[:, 3]
        reach = self._half @ np.abs(planes[:, :3]).T
        doubt = MARGIN * (np.abs(self._centre) @ np.abs(planes[:, :3]).T + np.abs(planes[:, 3]) + reach)
        outside = (distance + reach + doubt < 0.0).any(axis=1)
        seen = np.nonzero(~outside | all_instances)[0]
        eye = np.array(camera.eye, np.float64)
        away = np.maximum(np.abs(eye - self._centre[seen]) - self._half[seen], 0.0)
        nearest = np.einsum("ij,ij->i", away, away)
        bucket = self._culling.bucket_of_instance
        seen = seen[np.lexsort((seen, nearest, bucket[seen]))]
        clusters = self._culling.clusters
        first, count = clusters.first[:-1][self._primitive[seen]], np.diff(clusters.first)[self._primitive[seen]]
        each = -(-count // ITEM_CLUSTERS)
        row = np.repeat(np.arange(len(seen)), each)
        before = ITEM_CLUSTERS * (np.arange(len(row)) - np.repeat(np.cumsum(each) - each, each))
        items = np.zeros(len(row), ITEM_RECORD)
        items["eye"][:, :3] = self._culling.local_eyes(eye)[seen[row]]
        items["first_cluster"] = first[row] + before
        items["clusters"] = np.minimum(count[row] - before, ITEM_CLUSTERS)
        items["instance"] = seen[row]
        materials = np.zeros(self._materials, bool)
        materials[self._material[seen]] = True
        return DrawItems(items, *_bucket_records(bucket[seen[row]], items["clusters"]), materials)


def _primitive_boxes(clusters: Clusters) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the lowest and highest corners [P, 3] of each primitive."""
    starts = clusters.first[:-1]
    low = np.minimum.reduceat(clusters.centre - clusters.half, starts, axis=0)
    return low, np.maximum.reduceat(clusters.centre + clusters.half, starts, axis=0)


def _bucket_records(
    bucket: NDArray[np.int64], clusters: NDArray[np.uint32]
) -> tuple[NDArray[np.void], tuple[int, ...]]:
    """Return (BUCKET_RECORD [B], numbers of the buckets) for sorted items, given by `bucket` [I] and number of `clusters` [I]."""
    numbers, first, count = np.unique(bucket, return_index=True, return_counts=True)
    records = np.zeros(len(numbers), BUCKET_RECORD)
    if len(numbers) == 0:
        return records, ()
    records["first_item"], records["items"] = first, count
    # A run ends before an invisible cluster, so at most every second cluster begins a run.
    records["capacity"] = np.add.reduceat((clusters.astype(np.int64) + 1) // 2, first)
    records["first_command"] = np.cumsum(records["capacity"]) - records["capacity"]
    return records, tuple(numbers.tolist())


COUNT_OFFSET = int(BUCKET_RECORD.fields["commands"][1]) if BUCKET_RECORD.fields else 0
"""Offset in bytes of the number of commands in a BUCKET_RECORD."""


@dataclass(frozen=True, eq=False)
class GpuDrawList:
    """Commands on the GPU that draw what one camera may see at one picture size. The next list overwrites them."""

    ranges: tuple[tuple[Bucket, int, int], ...]
    """(bucket, first command, largest number of commands)."""
    materials: NDArray[np.bool_]
    """[materials] whether an instance with the material may be seen."""
    commands: moderngl.Buffer
    """Buffer of DrawElementsIndirectCommands."""
    buckets: moderngl.Buffer
    """Buffer of BUCKET_RECORDs, one for each of `ranges`."""
    draws: IndirectDraws

    def draw(self, array: moderngl.VertexArray, index_bytes: int, number: int) -> None:
        """Draw the visible clusters of range `number`."""
        _, first, most = self.ranges[number]
        place = BUCKET_RECORD.itemsize * number + COUNT_OFFSET
        self.draws.draw(array, index_bytes, self.commands, first, most, self.buckets, place)


@dataclass(eq=False)
class PosedScene:
    """Culling bounds of a scene in its current pose."""

    culling: Culling
    bounds: NDArray[np.float32]
    """[2, 3] lowest and highest corner of the scene."""
    has_moved: bool = False
    """True once the scene has had another pose than that of the file."""
