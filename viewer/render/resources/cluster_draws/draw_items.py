"""What one camera may see of a scene with many clusters, instance by instance: the work that is left for the GPU."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from viewer.render.resources.clusters.bounds import Clusters
from viewer.render.resources.clusters.records import BUCKET_RECORD, ITEM_CLUSTERS, ITEM_RECORD, PLACEMENT_RECORD
from viewer.render.resources.culling import Culling
from viewer.scene.model import Camera, Scene
from viewer.state.camera import frustum_planes

MARGIN = 1e-5
"""By which an instance must be outside, in units of the largest number that is added."""


def placement_records(scene: Scene, culling: Culling) -> NDArray[np.void]:
    """[N] PLACEMENT_RECORD of the scene's instances."""
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
    """Work for the GPU, and what of it the CPU knows."""

    items: NDArray[np.void]
    """[I] ITEM_RECORD, bucket by bucket, nearest instances first."""
    buckets: NDArray[np.void]
    """[B] BUCKET_RECORD of those that have items."""
    numbers: tuple[int, ...]
    """[B] their indices into `Culling.buckets`."""
    materials: NDArray[np.bool_]
    """[materials] whether an instance with the material may be seen."""

    @property
    def capacity(self) -> int:
        """Commands that there may be."""
        return int(self.buckets["capacity"].sum())


class InstanceCulling:
    """World-space boxes of the instances, and the test of a frustum against them."""

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
        """Of all instances."""
        triangles = np.add.reduceat(clusters.index_count, clusters.first[:-1]) // 3
        self.triangles = int(triangles[self._primitive].sum())

    def items(self, camera: Camera, matrix: NDArray[np.float64], all_instances: bool = False) -> DrawItems:
        """What `camera`, whose world-to-clip matrix is `matrix`, may see. `all_instances`: none is left out."""
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
    """Lowest and highest corners [P, 3] of each primitive."""
    starts = clusters.first[:-1]
    low = np.minimum.reduceat(clusters.centre - clusters.half, starts, axis=0)
    return low, np.maximum.reduceat(clusters.centre + clusters.half, starts, axis=0)


def _bucket_records(
    bucket: NDArray[np.int64], clusters: NDArray[np.uint32]
) -> tuple[NDArray[np.void], tuple[int, ...]]:
    """(BUCKET_RECORD [B], numbers of the buckets) of items [I] that are sorted by `bucket`, of so many `clusters`."""
    numbers, first, count = np.unique(bucket, return_index=True, return_counts=True)
    records = np.zeros(len(numbers), BUCKET_RECORD)
    if len(numbers) == 0:
        return records, ()
    records["first_item"], records["items"] = first, count
    # At most every other cluster begins a run.
    records["capacity"] = np.add.reduceat((clusters.astype(np.int64) + 1) // 2, first)
    records["first_command"] = np.cumsum(records["capacity"]) - records["capacity"]
    return records, tuple(numbers.tolist())
