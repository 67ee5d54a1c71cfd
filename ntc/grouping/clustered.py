"""Grouping by k-means over features (paper, Sec. 3), and its control: random groups of the same sizes (paper, Table 1)."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from ntc.codec.config import FeatureName
from ntc.codec.model import Grouping
from ntc.grouping.kmeans import kmeans_labels
from ntc.grouping.minibatch import minibatch_labels

RESTARTS = 20
LARGEST_EXACT = 1 << 22
"""Distances between textures and centres up to which all textures are looked at together (4000 textures in 1000 groups)."""
BLOCK = 4096
"""Textures of a block, beyond that."""


def clustered_grouping(features: NDArray[np.float64], name: FeatureName, clusters: int, seed: int) -> Grouping:
    """k-means over `features` [textures, F], called `name`: the best of 20 restarts, groups numbered in the order of
    their first texture.

    Textures with equal features cannot be told apart, so there are no more groups than distinct features. Where textures times groups
    are more than LARGEST_EXACT, groups are found in mini-batches, and are of bounded size (`ntc.grouping.minibatch`).
    """
    clusters = min(clusters, len(np.unique(features, axis=0)))
    parameters: dict[str, object] = {"clusters": clusters, "features": name, "seed": seed}
    if len(features) * clusters <= LARGEST_EXACT:
        labels = kmeans_labels(features, clusters, RESTARTS, seed)
    else:
        labels = minibatch_labels(lambda: _blocks(features), len(features), clusters, seed)
        parameters["minibatch"] = True
    return Grouping.of_labels("clustered", labels.tolist(), parameters)


def _blocks(features: NDArray[np.float64]) -> Iterator[NDArray[np.float64]]:
    for first in range(0, len(features), BLOCK):
        yield features[first : first + BLOCK]


def random_grouping(like: Grouping, seed: int) -> Grouping:
    """As many groups of the same sizes as `like` has, with the textures shuffled. The same seed gives the same groups;
    they are numbered by their first texture."""
    shuffled = np.random.default_rng(seed).permutation(np.array(like.groups, dtype=np.int64))
    parameters = {"clusters": like.group_count, "sizes_of": like.name, "seed": seed}
    return Grouping.of_labels("random", shuffled.tolist(), parameters)
