"""Points spread evenly over the surfaces of a scene, to measure the distance to the nearest surface.

Triangles are drawn at random, half of them by instance and half by number of triangles, so that a floor of two triangles is not
missed. Points are then chosen with weights area / probability of having been drawn (importance resampling), which makes them even by
area without a pass over all triangles.
"""

import math

import numpy as np
from numpy.typing import NDArray

from viewer.scene.model import Scene

SAMPLES = 25_000
"""Most points: in a city of 60,000 square metres one every 1.5 m."""
TRIED = 100_000
"""Triangles that are drawn at random, however many the scene has; the points lie on some of them."""


class SurfaceSamples:
    """Points spread about evenly over the triangles of a scene; equal for equal scenes."""

    def __init__(self, scene: Scene) -> None:
        from scipy.spatial import cKDTree

        points = _points(scene, np.random.default_rng(0))
        self.points = points[np.isfinite(points).all(axis=1)]
        """[N, 3] float64, scene units; at most SAMPLES."""
        self._tree = cKDTree(self.points) if len(self.points) else None

    def distance(self, place: tuple[float, float, float]) -> float:
        """Return the distance from a place to the nearest point, in scene units, exact to their spacing; infinite without points."""
        if self._tree is None or not all(map(math.isfinite, place)):
            return math.inf
        return float(self._tree.query(place)[0])


def _points(scene: Scene, random: np.random.Generator) -> NDArray[np.float64]:
    """Return [N, 3] points, N at most SAMPLES."""
    of_instance = scene.instances.primitive.astype(np.int64)
    first, count, base = (
        np.array([getattr(primitive, name) for primitive in scene.primitives], np.int64)
        for name in ("first_index", "index_count", "base_vertex")
    )
    triangles = (count // 3)[of_instance]
    drawable = np.nonzero(triangles > 0)[0]
    if not len(drawable):
        return np.zeros((0, 3))
    # Half of the draws favour instances with many triangles, half treat all instances alike.
    shares = triangles[drawable] / triangles.sum()
    even = random.choice(drawable, TRIED // 2)
    by_count = random.choice(drawable, TRIED // 2, p=shares)
    instances = np.concatenate([even, by_count])
    likelihood = 0.5 / len(drawable) / triangles[instances] + 0.5 / triangles.sum()
    chosen = (random.random(TRIED) * triangles[instances]).astype(np.int64)
    primitive = of_instance[instances]
    rows = first[primitive] + 3 * chosen
    geometry = scene.geometry
    corners = np.stack(
        [geometry.positions[base[primitive] + geometry.indices[rows + corner].astype(np.int64)] for corner in range(3)],
        axis=1,
    ).astype(np.float64)
    linear = scene.instances.transform[:, :3, :3].astype(np.float64)[instances]
    with np.errstate(over="ignore", invalid="ignore"):
        corners = np.einsum("nij,nkj->nki", linear, corners) + scene.instances.transform[instances, None, :3, 3]
        sides = corners[:, 1:] - corners[:, :1]
        weights = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1) / likelihood
    weights = np.where(np.isfinite(weights), weights, 0.0)
    if not weights.any():
        return np.asarray(corners[:SAMPLES, 0])
    picked = random.choice(TRIED, SAMPLES, p=weights / weights.sum())
    u, v = random.random((2, SAMPLES, 1))
    u, v = np.where(u + v > 1.0, 1.0 - u, u), np.where(u + v > 1.0, 1.0 - v, v)
    points: NDArray[np.float64] = corners[picked, 0] + sides[picked, 0] * u + sides[picked, 1] * v
    return points
