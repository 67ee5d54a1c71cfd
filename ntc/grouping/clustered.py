"""Grouping `clustered`, k-means over features (paper, Sec. 3), and its control `random`: groups of the same sizes (paper, Table 1).

Options and features: docs/reference/groupings.md.
"""

# k-means minimises the sum of squared distances of features to the centre of their cluster. Lloyd's iteration alternates two steps:
# each point joins its nearest centre, and each centre moves to the mean of its points. It ends in a local minimum, so it starts from
# spread-out centres (greedy k-means++, Arthur and Vassilvitskii 2007), and the best of 20 restarts counts. The code repeats the steps
# and random numbers of scikit-learn's KMeans, so seeds give its groups without its import, which takes over a second.
# Beyond LARGEST_EXACT distances, mini-batches move the centres (Sculley 2010): a centre moves towards the mean of its part of a batch,
# at a rate that falls with the number of its points. These groups have a bounded size. More than FLAT_CLUSTERS clusters are searched
# in two levels, so time does not grow with features x clusters.

from collections.abc import Callable, Iterable
from functools import partial

import numpy as np
from numpy.typing import NDArray

from ntc.codec.config import FeatureName
from ntc.codec.model import Grouping

MOST_ITERATIONS = 300
TOLERANCE = 1e-4
"""Squared movement of all centres at which k-means ends, as a share of the mean variance of the features."""

Floats = NDArray[np.float64]
Labels = NDArray[np.int64]


def _squared_distances(rows: Floats, points: Floats, norms: Floats) -> Floats:
    """Return [rows, points] squared distances of `rows` [rows, F] from `points` [points, F]; `norms` [points] are the points' squared
    norms."""
    row_norms = np.einsum("ij,ij->i", rows, rows)[:, None]
    distances: Floats = np.maximum(-2.0 * (rows @ points.T) + row_norms + norms, 0.0)
    return distances


def _first_centres(points: Floats, norms: Floats, count: int, random: np.random.RandomState) -> Floats:
    """Return [count, F] initial centres by greedy k-means++: each is the best of a few points drawn in proportion to their squared
    distance from the nearest centre so far."""
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


def _moved(points: Floats, centres: Floats, labels: Labels) -> Floats:
    """Return [centres, F]: the mean of each centre's points. A centre without points moves to the point farthest from its centre."""
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
    """Run Lloyd's iteration from `centres`. Return (labels, sum of squared distances to their centres)."""
    labels = np.full(len(points), -1, np.int64)
    for _ in range(MOST_ITERATIONS):
        before, labels = labels, nearest(points, centres)
        moved = _moved(points, centres, labels)
        shift = float(np.square(moved - centres).sum())
        centres = moved
        if np.array_equal(labels, before):
            break
        if shift <= tolerance:
            labels = nearest(points, centres)
            break
    else:
        labels = nearest(points, centres)
    return labels, float(np.square(points - centres[labels]).sum())


def _same_clusters(first: Labels, second: Labels) -> bool:
    """Return whether two labellings are the same clusters, up to their numbers."""
    pairs = set(zip(first.tolist(), second.tolist(), strict=True))
    return len(pairs) == len({a for a, _ in pairs}) == len({b for _, b in pairs})


def kmeans_labels(features: Floats, clusters: int, restarts: int, seed: int) -> Labels:
    """Return [rows] int64: the cluster of each row of `features` [rows, F], best of `restarts`. `clusters` is at most the number of
    rows."""
    random = np.random.RandomState(seed)
    points = np.ascontiguousarray(features - features.mean(axis=0))
    norms = np.einsum("ij,ij->i", points, points)
    tolerance = TOLERANCE * float(np.mean(np.var(features, axis=0)))
    best: tuple[Labels, float] | None = None
    for _ in range(restarts):
        run = _settled(points, _first_centres(points, norms, clusters, random), tolerance)
        if best is None or (run[1] < best[1] and not _same_clusters(run[0], best[0])):
            best = run
    assert best is not None
    return best[0]


Blocks = Callable[[], Iterable[Floats]]
"""Function that iterates over all features at each call: blocks [n, F], in the order of the textures."""
PASSES = 3
"""Number of passes over all features."""
BATCH = 1024
"""Features of a mini-batch."""
SAMPLE = 32
"""Features per cluster in the sample that the initial centres come from."""
LARGEST_SAMPLE = 20_000
"""Largest size of that sample, or twice the number of clusters if that is more."""
LARGEST_DISTANCES = 1 << 24
"""Distances that are computed at once, which bounds memory."""
SLACK = 1.5
"""Largest size of a group, relative to the mean size."""
FLAT_CLUSTERS = 256
"""Largest number of clusters that are searched in one level. More take two levels: time then grows with features alone, not with
features x clusters."""
LARGEST_HELD = 1 << 22
"""Numbers (features x F) that are in memory at once."""


