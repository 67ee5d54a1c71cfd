"""Groupings: which textures share a decoder. One file for each way of finding groups."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ntc.codec.block.universal import universal_parameters
from ntc.codec.config import DEFAULT_CLUSTERS, GroupingConfig
from ntc.codec.model import Grouping
from ntc.codec.textures import SourceTexture
from ntc.errors import InputError
from ntc.features import FeatureOptions, feature_matrix

__all__ = ["GroupingInputs", "make_grouping"]

LARGEST_SEED = 2**32 - 1
"""Largest seed that all of numpy's generators take."""


@dataclass(frozen=True, eq=False)
class GroupingInputs:
    """What groupings may look at besides the textures."""

    views: Sequence[NDArray[np.int32]] = ()
    """For covisible: pictures of texture ids, each [H, W] int32, row 0 on top, -1 for none; id = index of the texture."""
    labels: Mapping[int, str] = field(default_factory=dict)
    """For category: category by index of the texture; they come before the textures' own (`ntc.grouping.category.read_labels`)."""
    features: FeatureOptions = field(default_factory=FeatureOptions)


def _cluster_count(config: GroupingConfig, textures: int) -> int:
    if config.clusters is None:
        return min(DEFAULT_CLUSTERS, textures)
    if textures and config.clusters > textures:
        raise InputError(
            f"--clusters {config.clusters}: there are only {textures} textures; "
            f"at most {textures} groups, or --grouping baseline for one each"
        )
    return config.clusters


def _check(config: GroupingConfig) -> None:
    if config.clusters is not None and config.clusters < 1:
        raise InputError(f"--clusters {config.clusters}: must be at least 1")
    if not 0 <= config.seed <= LARGEST_SEED:
        raise InputError(f"--seed {config.seed}: must be 0 to {LARGEST_SEED}")
    if not (math.isfinite(config.spread_weight) and config.spread_weight >= 0.0):
        raise InputError(f"--spread-weight {config.spread_weight}: must be 0 or more")
    if not 0.0 < config.largest_share <= 1.0:
        raise InputError(f"--largest-share {config.largest_share}: must lie above 0 and at most at 1")


def make_grouping(
    config: GroupingConfig, textures: Sequence[SourceTexture], inputs: GroupingInputs = GroupingInputs()
) -> Grouping:
    """The grouping that `config` describes, of `textures`. The same seed and inputs give the same groups.

    Raises InputError for a number out of range, more groups than textures, features that cannot be had, and
    covisible without views in which two textures meet.
    """
    _check(config)
    if config.name == "baseline":
        return Grouping("baseline", tuple(range(len(textures))))
    if config.name == "single":
        return Grouping("single", (0,) * len(textures))
    if config.name == "universal":
        return Grouping("universal", (0,) * len(textures), universal_parameters())
    if config.name == "category":
        from ntc.grouping.category import category_grouping

        return category_grouping(textures, inputs.labels)
    clusters = _cluster_count(config, len(textures))
    if not textures:
        return Grouping(config.name, ())
    if config.name == "covisible":
        return _covisible(config, clusters, textures, inputs)
    features = feature_matrix(config.features, textures, inputs.features)
    from ntc.grouping.clustered import clustered_grouping, random_grouping

    clustered = clustered_grouping(features, config.features, clusters, config.seed)
    return random_grouping(clustered, config.seed) if config.name == "random" else clustered


def _covisible(
    config: GroupingConfig, clusters: int, textures: Sequence[SourceTexture], inputs: GroupingInputs
) -> Grouping:
    from ntc.grouping.covisible import CovisibleConfig, covisible_grouping
    from ntc.grouping.seen_blocks import seen_blocks

    if not inputs.views:
        raise InputError("--grouping covisible: needs views; encode a scene, or name a cameras file by --views")
    seen = seen_blocks(inputs.views, len(textures))
    features = feature_matrix(config.features, textures, inputs.features)
    search = CovisibleConfig(
        clusters=clusters,
        largest_share=config.largest_share,
        spread_weight=config.spread_weight,
        seed=config.seed,
    )
    found = covisible_grouping(seen, features, search)
    return Grouping(found.name, found.groups, {**found.parameters, "features": config.features})
