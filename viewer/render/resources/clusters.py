"""Clusters of triangles: their bounds, and the records and constants of `generated/clusters.glsl`."""

from collections.abc import Iterator
from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from ntc.codec.gpu import glsl_struct
from viewer.gl.indirect import COMMAND_BYTES
from viewer.render.resources.layout import SCAN_GROUP
from viewer.scene.model import Geometry, Primitive, Scene

NEVER_BACKFACING = 2.0
"""Cone cutoff of clusters that are never culled as back-facing: no sine reaches it."""
PIECE_TRIANGLES = 1 << 18
"""Approximate number of triangles whose bounds are computed at once."""

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Clusters:
    """Clusters of a scene's primitives, in order. Primitive p has the clusters from `first[p]` to `first[p + 1]`, exclusive."""

    first: NDArray[np.int64]
    """[P + 1] number of the first cluster of each primitive."""
    first_index: NDArray[np.int64]
    """[C] position in the index array."""
    index_count: NDArray[np.int64]
    """[C] number of indices."""
    centre: Array
    """[C, 3] centre of the bounding box, local space."""
    half: Array
    """[C, 3] half the size of the bounding box."""
    axis: Array
    """[C, 3] mean direction of the triangles' normals."""
    cutoff: Array
    """[C] sine of the cone's half angle, or NEVER_BACKFACING."""


def _corners(geometry: Geometry, primitive: Primitive, before: int, triangles: int) -> tuple[Array, Array, Array]:
    """Return the three corners, [3 coordinates, T] each, of `triangles` triangles of a primitive from number `before` on."""
    begin = primitive.first_index + 3 * before
    indices = geometry.indices[begin : begin + 3 * triangles].astype(np.int64) + primitive.base_vertex
    # One row for each coordinate, because reductions over rows of three numbers take ten times as long.
    a, b, c = (np.ascontiguousarray(geometry.positions[indices[corner::3]].T, dtype=np.float64) for corner in range(3))
    return a, b, c


def _normals(a: Array, b: Array, c: Array) -> Array:
    """Return [3, T] normals; the length is twice the triangle's area."""
    u, v = b - a, c - a
    return np.stack([u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]])


def _cones(normals: Array, starts: NDArray[np.int64]) -> tuple[Array, Array]:
    lengths = np.sqrt((normals * normals).sum(axis=0))
    unit = normals / np.maximum(lengths, 1e-30)
    axis = np.add.reduceat(unit, starts, axis=1)
    axis_length = np.sqrt((axis * axis).sum(axis=0))
    axis /= np.maximum(axis_length, 1e-30)
    sizes = np.diff(np.append(starts, normals.shape[1]))
    # Degenerate triangles are never visible, so they must not widen the cone.
    cosines = np.where(lengths > 0.0, (unit * np.repeat(axis, sizes, axis=1)).sum(axis=0), 1.0)
    narrowest = np.minimum.reduceat(cosines, starts)
    has_cone = (narrowest > 1e-3) & (axis_length > 0.0)
    return axis.T, np.where(has_cone, np.sqrt(np.maximum(1.0 - narrowest**2, 0.0)), NEVER_BACKFACING)