def _means(points: Floats, labels: Labels, clusters: int) -> Floats:
    counts = np.bincount(labels, minlength=clusters)
    sums = np.zeros((clusters, points.shape[1]))
    np.add.at(sums, labels, points)
    return sums[counts > 0] / counts[counts > 0][:, None]


def _sample(blocks: Blocks, size: int, random: np.random.Generator) -> tuple[Floats, int]:
    """Return (`size` features, or all, drawn uniformly in one pass; the number of all features)."""
    sampled: list[Floats] = []
    keys: list[NDArray[np.float64]] = []
    count = 0
    for block in blocks():
        count += len(block)
        sampled.append(np.array(block))
        keys.append(random.random(len(block)))
        if sum(map(len, sampled)) > 4 * size:
            sampled, keys = _smallest(sampled, keys, size)
    sampled, keys = _smallest(sampled, keys, size)
    return (sampled[0] if sampled else np.zeros((0, 1))), count


def _smallest(
    blocks: list[Floats], keys: list[NDArray[np.float64]], size: int
) -> tuple[list[Floats], list[NDArray[np.float64]]]:
    """Return the `size` features with the smallest random `keys`, and their keys, in order of appearance."""
    if not blocks:
        return blocks, keys
    points, order = np.concatenate(blocks), np.concatenate(keys)
    chosen = np.sort(np.argpartition(order, size)[:size]) if len(order) > size else np.arange(len(order))
    return [points[chosen]], [order[chosen]]


def minibatch_centres(blocks: Blocks, clusters: int, seed: int) -> Floats:
    """Return [at most `clusters`, F]: centres of the features in `blocks`, by mini-batch k-means.

    The same seed and features give the same centres, for any division into blocks.
    """
    random = np.random.default_rng(seed)
    size = min(max(SAMPLE * clusters, BATCH), max(LARGEST_SAMPLE, 2 * clusters))
    sample, count = _sample(blocks, size, random)
    clusters = min(clusters, len(np.unique(sample, axis=0))) if count else 0
    if not clusters:
        return np.zeros((0, sample.shape[1]))
    centres = _means(sample, kmeans_labels(sample, clusters, 1, seed), clusters)
    counts = np.ones(len(centres))
    for _ in range(PASSES):
        for batch in _batches(blocks):
            labels = nearest(batch, centres)
            in_batch = np.bincount(labels, minlength=len(centres)).astype(np.float64)
            sums = np.zeros_like(centres)
            np.add.at(sums, labels, batch)
            moved = in_batch > 0.0
            counts += in_batch
            rate = (in_batch[moved] / counts[moved])[:, None]
            centres[moved] += rate * (sums[moved] / in_batch[moved][:, None] - centres[moved])
    return centres


def _batches(blocks: Blocks) -> Iterable[Floats]:
    """Yield the features BATCH at a time, for any division into blocks."""
    waiting: list[Floats] = []
    held = 0
    for block in blocks():
        waiting.append(block)
        held += len(block)
        while held >= BATCH:
            joined = np.concatenate(waiting)
            yield joined[:BATCH]
            waiting, held = [joined[BATCH:]], held - BATCH
    if held:
        yield np.concatenate(waiting)


