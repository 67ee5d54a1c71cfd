"""Groupings: which textures share a decoder. One file for each way of finding groups.

Where a grouping is free to choose, a decoder serves textures with the same maps. A group's tables stand for all channels of a block
together: a texture that lacks some would take rows of the basis that the others have no use for.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ntc.codec.config import DEFAULT_CLUSTERS, UNIVERSAL, GroupingConfig, GroupingName
from ntc.codec.model import Grouping
from ntc.codec.registry import codec_named, shipping_codec
from ntc.codec.textures import SourceTexture
from ntc.errors import InputError
from ntc.features import FeatureOptions, feature_matrix

__all__ = ["GroupingInputs", "kinds_of", "make_grouping"]

LARGEST_SEED = 2**32 - 1
"""Largest seed that all of numpy's generators take."""


@dataclass(frozen=True, eq=False)
class GroupingInputs:
    """Inputs of groupings besides the textures."""

    views: Sequence[NDArray[np.int32]] = ()
    """Views for covisible: pictures of texture ids, each [H, W] int32, row 0 on top, -1 for none; id = index of the texture."""
    labels: Mapping[int, str] = field(default_factory=dict)
    """Categories for category, by index of the texture; they come before the textures' own (`ntc.grouping.category.read_labels`)."""
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
    """Return the grouping that `config` describes, of `textures`. The same seed and inputs give the same groups.

    Raises InputError for a number out of range, more groups than textures, features that cannot be had, and
    covisible without views in which two textures meet.
    """
    _check(config)
    if config.name == "baseline":
        return Grouping("baseline", tuple(range(len(textures))))
    if config.name == "single":
        return Grouping("single", (0,) * len(textures))
    if config.name == UNIVERSAL:
        codec = codec_named(shipping_codec())
        return Grouping(UNIVERSAL, codec.shipped_groups(textures, config.clusters), dict(codec.shipped))
    if config.name == "category":
        from ntc.grouping.category import category_grouping

        return category_grouping(textures, inputs.labels)
    clusters = _cluster_count(config, len(textures))
    if not textures:
        return Grouping(config.name, ())
    kinds = kinds_of(textures)
    if not 1 < len(kinds) <= clusters:
        return _found_grouping(config, clusters, textures, inputs)

    def of_kind(members: Sequence[int], groups: int) -> Grouping:
        own, views = [textures[index] for index in members], _views_of(inputs.views, members)
        # Textures of a kind that are never seen together are told apart by features alone.
        name: GroupingName = "clustered" if config.name == "covisible" and not _meet(views, len(own)) else config.name
        return _found_grouping(replace(config, name=name), groups, own, replace(inputs, views=views))

    if config.name == "covisible":
        _check_views(inputs, len(textures))
    return _measured(grouping_by_kind(config.name, kinds, clusters, of_kind), inputs)


def _meet(views: Sequence[NDArray[np.int32]], textures: int) -> bool:
    """Return whether any block of the views shows two of so many textures."""
    from ntc.grouping.covisible import seen_blocks

    return bool(len(seen_blocks(views, textures).weights))


def _check_views(inputs: GroupingInputs, textures: int) -> None:
    if not inputs.views:
        raise InputError("--grouping covisible: needs views; encode a scene, or name a cameras file by --views")
    if not _meet(inputs.views, textures):
        raise InputError("--views: no block of any view shows two textures; there is nothing to group by")


def _views_of(views: Sequence[NDArray[np.int32]], members: Sequence[int]) -> list[NDArray[np.int32]]:
    """Return `views` with the textures `members` alone, which are numbered anew."""
    if not views:
        return []
    numbers = np.full(max([*members, *(int(view.max(initial=-1)) for view in views)]) + 2, -1, np.int32)
    numbers[list(members)] = np.arange(len(members))
    # The last number stands for -1.
    return [numbers[view] for view in views]


def _measured(grouping: Grouping, inputs: GroupingInputs) -> Grouping:
    """Return `grouping` with what is recorded of all textures where it was found by kind."""
    if grouping.name != "covisible":
        return grouping
    from ntc.grouping.covisible import seen_blocks

    seen = seen_blocks(inputs.views, len(grouping.groups))
    excess = {
        "excess": seen.excess(np.array(grouping.groups)),
        "baseline_excess": seen.excess(np.arange(len(grouping.groups))),
    }
    return replace(grouping, parameters={**grouping.parameters, **excess})


def _found_grouping(
    config: GroupingConfig, clusters: int, textures: Sequence[SourceTexture], inputs: GroupingInputs
) -> Grouping:
    """Group textures that may share a decoder: by features, and for covisible by views."""
    if config.name == "covisible":
        return _covisible(config, clusters, textures, inputs)
    features = feature_matrix(config.features, textures, inputs.features)
    from ntc.grouping.clustered import clustered_grouping, random_grouping

    clustered = clustered_grouping(features, config.features, clusters, config.seed)
    return random_grouping(clustered, config.seed) if config.name == "random" else clustered


def _covisible(
    config: GroupingConfig, clusters: int, textures: Sequence[SourceTexture], inputs: GroupingInputs
) -> Grouping:
    from ntc.grouping.covisible import CovisibleConfig, covisible_grouping, seen_blocks

    _check_views(inputs, len(textures))
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


def kinds_of(textures: Sequence[SourceTexture]) -> list[list[int]]:
    """Return the indices of `textures` by their maps, in the order of the first of each kind."""
    found: dict[Any, list[int]] = {}
    for index, texture in enumerate(textures):
        found.setdefault(texture.maps, []).append(index)
    return list(found.values())


def shared_groups(counts: Sequence[int], groups: int) -> list[int]:
    """Return how many of `groups` groups each kind of so many textures gets: one at least, and further ones where the most textures
    share one. `groups` is at least the number of kinds and at most that of textures."""
    given = [1] * len(counts)
    for _ in range(groups - len(counts)):
        number = max(range(len(counts)), key=lambda kind: (counts[kind] / given[kind], -kind))
        given[number] += 1
    return given


def grouping_by_kind(
    name: str, kinds: Sequence[Sequence[int]], clusters: int, sub_grouping: Callable[[Sequence[int], int], Grouping]
) -> Grouping:
    """Return the groupings that `sub_grouping` finds for each of `kinds`, as one called `name`; its parameters are those of the first
    kind, with the number of all groups and of kinds. `sub_grouping` takes indices of textures and a number of groups."""
    labels: dict[int, tuple[int, int]] = {}
    found = []
    for kind, (members, given) in enumerate(zip(kinds, shared_groups(list(map(len, kinds)), clusters), strict=True)):
        found.append(sub_grouping(members, given))
        labels.update((index, (kind, group)) for index, group in zip(members, found[-1].groups, strict=True))
    parameters = {**found[0].parameters, "clusters": sum(each.group_count for each in found), "kinds": len(kinds)}
    return Grouping.of_labels(name, [labels[index] for index in range(len(labels))], parameters)
