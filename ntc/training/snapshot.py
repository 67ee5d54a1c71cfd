"""Snapshots of groups under training, and packs in which groups are replaced one by one. Needs no torch."""

from dataclasses import dataclass, replace

from ntc.codec.config import UNIVERSAL
from ntc.codec.model import Decoder, EncodedTexture, Grouping, Pack
from ntc.errors import InputError


@dataclass(frozen=True, eq=False)
class GroupSnapshot:
    """A group as a pack stores it, at one moment of its training."""

    version: int
    """1 for the first of this group in a training, then one more each time."""
    group: int
    """Its number in the grouping that is trained for."""
    members: tuple[int, ...]
    """Indices of its textures."""
    textures: tuple[EncodedTexture, ...]
    """The members; in codec `grid` without PSNR unless final."""
    decoder: Decoder
    final: bool = False
    """Whether training of this group has ended with this."""


def apply_snapshot(pack: Pack, snapshot: GroupSnapshot) -> Pack:
    """`pack` with the group of the snapshot; all other textures and decoders are the same objects.

    Where the group's textures are one group of `pack`, its decoder is replaced. Where they are not (the textures are
    being grouped anew), they leave theirs and get a new decoder, and unused decoders are dropped: until the training has
    ended, groups of the result are numbered differently than in the request. Raises ValueError for
    textures that `pack` does not have.
    """
    members = snapshot.members
    for index, encoded in zip(members, snapshot.textures, strict=True):
        if not 0 <= index < len(pack.textures) or pack.textures[index].pixel_hash != encoded.pixel_hash:
            raise ValueError(f"texture {index} of the snapshot, {encoded.name}, is not the one of the pack")
    groups = list(pack.grouping.groups)
    decoders = list(pack.decoders)
    own = groups[members[0]]
    if {index for index, group in enumerate(groups) if group == own} == set(members):
        decoders[own] = snapshot.decoder
    else:
        own = len(decoders)
        decoders.append(snapshot.decoder)
        for index in members:
            groups[index] = own
    used = sorted(set(groups))
    new_number = {group: number for number, group in enumerate(used)}
    groups = [new_number[group] for group in groups]
    given = dict(zip(members, snapshot.textures, strict=True))
    textures = tuple(_in_group(given.get(index, encoded), groups[index]) for index, encoded in enumerate(pack.textures))
    grouping = replace(pack.grouping, groups=tuple(groups)) if tuple(groups) != pack.grouping.groups else pack.grouping
    return replace(
        pack, grouping=grouping, textures=textures, decoders=tuple(decoders[group] for group in used), path=None
    )


def _in_group(encoded: EncodedTexture, group: int) -> EncodedTexture:
    return encoded if encoded.group == group else replace(encoded, group=group)


def ended_pack(pack: Pack, grouping: Grouping) -> Pack:
    """`pack`, in which the same textures share decoders as in `grouping`, with the numbers of `grouping`.

    Raises ValueError where other textures share one.
    """
    number = dict(zip(pack.grouping.groups, grouping.groups, strict=True))
    same = tuple(number[group] for group in pack.grouping.groups) == grouping.groups
    if not same or len(number) != len(set(number.values())):
        raise ValueError("not all groups have been trained")
    old = {new: group for group, new in number.items()}
    textures = tuple(_in_group(t, group) for t, group in zip(pack.textures, grouping.groups, strict=True))
    decoders = tuple(pack.decoders[old[new]] for new in range(grouping.group_count))
    return replace(pack, grouping=grouping, textures=textures, decoders=decoders)


def unchanged_groups(old: Grouping, new: Grouping) -> dict[int, int]:
    """The groups of `new` that have the same textures as a group of `old`: their numbers, and those of the old ones."""
    members = {old.members(group): group for group in range(old.group_count)}
    found = {group: members.get(new.members(group)) for group in range(new.group_count)}
    return {group: number for group, number in found.items() if number is not None}


def moved_texture(grouping: Grouping, texture: int, group: int) -> Grouping:
    """`grouping` with one texture in another group; `group` may be one more than there are. A group that is left empty is
    closed. Raises InputError for numbers out of range."""
    if not 0 <= texture < len(grouping.groups) or not 0 <= group <= grouping.group_count:
        raise InputError(
            f"texture {texture} to group {group}: there are {len(grouping.groups)} textures and {grouping.group_count} groups"
        )
    if grouping.name == UNIVERSAL:
        raise InputError(f"grouping {UNIVERSAL} has one decoder for all textures; group the textures anew instead")
    groups = list(grouping.groups)
    groups[texture] = group
    numbers = {old: number for number, old in enumerate(sorted(set(groups)))}
    return replace(grouping, groups=tuple(numbers[old] for old in groups))
