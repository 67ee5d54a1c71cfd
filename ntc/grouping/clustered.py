"""Grouping by k-means over low-level features (paper, Sec. 3, with other features than its CLIP embedding)."""

from collections.abc import Sequence

import numpy as np
from sklearn.cluster import KMeans

from ntc.features.low_level import feature_matrix
from ntc.grouping.order import in_order_of_appearance
from ntc.pack import Grouping
from ntc.textures import SourceTexture

RESTARTS = 20


def clustered_grouping(textures: Sequence[SourceTexture], clusters: int, seed: int) -> Grouping:
    """k-means with `clusters` groups, the best of 20 restarts; groups numbered in the order of their first texture.

    Textures with equal features cannot be told apart, so there are no more groups than distinct features.
    """
    if not textures:
        return Grouping("clustered", ())
    features = feature_matrix(textures)
    clusters = min(clusters, len(np.unique(features, axis=0)))
    labels = KMeans(n_clusters=clusters, n_init=RESTARTS, random_state=seed).fit(features).labels_
    parameters = {"clusters": clusters, "features": "low_level", "seed": seed}
    return Grouping("clustered", in_order_of_appearance(labels.tolist()), parameters)
