"""k-means over more textures than are held at once: centres move with small random batches (Sculley, 2010), groups of bounded size.

Features come in blocks, again and again, as from files; what is held besides is the centres and a label for each texture.
"""

from collections.abc import Callable, Iterable
from functools import partial

import numpy as np
from numpy.typing import NDArray

from ntc.grouping.kmeans import kmeans_labels

Floats = NDArray[np.float64]
Labels = NDArray[np.int64]
Blocks = Callable[[], Iterable[Floats]]
"""Gives all features anew each time: blocks [n, F], in the order of the textures."""
PASSES = 3
"""Over all features."""
BATCH = 1024
"""Features that move the centres together."""
SAMPLE = 32
"""Features for each cluster from which the first centres are found."""
LARGEST_SAMPLE = 20_000
LARGEST_DISTANCES = 1 << 24
"""Distances that are computed together, to bound memory."""
SLACK = 1.5
"""A group has at most so many times the mean size."""
FLAT_CLUSTERS = 256
"""More clusters are found in two levels, so that time grows with the features and not with their product with the clusters."""
LARGEST_HELD = 1 << 22
"""Numbers of features that are held together."""


def _means(points: Floats, labels: Labels, clusters: int) -> Floats:
    counts = np.bincount(labels, minlength=clusters)
    sums = np.zeros((clusters, points.shape[1]))
    np.add.at(sums, labels, points)
    return sums[counts > 0] / counts[counts > 0][:, None]


def _sample(blocks: Blocks, size: int, random: np.random.Generator) -> tuple[Floats, int]:
    """(`size` features, or all, drawn evenly in one pass; how many there are)."""
    kept: list[Floats] = []
    keys: list[NDArray[np.float64]] = []
    count = 0
    for block in blocks():
        count += len(block)
        kept.append(np.array(block))
        keys.append(random.random(len(block)))
        if sum(map(len, kept)) > 4 * size:
            kept, keys = _smallest(kept, keys, size)
    kept, keys = _smallest(kept, keys, size)
    return (kept[0] if kept else np.zeros((0, 1))), count


def _smallest(
    kept: list[Floats], keys: list[NDArray[np.float64]], size: int
) -> tuple[list[Floats], list[NDArray[np.float64]]]:
    """The features with the smallest keys, in their order."""
    if not kept:
        return kept, keys
    points, order = np.concatenate(kept), np.concatenate(keys)
    chosen = np.sort(np.argpartition(order, size)[:size]) if len(order) > size else np.arange(len(order))
    return [points[chosen]], [order[chosen]]


def minibatch_centres(blocks: Blocks, clusters: int, seed: int) -> Floats:
    """[at most `clusters`, F]: centres of the features that `blocks` gives. The same seed and features give the same centres, however
    the features are cut into blocks."""
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
            own = np.bincount(labels, minlength=len(centres)).astype(np.float64)
            sums = np.zeros_like(centres)
            np.add.at(sums, labels, batch)
            moved = own > 0.0
            counts += own
            rate = (own[moved] / counts[moved])[:, None]
            centres[moved] += rate * (sums[moved] / own[moved][:, None] - centres[moved])
    return centres


def _batches(blocks: Blocks) -> Iterable[Floats]:
    """The features BATCH at a time, whatever blocks they come in."""
    waiting: list[Floats] = []
    held = 0
    for block in blocks():
        waiting.append(block)
        held += len(block)
        while held >= BATCH:
            together = np.concatenate(waiting)
            yield together[:BATCH]
            waiting, held = [together[BATCH:]], held - BATCH
    if held:
        yield np.concatenate(waiting)


def nearest(points: Floats, centres: Floats) -> Labels:
    """[rows] int64: the centre that is nearest to each of `points` [rows, F]."""
    found = np.zeros(len(points), np.int64)
    step = max(1, LARGEST_DISTANCES // max(1, len(centres)))
    norms = np.einsum("ij,ij->i", centres, centres)
    for first in range(0, len(points), step):
        part = points[first : first + step]
        found[first : first + step] = (norms - 2.0 * part @ centres.T).argmin(1)
    return found


def balanced_labels(blocks: Blocks, centres: Floats, count: int, slack: float = SLACK) -> Labels:
    """[count] int64: for each feature a near centre, none of which gets more than `slack` times the mean, rounded up.

    Features whose nearest centre is full go to the nearest one that has room, those that come first first.
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
    """[count] int64: a group for each of `count` features, about `clusters` groups in all, none of them much larger than `slack`
    times the mean. The same seed and features give the same groups."""
    coarse = clusters if clusters <= FLAT_CLUSTERS else int(np.ceil(np.sqrt(clusters)))
    centres = minibatch_centres(blocks, coarse, seed)
    if clusters <= FLAT_CLUSTERS:
        return balanced_labels(blocks, centres, count, slack)
    outer = np.concatenate([nearest(batch, centres) for batch in _batches(blocks)]) if count else np.zeros(0, np.int64)
    labels, first = np.zeros(count, np.int64), 0
    for members, points in _parts(blocks, outer, len(centres)):
        own = max(1, round(clusters * len(members) / count))
        inner = minibatch_centres(partial(iter, [points]), own, seed)
        labels[members] = first + balanced_labels(partial(iter, [points]), inner, len(members), slack)
        first += len(inner)
    return labels


def _parts(blocks: Blocks, outer: Labels, clusters: int) -> Iterable[tuple[Labels, Floats]]:
    """(places, features) of each cluster; as many clusters together as LARGEST_HELD allows, with a pass over all features each."""
    sizes = np.bincount(outer, minlength=clusters)
    width = next((block.shape[1] for block in blocks() if len(block)), 1)
    begin = 0
    while begin < clusters:
        end, held = begin + 1, int(sizes[begin]) * width
        while end < clusters and held + int(sizes[end]) * width <= LARGEST_HELD:
            held += int(sizes[end]) * width
            end += 1
        found: dict[int, list[Floats]] = {label: [] for label in range(begin, end)}
        place = 0
        for block in blocks():
            own = outer[place : place + len(block)]
            for label in np.unique(own[(own >= begin) & (own < end)]):
                found[int(label)].append(np.array(block[own == label]))
            place += len(block)
        for label, points in found.items():
            if points:
                yield np.flatnonzero(outer == label), np.concatenate(points)
        begin = end
