"""World-space bounds."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from viewer.scene.model import Geometry, Instances, Primitive

EXACT_VERTICES = 1 << 22
"""A primitive is bounded by its vertices while instances times vertices stay below this, else by its local box."""


def _points(geometry: Geometry, primitive: Primitive, instances: int) -> NDArray[np.float64]:
    """[P, 3] local points whose box stands for the primitive."""
    vertices = geometry.positions[primitive.base_vertex : primitive.base_vertex + primitive.vertex_count]
    if primitive.vertex_count > primitive.index_count:
        used = geometry.indices[primitive.first_index : primitive.first_index + primitive.index_count]
        vertices = vertices[used]
    if len(vertices) * instances <= EXACT_VERTICES:
        return vertices.astype(np.float64)
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    corners = np.array([[(low, high)[k >> axis & 1][axis] for axis in range(3)] for k in range(8)])
    return corners.astype(np.float64)


def world_bounds(geometry: Geometry, primitives: Sequence[Primitive], instances: Instances) -> NDArray[np.float32]:
    """[2, 3] float32 lowest and highest corner of all placed primitives (a little wide for very many instances)."""
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    order = np.argsort(instances.primitive, kind="stable")
    starts = np.searchsorted(instances.primitive[order], np.arange(len(primitives) + 1))
    for index, primitive in enumerate(primitives):
        rows = order[starts[index] : starts[index + 1]]
        if len(rows) == 0:
            continue
        points = _points(geometry, primitive, len(rows))
        for transform in np.array_split(instances.transform[rows].astype(np.float64), -(-len(rows) // 4096)):
            world = points @ transform[:, :3, :3].transpose(0, 2, 1) + transform[:, None, :3, 3]
            low, high = np.minimum(low, world.min(axis=(0, 1))), np.maximum(high, world.max(axis=(0, 1)))
    largest = float(np.finfo(np.float32).max)
    return np.clip(np.stack([low, high]), -largest, largest).astype(np.float32)
