"""Grouping by k-means over features (paper, Sec. 3), and its control: random groups of the same sizes (paper, Table 1)."""

import numpy as np
from numpy.typing import NDArray

from ntc.codec.config import FeatureName
from ntc.codec.model import Grouping
from ntc.grouping.kmeans import kmeans_labels

RESTARTS = 20


def clustered_grouping(features: NDArray[np.float64], name: FeatureName, clusters: int, seed: int) -> Grouping:
    """k-means over `features` [textures, F], called `name`: the best of 20 restarts, groups numbered in the order of
    their first texture.

    Textures with equal features cannot be told apart, so there are no more groups than distinct features.
    """
    clusters = min(clusters, len(np.unique(features, axis=0)))
    labels = kmeans_labels(features, clusters, RESTARTS, seed)
    parameters = {"clusters": clusters, "features": name, "seed": seed}
    return Grouping.of_labels("clustered", labels.tolist(), parameters)


def random_grouping(like: Grouping, seed: int) -> Grouping:
    """As many groups of the same sizes as `like` has, with the textures shuffled. The same seed gives the same groups;
    they are numbered by their first texture."""
    shuffled = np.random.default_rng(seed).permutation(np.array(like.groups, dtype=np.int64))
    parameters = {"clusters": like.group_count, "sizes_of": like.name, "seed": seed}
    return Grouping.of_labels("random", shuffled.tolist(), parameters)
