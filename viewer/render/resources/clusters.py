"""Clusters: runs of triangles small enough to be culled one by one, with bounds and normal cones."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from viewer.scene.model import Scene

CLUSTER_TRIANGLES = 512
NEVER_BACKFACING = 2.0
"""A cone cutoff that no angle reaches."""

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Clusters:
    """All clusters of a scene's primitives, in order; primitive p owns clusters `first[p]` to `first[p + 1]`."""

    first: NDArray[np.int64]
    """[P + 1]."""
    first_index: NDArray[np.int64]
    """[C] position in the index array."""
    index_count: NDArray[np.int64]
    """[C]."""
    centre: Array
    """[C, 3] centre of the bounding box, local space."""
    half: Array
    """[C, 3] half the size of the bounding box."""
    axis: Array
    """[C, 3] mean direction of the triangles' normals."""
    cutoff: Array
    """[C] sine of the cone's half angle, or NEVER_BACKFACING."""


def _corners(scene: Scene, first_index: int, index_count: int, base_vertex: int) -> Array:
    indices = scene.geometry.indices[first_index : first_index + index_count].astype(np.int64) + base_vertex
    return scene.geometry.positions[indices].reshape(-1, 3, 3).astype(np.float64)


def _cones(normals: NDArray[Any], starts: NDArray[np.int64]) -> tuple[Array, Array]:
    lengths = np.linalg.norm(normals, axis=1)
    unit = normals / np.maximum(lengths, 1e-30)[:, None]
    axis = np.add.reduceat(unit, starts, axis=0).astype(np.float64)
    axis_length = np.linalg.norm(axis, axis=1)
    axis /= np.maximum(axis_length, 1e-30)[:, None]
    sizes = np.diff(np.append(starts, len(normals)))
    # Degenerate triangles are never seen: they must not widen the cone.
    cosines = np.where(lengths > 0.0, np.einsum("ij,ij->i", unit, np.repeat(axis, sizes, axis=0)), 1.0)
    narrowest = np.minimum.reduceat(cosines, starts)
    has_cone = (narrowest > 1e-3) & (axis_length > 0.0)
    return axis, np.where(has_cone, np.sqrt(np.maximum(1.0 - narrowest**2, 0.0)), NEVER_BACKFACING)


def build_clusters(scene: Scene) -> Clusters:
    """Clusters of at most CLUSTER_TRIANGLES consecutive triangles of each primitive."""
    counts = [max(1, -(-primitive.index_count // (3 * CLUSTER_TRIANGLES))) for primitive in scene.primitives]
    first = np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
    total = int(first[-1])
    first_index, index_count = np.zeros(total, np.int64), np.zeros(total, np.int64)
    centre, half, axis = np.zeros((total, 3)), np.zeros((total, 3)), np.zeros((total, 3))
    cutoff = np.full(total, NEVER_BACKFACING)
    for number, primitive in enumerate(scene.primitives):
        if primitive.index_count == 0:
            continue
        corners = _corners(scene, primitive.first_index, primitive.index_count, primitive.base_vertex)
        starts = np.arange(0, len(corners), CLUSTER_TRIANGLES)
        rows = slice(int(first[number]), int(first[number + 1]))
        low = np.minimum.reduceat(corners.min(axis=1), starts, axis=0)
        high = np.maximum.reduceat(corners.max(axis=1), starts, axis=0)
        centre[rows], half[rows] = (low + high) / 2.0, (high - low) / 2.0
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        axis[rows], cutoff[rows] = _cones(normals, starts)
        first_index[rows] = primitive.first_index + 3 * starts
        index_count[rows] = np.minimum(3 * CLUSTER_TRIANGLES, primitive.index_count - 3 * starts)
    return Clusters(first, first_index, index_count, centre, half, axis, cutoff)
