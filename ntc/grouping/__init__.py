"""Groupings: which textures share a decoder. One file for each way of finding groups."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ntc.config import GroupingName
from ntc.errors import InputError
from ntc.pack import Grouping
from ntc.textures import SourceTexture

__all__ = ["make_grouping"]

LARGEST_SEED = 2**32 - 1
"""Largest seed that numpy and scikit-learn both take."""


def make_grouping(
    name: GroupingName,
    textures: Sequence[SourceTexture],
    clusters: int,
    seed: int,
    views: Sequence[NDArray[np.int32]] | None = None,
) -> Grouping:
    """The grouping called `name`; `clusters` groups (at most one for each texture) where it takes a number.

    `views` are pictures of texture ids ([H, W] int32, -1 for none; id = index in `textures`) for `covisible`.
    Raises InputError for a number below 1, a seed out of range, or `covisible` without views that show something.
    """
    if clusters < 1:
        raise InputError(f"--clusters {clusters}: must be at least 1")
    if name == "baseline":
        return Grouping(name, tuple(range(len(textures))))
    if name == "single":
        return Grouping(name, (0,) * len(textures))
    if not 0 <= seed <= LARGEST_SEED:
        raise InputError(f"--seed {seed}: must be 0 to {LARGEST_SEED}")
    if name == "category":
        from ntc.grouping.category import category_grouping

        return category_grouping(textures)
    if name == "covisible":
        return _covisible(textures, clusters, seed, views)
    # scikit-learn takes a second to import; the two groupings above do not need it.
    from ntc.grouping.clustered import clustered_grouping
    from ntc.grouping.random import random_grouping

    clustered = clustered_grouping(textures, min(clusters, len(textures)), seed)
    return random_grouping(clustered, seed) if name == "random" else clustered


def _covisible(
    textures: Sequence[SourceTexture], clusters: int, seed: int, views: Sequence[NDArray[np.int32]] | None
) -> Grouping:
    from ntc.features.low_level import feature_matrix
    from ntc.grouping.covisible import CovisibleConfig, covisible_grouping
    from ntc.grouping.seen_blocks import seen_blocks

    if not views:
        raise InputError("--grouping covisible: needs views; name a cameras file by --views, or a scene with cameras")
    seen = seen_blocks(views, len(textures))
    return covisible_grouping(seen, feature_matrix(textures), CovisibleConfig(clusters=clusters, seed=seed))