def _pieces(primitive: Primitive, size: int) -> Iterator[tuple[int, int]]:
    """Yield (first triangle, number of triangles) of pieces of whole clusters, which bounds the memory for a large primitive."""
    triangles = primitive.index_count // 3
    step = max(1, PIECE_TRIANGLES // size) * size
    for start in range(0, triangles, step):
        yield start, min(step, triangles - start)


def cluster_count(scene: Scene, size: int) -> int:
    """Return the number of clusters of all instances, with at most `size` triangles each."""
    counts = np.array([max(1, -(-primitive.index_count // (3 * size))) for primitive in scene.primitives], np.int64)
    return int(counts[scene.instances.primitive].sum())


def build_clusters(scene: Scene, size: int) -> Clusters:
    """Return the clusters of at most `size` consecutive triangles of each primitive."""
    counts = [max(1, -(-primitive.index_count // (3 * size))) for primitive in scene.primitives]
    first = np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
    total = int(first[-1])
    first_index, index_count = np.zeros(total, np.int64), np.zeros(total, np.int64)
    centre, half, axis = np.zeros((total, 3)), np.zeros((total, 3)), np.zeros((total, 3))
    cutoff = np.full(total, NEVER_BACKFACING)
    for number, primitive in enumerate(scene.primitives):
        for before, triangles in _pieces(primitive, size):
            corners = _corners(scene.geometry, primitive, before, triangles)
            starts = np.arange(0, triangles, size)
            row = int(first[number]) + before // size
            rows = slice(row, row + len(starts))
            low = np.minimum.reduceat(np.minimum(np.minimum(*corners[:2]), corners[2]), starts, axis=1).T
            high = np.maximum.reduceat(np.maximum(np.maximum(*corners[:2]), corners[2]), starts, axis=1).T
            centre[rows], half[rows] = (low + high) / 2.0, (high - low) / 2.0
            axis[rows], cutoff[rows] = _cones(_normals(*corners), starts)
            first_index[rows] = primitive.first_index + 3 * (before + starts)
            index_count[rows] = np.minimum(3 * size, 3 * (triangles - starts))
    return Clusters(first, first_index, index_count, centre, half, axis, cutoff)


GPU_CLUSTER_TRIANGLES = 128
"""Most triangles of a cluster for culling on the GPU."""
ITEM_CLUSTERS = 64
"""Most clusters of an item: clusters of one instance that one work group tests."""
COMMAND_WORDS = COMMAND_BYTES // 4
"""Number of words of a DrawElementsIndirectCommand."""
ROUNDING = 4e-6
"""Bound of the rounding error in float32, here and in the vertex shader, relative to the largest summand: 32 times 2^-23."""
CONE_MARGIN = 1.0 / 64.0
"""Sine of the angle (about 1 degree) by which a cluster must face away. Rasterisers snap corners to a grid, which may turn a small
triangle that is seen nearly edge-on."""
PIXEL_MARGIN = 1.0 / 8.0
"""Margin around a cluster's outline in pixels. The coarsest grid that OpenGL allows has steps of 1/16."""


class ClusterBinding(IntEnum):
    """Storage bindings of the culling programs. They read none of the usual buffers, so the numbers overlap."""

    CLUSTERS = 3
    PLACEMENTS = 4
    ITEMS = 5
    COMMANDS = 6
    BUCKETS = 7


class ClusterTest(IntEnum):
    """Bits of the tests of a cluster."""

    FRUSTUM = 1
    CONE = 2
    SIZE = 4


CLUSTER_RECORD = np.dtype(
    [
        *((name, "<f4", (4,)) for name in ("centre", "extent", "axis")),
        *((name, "<u4") for name in ("first_index", "index_count", "padding_0", "padding_1")),
    ]
)
"""Record of a cluster: std430, 64 bytes. Box (centre and half size, local space) and normal cone (axis; in w
the sine of its half angle)."""

PLACEMENT_RECORD = np.dtype(
    [
        *((name, "<f4", (4,)) for name in ("row_x", "row_y", "row_z")),
        *((name, "<u4") for name in ("base_vertex", "may_face_away", "padding_0", "padding_1")),
    ]
)
"""Record of an instance: std430, 64 bytes. Rows of its local-to-world matrix, and whether it may be culled as back-facing."""

ITEM_RECORD = np.dtype(
    [
        ("eye", "<f4", (4,)),
        *((name, "<u4") for name in ("first_cluster", "clusters", "instance", "seen_low", "seen_high")),
        *((name, "<u4") for name in ("runs", "first_command", "triangles")),
    ]
)
"""Record of an item, up to ITEM_CLUSTERS clusters of one instance: std430, 48 bytes. `eye`: in the instance's local space. The GPU
writes the rest: a bit for each visible cluster, number of runs of visible neighbours, place of the first run's command, triangles."""

BUCKET_RECORD = np.dtype(
    [
        *((name, "<u4") for name in ("first_item", "items", "first_command", "capacity")),
        *((name, "<u4") for name in ("commands", "clusters", "triangles", "padding_0")),
    ]
)
"""Record of the items of one bucket: std430, 32 bytes. The GPU writes the numbers of commands, clusters and triangles."""


def cluster_layout_glsl() -> str:
    """Return the include `generated/clusters.glsl`."""
    lines = ["// Generated from viewer/render/resources/clusters.py."]
    lines += [f"#define BINDING_{member.name} {member.value}" for member in ClusterBinding]
    lines += [f"#define TEST_{member.name} {member.value}u" for member in ClusterTest]
    lines += [
        f"#define ITEM_CLUSTERS {ITEM_CLUSTERS}",
        f"#define COMMAND_WORDS {COMMAND_WORDS}u",
        f"#define SCAN_GROUP {SCAN_GROUP}",
        f"#define ROUNDING {ROUNDING}",
        f"#define CONE_MARGIN {CONE_MARGIN}",
        f"#define PIXEL_MARGIN {PIXEL_MARGIN}",
        glsl_struct("ClusterRecord", CLUSTER_RECORD),
        glsl_struct("PlacementRecord", PLACEMENT_RECORD),
        glsl_struct("ItemRecord", ITEM_RECORD),
        glsl_struct("BucketRecord", BUCKET_RECORD),
    ]
    return "\n".join(lines) + "\n"
