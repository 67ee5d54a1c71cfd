"""Parts of a posed scene as points, and the choice of parts that a picture of the whole scene is framed to."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from viewer.scene.model import Pose, Scene

Array = NDArray[np.float64]
MOST_PARTS = 4096
"""Most parts that are examined; of more, evenly spaced ones are chosen."""
MOST_POINTS = 1 << 18
LEAST_POINTS = 64
"""Points that every part may have, however many parts there are."""
FARTHEST = 16.0
"""Largest reach of a part that is framed, in multiples of the median reach."""
PLAIN, FARTHEST_PLAIN = 0.01, 4.0
"""Parts with less than the share PLAIN of all triangles, such as ground planes and sky domes, may reach only FARTHEST_PLAIN."""


@dataclass(frozen=True, eq=False)
class Part:
    """Points of a placed primitive."""

    points: Array
    """[3 T, 3] corners of evenly chosen triangles, in world space."""
    triangles: int
    instance: int
    """Row of `Scene.instances`."""


def parts_of(scene: Scene, pose: Pose | None = None) -> list[Part]:
    """Return the parts of `scene` in `pose`, moved by skins and morph targets; None: in the pose that it was read in. Raises
    InputError for an unknown animation."""
    stand = scene.motion.at(pose) if scene.motion is not None and pose is not None else None
    instances = scene.instances if stand is None else stand.instances
    moved = {}
    if stand is not None and scene.motion is not None:
        moved = {part.base_vertex: part.at(stand.deformations[part.node]).positions for part in scene.motion.moving}
    rows = np.arange(0, len(instances.primitive), -(-len(instances.primitive) // MOST_PARTS) or 1)
    each = max(LEAST_POINTS, MOST_POINTS // max(1, len(rows)))
    parts: list[Part] = []
    for row in rows.tolist():
        primitive = scene.primitives[instances.primitive[row]]
        end = primitive.first_index + primitive.index_count // 3 * 3
        corners = scene.geometry.indices[primitive.first_index : end].reshape(-1, 3)
        used = corners[:: -(-primitive.index_count // each) or 1].reshape(-1)
        base = primitive.base_vertex
        local = moved[base][used] if base in moved else scene.geometry.positions[base + used.astype(np.int64)]
        transform = instances.transform[row].astype(np.float64)
        with np.errstate(over="ignore", invalid="ignore"):
            points = local.astype(np.float64) @ transform[:3, :3].T + transform[:3, 3]
        triangles = points.reshape(-1, 3, 3)
        points = triangles[np.isfinite(triangles).all(axis=(1, 2))].reshape(-1, 3)
        if len(points):
            parts.append(Part(points, primitive.index_count // 3, row))
    return parts


def _median(values: Array, weights: Array) -> float:
    """Return the weighted median of `values`."""
    order = np.argsort(values)
    return float(values[order][np.searchsorted(np.cumsum(weights[order]), weights.sum() / 2.0)])


def near_parts(parts: Sequence[Part]) -> list[Part]:
    """Return the parts that do not reach much farther from the middle of the scene than most triangles do.

    Middle and reach are medians weighted by triangles. Otherwise a ground plane, a sky dome or a prop at the wrong scale would make
    the rest of the scene a speck.
    """
    if not parts:
        return []
    weights = np.array([part.triangles for part in parts], np.float64)
    centres = np.array([(part.points.min(axis=0) + part.points.max(axis=0)) / 2.0 for part in parts])
    middle = np.array([_median(centres[:, axis], weights) for axis in range(3)])
    reaches = np.array([np.linalg.norm(part.points - middle, axis=1).max() for part in parts])
    limits = np.where(weights < PLAIN * weights.sum(), FARTHEST_PLAIN, FARTHEST) * _median(reaches, weights)
    return [part for part, is_near in zip(parts, (reaches <= limits).tolist(), strict=True) if is_near]
