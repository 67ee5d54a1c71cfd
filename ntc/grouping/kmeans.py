"""k-means: Lloyd's iteration from centres chosen by greedy k-means++ (Arthur and Vassilvitskii, 2007), the best of several restarts.

The steps and the random numbers are those of scikit-learn's KMeans, so that a seed gives the groups that it gives there; that
package takes more than a second to import.
"""

import numpy as np
from numpy.typing import NDArray

MOST_ITERATIONS = 300
TOLERANCE = 1e-4
"""Of the mean variance of the features: centres that move less are at rest."""

Floats = NDArray[np.float64]
Labels = NDArray[np.int64]


def _squared_distances(rows: Floats, points: Floats, norms: Floats) -> Floats:
    """[rows, points] squared distances of `rows` [rows, F] from `points` [points, F], whose squared norms are `norms` [points]."""
    own = np.einsum("ij,ij->i", rows, rows)[:, None]
    distances: Floats = np.maximum(-2.0 * (rows @ points.T) + own + norms, 0.0)
    return distances


def _first_centres(points: Floats, norms: Floats, count: int, random: np.random.RandomState) -> Floats:
    """[count, F]: points far from each other, each the best of a few drawn in proportion to their squared distance."""
    trials = 2 + int(np.log(count))
    chosen = [int(random.choice(len(points), p=np.full(len(points), 1.0 / len(points))))]
    ones = np.ones(len(points))
    closest = _squared_distances(points[chosen], points, norms)[0]
    potential = closest @ ones
    while len(chosen) < count:
        drawn = np.searchsorted(np.cumsum(closest), random.uniform(size=trials) * potential)
        drawn = np.minimum(drawn, len(points) - 1)
        distances = np.minimum(_squared_distances(points[drawn], points, norms), closest)
        potentials = distances @ ones
        best = int(np.argmin(potentials))
        closest, potential = distances[best], potentials[best]
        chosen.append(int(drawn[best]))
    return points[chosen]


def _nearest(points: Floats, centres: Floats) -> Labels:
    # Squared distances but for a summand that all centres share.
    nearest: Labels = (np.einsum("ij,ij->i", centres, centres) - 2.0 * points @ centres.T).argmin(1)
    return nearest


def _moved(points: Floats, centres: Floats, labels: Labels) -> Floats:
    """The means of the points of each centre; a centre without points takes one that is farthest from its own."""
    weights = np.bincount(labels, minlength=len(centres)).astype(np.float64)
    sums, sizes = np.zeros_like(centres), weights[weights > 0.0]
    begins = (np.cumsum(sizes) - sizes).astype(np.int64)
    sums[weights > 0.0] = np.add.reduceat(points[np.argsort(labels, kind="stable")], begins, axis=0)
    empty = np.flatnonzero(weights == 0.0)
    if len(empty):
        distances = np.square(points - centres[labels]).sum(1)
        far = np.argpartition(distances, -len(empty))[: -len(empty) - 1 : -1]
        for centre, point in zip(empty, far, strict=True):
            sums[labels[point]] -= points[point]
            weights[labels[point]] -= 1.0
            sums[centre], weights[centre] = points[point], 1.0
    return np.where(weights[:, None] > 0.0, sums / np.maximum(weights, 1.0)[:, None], centres)


def _settled(points: Floats, centres: Floats, tolerance: float) -> tuple[Labels, float]:
    """(labels, sum of squared distances to their centres) of Lloyd's iteration from `centres`."""
    labels = np.full(len(points), -1, np.int64)
    for _ in range(MOST_ITERATIONS):
        before, labels = labels, _nearest(points, centres)
        moved = _moved(points, centres, labels)
        shift = float(np.square(moved - centres).sum())
        centres = moved
        if np.array_equal(labels, before):
            break
        if shift <= tolerance:
            labels = _nearest(points, centres)
            break
    else:
        labels = _nearest(points, centres)
    return labels, float(np.square(points - centres[labels]).sum())


def _same_clusters(first: Labels, second: Labels) -> bool:
    """Whether the two differ in the names of clusters alone."""
    pairs = set(zip(first.tolist(), second.tolist(), strict=True))
    return len(pairs) == len({a for a, _ in pairs}) == len({b for _, b in pairs})


def kmeans_labels(features: Floats, clusters: int, restarts: int, seed: int) -> Labels:
    """[rows] int64 cluster of each of `features` [rows, F]; at most `clusters`, which are no more than rows."""
    random = np.random.RandomState(seed)
    points = np.ascontiguousarray(features - features.mean(axis=0))
    norms = np.einsum("ij,ij->i", points, points)
    tolerance = TOLERANCE * float(np.mean(np.var(features, axis=0)))
    best: tuple[Labels, float] | None = None
    for _ in range(restarts):
        found = _settled(points, _first_centres(points, norms, clusters, random), tolerance)
        if best is None or (found[1] < best[1] and not _same_clusters(found[0], best[0])):
            best = found
    assert best is not None
    return best[0]
