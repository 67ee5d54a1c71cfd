"""Groupings: which textures share a decoder. Each algorithm has a file.

Groupings that choose freely put textures with the same maps together. A basis of codec `block` spans all channels at once: a texture
that lacks some would use rows of the basis that the others do not need.
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
    """Inputs of groupings in addition to the textures: views, labels, and options of features."""

    views: Sequence[NDArray[np.int32]] = ()
    """Views for `covisible`: each [H, W] int32 texture indices, row 0 on top, -1 for none."""
    labels: Mapping[int, str] = field(default_factory=dict)
    """Labels for `category`, by index of the texture. They override the scene's (`ntc.grouping.category.read_labels`)."""
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
    """Return the grouping of `textures` that `config` describes. The same seed and inputs give the same groups.

    Raises InputError for a number out of range, more groups than textures, features whose package or weights are missing, and
    `covisible` without views in which two textures share a block.
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
        return _searched_grouping(config, clusters, textures, inputs)

    def of_kind(members: Sequence[int], groups: int) -> Grouping:
        of_kind_textures, views = [textures[index] for index in members], _views_of(inputs.views, members)
        # Without two textures of this kind in one block there is no excess to cut, so features alone decide.
        is_unseen = config.name == "covisible" and not _meet(views, len(members))
        name: GroupingName = "clustered" if is_unseen else config.name
        return _searched_grouping(replace(config, name=name), groups, of_kind_textures, replace(inputs, views=views))

    if config.name == "covisible":
        _check_views(inputs, len(textures))
    return _measured(grouping_by_kind(config.name, kinds, clusters, of_kind), inputs)


def _meet(views: Sequence[NDArray[np.int32]], textures: int) -> bool:
    """Return whether any block of the views shows two of the `textures` textures."""
    from ntc.grouping.covisible import seen_blocks

    return bool(len(seen_blocks(views, textures).weights))


def _check_views(inputs: GroupingInputs, textures: int) -> None:
    if not inputs.views:
        raise InputError("--grouping covisible: needs views; encode a scene, or name a cameras file by --views")
    if not _meet(inputs.views, textures):
        raise InputError("--views: no block of any view shows two textures; there is nothing to group by")


def _views_of(views: Sequence[NDArray[np.int32]], members: Sequence[int]) -> list[NDArray[np.int32]]:
    """Return `views` with the textures `members` alone, renumbered from 0 in their order; -1 elsewhere."""
    if not views:
        return []
    numbers = np.full(max([*members, *(int(view.max(initial=-1)) for view in views)]) + 2, -1, np.int32)
    numbers[list(members)] = np.arange(len(members))
    # Index -1 of a view reads the last entry, which is -1.
    return [numbers[view] for view in views]


def _measured(grouping: Grouping, inputs: GroupingInputs) -> Grouping:
    """Return `grouping` with the excess of all textures as parameters, if it is a `covisible` grouping made kind by kind."""
    if grouping.name != "covisible":
        return grouping
    from ntc.grouping.covisible import seen_blocks

    seen = seen_blocks(inputs.views, len(grouping.groups))
    excess = {
        "excess": seen.excess(np.array(grouping.groups)),
        "baseline_excess": seen.excess(np.arange(len(grouping.groups))),
    }
    return replace(grouping, parameters={**grouping.parameters, **excess})


def _searched_grouping(
    config: GroupingConfig, clusters: int, textures: Sequence[SourceTexture], inputs: GroupingInputs
) -> Grouping:
    """Return a grouping of textures of one kind: by features, and for `covisible` by views."""
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
    grouping = covisible_grouping(seen, features, search)
    return Grouping(grouping.name, grouping.groups, {**grouping.parameters, "features": config.features})


def kinds_of(textures: Sequence[SourceTexture]) -> list[list[int]]:
    """Return the indices of `textures` by kind, that is, by equal maps; kinds in the order of their first texture."""
    kinds: dict[Any, list[int]] = {}
    for index, texture in enumerate(textures):
        kinds.setdefault(texture.maps, []).append(index)
    return list(kinds.values())


def shared_groups(counts: Sequence[int], groups: int) -> list[int]:
    """Return how many of `groups` groups each kind gets; `counts` are the kinds' numbers of textures.

    Each kind gets one. Each further group goes to the kind with the most textures per group. `groups` is at least the number of kinds
    and at most that of textures.
    """
    given = [1] * len(counts)
    for _ in range(groups - len(counts)):
        number = max(range(len(counts)), key=lambda kind: (counts[kind] / given[kind], -kind))
        given[number] += 1
    return given


def grouping_by_kind(
    name: str, kinds: Sequence[Sequence[int]], clusters: int, sub_grouping: Callable[[Sequence[int], int], Grouping]
) -> Grouping:
    """Return one grouping called `name`, joined from the groupings of each kind.

    `sub_grouping` takes indices of textures and a number of groups. The parameters are those of the first kind, with the number of all
    groups and of kinds.
    """
    labels: dict[int, tuple[int, int]] = {}
    parts: list[Grouping] = []
    for kind, (members, given) in enumerate(zip(kinds, shared_groups(list(map(len, kinds)), clusters), strict=True)):
        parts.append(sub_grouping(members, given))
        labels.update((index, (kind, group)) for index, group in zip(members, parts[-1].groups, strict=True))
    parameters = {**parts[0].parameters, "clusters": sum(each.group_count for each in parts), "kinds": len(kinds)}
    return Grouping.of_labels(name, [labels[index] for index in range(len(labels))], parameters)
