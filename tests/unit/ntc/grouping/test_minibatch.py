"""k-means in mini-batches: near what all features at once give, whatever blocks they come in, in groups of bounded size."""

from collections.abc import Iterator
from functools import partial

import numpy as np
import pytest
from numpy.typing import NDArray

from ntc.grouping import clustered as minibatch
from ntc.grouping.clustered import (
    balanced_labels,
    clustered_grouping,
    kmeans_labels,
    minibatch_centres,
    minibatch_labels,
    nearest,
)

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


@pytest.mark.parametrize("clusters", [3, 12, 40])
def test_groups_are_nearly_as_tight_as_those_of_all_features_at_once(clusters: int) -> None:
    points = clouds(6000, clusters)
    labels = kmeans_labels(points, clusters, 3, 0)
    whole = np.stack([points[labels == label].mean(0) for label in range(clusters)])
    centres = minibatch_centres(lambda: in_blocks(points, 500), clusters, 0)
    assert len(centres) == clusters
    assert spread(points, centres) <= 1.35 * spread(points, whole)


def test_blocks_make_no_difference() -> None:
    points = clouds(3000, 8)
    found = [minibatch_centres(partial(in_blocks, points, size), 8, 4) for size in (1, 700, 3000)]
    assert np.array_equal(found[0], found[1])
    assert np.array_equal(found[0], found[2])
    labels = [balanced_labels(partial(in_blocks, points, size), found[0], 3000) for size in (64, 3000)]
    assert np.array_equal(labels[0], labels[1])


def test_no_group_is_larger_than_its_bound() -> None:
    points = np.concatenate([clouds(900, 1), clouds(100, 9, 5)])
    centres = minibatch_centres(lambda: in_blocks(points, 100), 10, 0)
    for slack in (1.0, 1.5, 3.0):
        labels = balanced_labels(lambda: in_blocks(points, 100), centres, len(points), slack)
        sizes = np.bincount(labels, minlength=10)
        assert sizes.sum() == 1000
        assert sizes.max() <= np.ceil(slack * 1000 / len(centres))


@pytest.mark.parametrize("count", [0, 1, 5])
def test_few_or_equal_features_give_few_groups(count: int) -> None:
    points = np.ones((count, 3))
    assert len(minibatch_centres(lambda: iter([points]), 4, 0)) == min(count, 1)


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
