"""k-means: the groups of scikit-learn for the same seed, and in mini-batches nearly as tight ones."""

from collections.abc import Iterator
from functools import partial

import numpy as np
import pytest
from numpy.typing import NDArray

from ntc.codec.model import Grouping
from ntc.grouping import clustered as minibatch
from ntc.grouping.clustered import (
    balanced_labels,
    clustered_grouping,
    kmeans_labels,
    minibatch_centres,
    minibatch_labels,
    nearest,
)


def groups_of(labels: list[int]) -> tuple[int, ...]:
    """Without the names of the groups."""
    return Grouping.of_labels("any", labels, {}).groups


@pytest.mark.parametrize(("rows", "columns", "clusters"), [(2, 3, 1), (9, 2, 9), (30, 1, 5), (120, 40, 12)])
@pytest.mark.parametrize("seed", [0, 7])
def test_a_seed_gives_the_groups_of_scikit_learn(rows: int, columns: int, clusters: int, seed: int) -> None:
    cluster = pytest.importorskip("sklearn.cluster")
    random = np.random.default_rng(seed)
    features = random.normal(size=(rows, columns)) * random.uniform(0.1, 3.0, columns)
    features += random.integers(0, 3, (rows, 1)) * 2.0
    expected = cluster.KMeans(n_clusters=clusters, n_init=20, random_state=seed).fit(features).labels_
    assert groups_of(kmeans_labels(features, clusters, 20, seed).tolist()) == groups_of(expected.tolist())


@pytest.mark.parametrize("clusters", [1, 2, 5])
def test_every_cluster_has_a_row_and_every_row_its_nearest_mean(clusters: int) -> None:
    # Many equal rows, so that centres lose all of theirs on the way.
    features = np.repeat(np.random.default_rng(2).integers(0, 3, (6, 2)).astype(np.float64), 4, axis=0)
    clusters = min(clusters, len(np.unique(features, axis=0)))
    labels = kmeans_labels(features, clusters, 20, 0)
    assert sorted(set(labels.tolist())) == list(range(clusters))
    centres = np.stack([features[labels == cluster].mean(0) for cluster in range(clusters)])
    distances = np.square(features[:, None] - centres).sum(2)
    np.testing.assert_allclose(distances[np.arange(len(features)), labels], distances.min(1), atol=1e-9)


Floats = NDArray[np.float64]


def clouds(count: int, clusters: int, seed: int = 0) -> Floats:
    """[count, 5] around `clusters` places."""
    random = np.random.default_rng(seed)
    places = random.normal(0.0, 6.0, (clusters, 5))
    return places[random.integers(0, clusters, count)] + random.normal(0.0, 1.0, (count, 5))


def spread(points: Floats, centres: Floats) -> float:
    """Mean squared distance to the nearest centre."""
    return float(np.square(points - centres[nearest(points, centres)]).sum(1).mean())


def in_blocks(points: Floats, size: int) -> Iterator[Floats]:
    for first in range(0, len(points), size):
        yield points[first : first + size]


def test_blocks_make_no_difference() -> None:
    points = clouds(3000, 8)
    found = [minibatch_centres(partial(in_blocks, points, size), 8, 4) for size in (1, 700, 3000)]
    assert np.array_equal(found[0], found[1])
    assert np.array_equal(found[0], found[2])
    labels = [balanced_labels(partial(in_blocks, points, size), found[0], 3000) for size in (64, 3000)]
    assert np.array_equal(labels[0], labels[1])
    # Few or equal features give few groups.
    for count in (0, 1, 5):
        assert len(minibatch_centres(partial(in_blocks, np.ones((count, 3)), 8), 4, 0)) == min(count, 1)


def test_no_group_is_larger_than_its_bound() -> None:
    points = np.concatenate([clouds(900, 1), clouds(100, 9, 5)])
    centres = minibatch_centres(lambda: in_blocks(points, 100), 10, 0)
    for slack in (1.0, 1.5, 3.0):
        labels = balanced_labels(lambda: in_blocks(points, 100), centres, len(points), slack)
        sizes = np.bincount(labels, minlength=10)
        assert sizes.sum() == 1000
        assert sizes.max() <= np.ceil(slack * 1000 / len(centres))


def test_many_groups_are_found_in_two_levels(monkeypatch: pytest.MonkeyPatch) -> None:
    points = clouds(6000, 50)
    labels = minibatch_labels(lambda: in_blocks(points, 512), 6000, 400, 2)
    sizes = np.bincount(labels)
    assert 330 <= len(sizes) <= 470
    assert sizes.max() <= 2.5 * 6000 / 400
    means = np.stack([points[labels == label].mean(0) for label in range(len(sizes)) if sizes[label]])
    assert spread(points, means) < 0.6 * spread(points, minibatch_centres(lambda: in_blocks(points, 512), 50, 2))
    # What is held at a time makes no difference.
    monkeypatch.setattr(minibatch, "LARGEST_HELD", 3000)
    assert np.array_equal(minibatch_labels(lambda: in_blocks(points, 100), 6000, 400, 2), labels)


def test_clustered_groupings_go_over_to_it_where_textures_are_many() -> None:
    points = clouds(9000, 30)
    grouping = clustered_grouping(points, "low_level", 500, 0)
    assert grouping.parameters["minibatch"] is True
    assert len(grouping.groups) == 9000
    assert max(np.bincount(grouping.groups)) <= 2.5 * 9000 / 500
    assert "minibatch" not in clustered_grouping(points[:500], "low_level", 8, 0).parameters