def nearest(points: Floats, centres: Floats) -> Labels:
    """Return [rows] int64: the index of the centre nearest to each of `points` [rows, F]."""
    labels = np.zeros(len(points), np.int64)
    step = max(1, LARGEST_DISTANCES // max(1, len(centres)))
    norms = np.einsum("ij,ij->i", centres, centres)
    for first in range(0, len(points), step):
        part = points[first : first + step]
        labels[first : first + step] = (norms - 2.0 * part @ centres.T).argmin(1)
    return labels


def balanced_labels(blocks: Blocks, centres: Floats, count: int, slack: float = SLACK) -> Labels:
    """Return [count] int64: a near centre for each feature. No centre gets more than `slack` times the mean, rounded up.

    Features are assigned in their order. If the nearest centre is full, a feature goes to the nearest one with room.
    """
    largest = int(np.ceil(slack * count / max(1, len(centres))))
    room = np.full(len(centres), largest, np.int64)
    labels = np.zeros(count, np.int64)
    norms = np.einsum("ij,ij->i", centres, centres)
    place = 0
    for batch in _batches(blocks):
        for number, wanted in enumerate(nearest(batch, centres)):
            label = int(wanted)
            if room[label] == 0:
                distances = np.where(room > 0, norms - 2.0 * centres @ batch[number], np.inf)
                label = int(distances.argmin())
            room[label] -= 1
            labels[place] = label
            place += 1
    return labels


def minibatch_labels(blocks: Blocks, count: int, clusters: int, seed: int, slack: float = SLACK) -> Labels:
    """Return [count] int64: a group for each of `count` features, by mini-batch k-means.

    There are about `clusters` groups, none much larger than `slack` times the mean. The same seed and features give the same groups.
    """
    coarse = clusters if clusters <= FLAT_CLUSTERS else int(np.ceil(np.sqrt(clusters)))
    centres = minibatch_centres(blocks, coarse, seed)
    if clusters <= FLAT_CLUSTERS:
        return balanced_labels(blocks, centres, count, slack)
    outer = np.concatenate([nearest(batch, centres) for batch in _batches(blocks)]) if count else np.zeros(0, np.int64)
    labels, first = np.zeros(count, np.int64), 0
    for members, points in _parts(blocks, outer, len(centres)):
        share = max(1, round(clusters * len(members) / count))
        inner = minibatch_centres(partial(iter, [points]), share, seed)
        labels[members] = first + balanced_labels(partial(iter, [points]), inner, len(members), slack)
        first += len(inner)
    return labels


def _parts(blocks: Blocks, outer: Labels, clusters: int) -> Iterable[tuple[Labels, Floats]]:
    """Yield (indices, features) of each cluster. Each pass over all features collects as many clusters as LARGEST_HELD allows."""
    sizes = np.bincount(outer, minlength=clusters)
    width = next((block.shape[1] for block in blocks() if len(block)), 1)
    begin = 0
    while begin < clusters:
        end, held = begin + 1, int(sizes[begin]) * width
        while end < clusters and held + int(sizes[end]) * width <= LARGEST_HELD:
            held += int(sizes[end]) * width
            end += 1
        parts: dict[int, list[Floats]] = {label: [] for label in range(begin, end)}
        place = 0
        for block in blocks():
            labels = outer[place : place + len(block)]
            for label in np.unique(labels[(labels >= begin) & (labels < end)]):
                parts[int(label)].append(np.array(block[labels == label]))
            place += len(block)
        for label, points in parts.items():
            if points:
                yield np.flatnonzero(outer == label), np.concatenate(points)
        begin = end


RESTARTS = 20
LARGEST_EXACT = 1 << 22
"""Largest number of distances (textures x groups) for k-means over all textures at once: 4000 textures in 1000 groups."""
BLOCK = 4096
"""Textures of a block for mini-batches."""


def clustered_grouping(features: NDArray[np.float64], name: FeatureName, clusters: int, seed: int) -> Grouping:
    """Return the grouping of `features` [textures, F], called `name`, by k-means, the best of 20 restarts.

    Groups are numbered by their first texture. Textures with equal features stay together, so there are at most as many groups as
    distinct features. If textures x groups exceed LARGEST_EXACT, mini-batches are used, and groups have a bounded size.
    """
    clusters = min(clusters, len(np.unique(features, axis=0)))
    parameters: dict[str, object] = {"clusters": clusters, "features": name, "seed": seed}
    if len(features) * clusters <= LARGEST_EXACT:
        labels = kmeans_labels(features, clusters, RESTARTS, seed)
    else:
        firsts = range(0, len(features), BLOCK)
        labels = minibatch_labels(lambda: (features[i : i + BLOCK] for i in firsts), len(features), clusters, seed)
        parameters["minibatch"] = True
    return Grouping.of_labels("clustered", labels.tolist(), parameters)


def random_grouping(like: Grouping, seed: int) -> Grouping:
    """Return random groups of the same sizes as those of `like`, numbered by their first texture. The same seed gives the same
    groups."""
    shuffled = np.random.default_rng(seed).permutation(np.array(like.groups, dtype=np.int64))
    parameters = {"clusters": like.group_count, "sizes_of": like.name, "seed": seed}
    return Grouping.of_labels("random", shuffled.tolist(), parameters)
