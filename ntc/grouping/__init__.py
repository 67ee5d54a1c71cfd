"""Groupings: which textures share a decoder. One file for each way of finding groups."""

from collections.abc import Sequence

from ntc.config import GroupingName
from ntc.errors import InputError
from ntc.pack import Grouping
from ntc.textures import SourceTexture

__all__ = ["make_grouping"]

LARGEST_SEED = 2**32 - 1
"""Largest seed that numpy and scikit-learn both take."""


def make_grouping(name: GroupingName, textures: Sequence[SourceTexture], clusters: int, seed: int) -> Grouping:
    """The grouping called `name`; `clusters` groups (at most one for each texture) where it takes a number.

    Raises InputError for a number below 1, a seed out of range or a grouping that is not built.
    """
    if clusters < 1:
        raise InputError(f"--clusters {clusters}: must be at least 1")
    if name == "baseline":
        return Grouping(name, tuple(range(len(textures))))
    if name == "single":
        return Grouping(name, (0,) * len(textures))
    if not 0 <= seed <= LARGEST_SEED:
        raise InputError(f"--seed {seed}: must be 0 to {LARGEST_SEED}")
    # scikit-learn takes a second to import; the two groupings above do not need it.
    from ntc.grouping.clustered import clustered_grouping
    from ntc.grouping.random import random_grouping

    clustered = clustered_grouping(textures, min(clusters, len(textures)), seed)
    if name == "clustered":
        return clustered
    if name == "random":
        return random_grouping(clustered, seed)
    raise InputError(f"--grouping {name}: not available; choose baseline, single, random or clustered")
