"""k-means: the groups of scikit-learn for the same seed, and what holds of any of them."""

import numpy as np
import pytest

from ntc.codec.model import Grouping
from ntc.grouping.clustered import kmeans_labels


def groups_of(labels: list[int]) -> tuple[int, ...]:
    """Without the names of the groups."""
    return Grouping.of_labels("any", labels, {}).groups


@pytest.mark.parametrize(
    ("rows", "columns", "clusters"), [(2, 3, 1), (9, 2, 9), (30, 1, 5), (55, 17, 10), (40, 31, 20), (120, 40, 12)]
)
@pytest.mark.parametrize("seed", [0, 7])
def test_a_seed_gives_the_groups_of_scikit_learn(rows: int, columns: int, clusters: int, seed: int) -> None:
    cluster = pytest.importorskip("sklearn.cluster")
    random = np.random.default_rng(seed)
    features = random.normal(size=(rows, columns)) * random.uniform(0.1, 3.0, columns)
    features += random.integers(0, 3, (rows, 1)) * 2.0
    expected = cluster.KMeans(n_clusters=clusters, n_init=20, random_state=seed).fit(features).labels_
    assert groups_of(kmeans_labels(features, clusters, 20, seed).tolist()) == groups_of(expected.tolist())


def test_groups_that_are_far_apart_are_found_whatever_the_seed() -> None:
    features = np.random.default_rng(1).normal(size=(60, 4)) + 50.0 * (np.arange(60) % 3)[:, None]
    for seed in range(5):
        assert groups_of(kmeans_labels(features, 3, 3, seed).tolist()) == tuple(i % 3 for i in range(60))


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


def test_the_same_seed_gives_the_same_groups() -> None:
    features = np.random.default_rng(3).normal(size=(50, 6))
    first = kmeans_labels(features, 8, 4, 5)
    np.testing.assert_array_equal(first, kmeans_labels(features, 8, 4, 5))
    assert features.flags.writeable
