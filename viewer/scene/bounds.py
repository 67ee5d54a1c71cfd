"""World-space bounds of a scene."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from viewer.scene.model import Geometry, Instances, Primitive

EXACT_VERTICES = 1 << 22
"""Most products of instances and vertices for which a primitive is bounded by its vertices; beyond, by its local box."""
EXACT_TOTAL = 1 << 24
"""Most such products of all primitives together: many may share the same vertices."""

_Range = tuple[int, int, int, int]


def _range(primitive: Primitive) -> _Range:
    return primitive.base_vertex, primitive.vertex_count, primitive.first_index, primitive.index_count


def _vertices(geometry: Geometry, primitive: Primitive) -> NDArray[np.float32]:
    """Return [P, 3] local points that the primitive may use."""
    vertices = geometry.positions[primitive.base_vertex : primitive.base_vertex + primitive.vertex_count]
    if primitive.vertex_count > primitive.index_count:
        used = geometry.indices[primitive.first_index : primitive.first_index + primitive.index_count]
        vertices = vertices[used]
    return vertices


def _corners(vertices: NDArray[np.float32]) -> NDArray[np.float64]:
    """Return [8, 3] corners of the box around `vertices`."""
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    corners = np.array([[(low, high)[k >> axis & 1][axis] for axis in range(3)] for k in range(8)])
    return corners.astype(np.float64)


def world_bounds(geometry: Geometry, primitives: Sequence[Primitive], instances: Instances) -> NDArray[np.float32]:
    """Return [2, 3] float32 lowest and highest corner of all placed primitives, in world space.

    Bounds are exact while there are few instances: every vertex is transformed. Beyond EXACT_VERTICES only the corners of a
    primitive's local box are, so the result may be wider than the scene.
    """
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    order = np.argsort(instances.primitive, kind="stable")
    starts = np.searchsorted(instances.primitive[order], np.arange(len(primitives) + 1))
    boxes: dict[_Range, NDArray[np.float64]] = {}
    exact_left = EXACT_TOTAL
    for index, primitive in enumerate(primitives):
        rows = order[starts[index] : starts[index + 1]]
        if len(rows) == 0:
            continue
        work = min(primitive.vertex_count, primitive.index_count) * len(rows)
        if work <= min(EXACT_VERTICES, exact_left):
            exact_left -= work
            points = _vertices(geometry, primitive).astype(np.float64)
        else:
            key = _range(primitive)
            if key not in boxes:
                boxes[key] = _corners(_vertices(geometry, primitive))
            points = boxes[key]
        for transform in np.array_split(instances.transform[rows].astype(np.float64), -(-len(rows) // 4096)):
            # One product of two large matrices: a product for each transform takes 25 times as long.
            turned = points @ transform[:, :3, :3].transpose(2, 0, 1).reshape(3, -1)
            world = turned.reshape(len(points), -1, 3) + transform[:, :3, 3]
            low, high = np.minimum(low, world.min(axis=(0, 1))), np.maximum(high, world.max(axis=(0, 1)))
    largest = float(np.finfo(np.float32).max)
    return np.asarray(np.clip(np.stack([low, high]), -largest, largest), np.float32)
