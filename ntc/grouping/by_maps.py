"""Groups for textures with different maps: a decoder serves one kind of them, wherever a grouping is free to choose.

A group's tables stand for all channels of a block together. A texture that lacks some of them would take rows of the basis that
the others have no use for.
"""

from collections.abc import Callable, Sequence
from typing import Any

from ntc.codec.model import Grouping
from ntc.codec.textures import SourceTexture

SubGrouping = Callable[[Sequence[int], int], Grouping]
"""(indices of textures of one kind, groups) -> their grouping."""


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


def grouping_by_kind(name: str, kinds: Sequence[Sequence[int]], clusters: int, sub_grouping: SubGrouping) -> Grouping:
    """Return the groupings that `sub_grouping` finds for each of `kinds`, as one called `name`; its parameters are those of the first
    kind, with the number of all groups and of kinds."""
    labels: dict[int, tuple[int, int]] = {}
    found = []
    for kind, (members, given) in enumerate(zip(kinds, shared_groups(list(map(len, kinds)), clusters), strict=True)):
        found.append(sub_grouping(members, given))
        labels.update((index, (kind, group)) for index, group in zip(members, found[-1].groups, strict=True))
    parameters = {**found[0].parameters, "clusters": sum(each.group_count for each in found), "kinds": len(kinds)}
    return Grouping.of_labels(name, [labels[index] for index in range(len(labels))], parameters)
