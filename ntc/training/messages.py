"""Requests to a training and its reports: snapshots of groups, progress, and the host. Needs no torch."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal, Protocol

import msgspec
import numpy as np

from ntc.codec.checks import check_textures
from ntc.codec.config import UNIVERSAL
from ntc.codec.encoding import Budget, EncodingOptions, EncodingProgress
from ntc.codec.model import CodecSettings, Decoder, EncodedTexture, Grouping, Pack
from ntc.codec.quality import PsnrSummary
from ntc.codec.textures import SourceTexture
from ntc.errors import InputError


@dataclass(frozen=True, eq=False)
class GroupSnapshot:
    """A group as a pack stores it, at one moment of its training."""

    version: int
    """1 for the first of this group in a training, then one more each time."""
    group: int
    """Number of the group in the grouping that is trained for."""
    members: tuple[int, ...]
    """Indices of its textures."""
    textures: tuple[EncodedTexture, ...]
    """The members; in codec `grid` without PSNR unless final."""
    decoder: Decoder
    final: bool = False
    """True if training of this group has ended with this."""
    settings: CodecSettings | None = None
    """Settings of the resulting pack, where they are found while encoding; None: those of the request."""


def apply_snapshot(pack: Pack, snapshot: GroupSnapshot) -> Pack:
    """Return `pack` with the group of the snapshot; all other textures and decoders are the same objects.

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
        pack,
        config=snapshot.settings or pack.config,
        grouping=grouping,
        textures=textures,
        decoders=tuple(decoders[group] for group in used),
        path=None,
    )


def _in_group(encoded: EncodedTexture, group: int) -> EncodedTexture:
    return encoded if encoded.group == group else replace(encoded, group=group)


def ended_pack(pack: Pack, grouping: Grouping) -> Pack:
    """Return `pack`, in which the same textures share decoders as in `grouping`, with the numbers of `grouping`.

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
    """Return the groups of `new` that have the same textures as a group of `old`: their numbers, and those of the old ones."""
    members = {old.members(group): group for group in range(old.group_count)}
    found = {group: members.get(new.members(group)) for group in range(new.group_count)}
    return {group: number for group, number in found.items() if number is not None}


def moved_texture(grouping: Grouping, texture: int, group: int) -> Grouping:
    """Return `grouping` with one texture in another group; `group` may be one more than there are. A group that is left empty is
    closed. Raises InputError for numbers out of range."""
    if not 0 <= texture < len(grouping.groups) or not 0 <= group <= grouping.group_count:
        raise InputError(
            f"texture {texture} to group {group}: there are {len(grouping.groups)} textures and {grouping.group_count} groups"
        )
    if grouping.name == UNIVERSAL and grouping.group_count == 1:
        raise InputError(f"grouping {UNIVERSAL} has one decoder for all textures; regroup the textures instead")
    groups = list(grouping.groups)
    groups[texture] = group
    numbers = {old: number for number, old in enumerate(sorted(set(groups)))}
    return replace(grouping, groups=tuple(numbers[old] for old in groups))


@dataclass(frozen=True, eq=False)
class TrainingRequest:
    """The textures to train, for how long, and the pack to start from."""

    textures: tuple[SourceTexture, ...]
    grouping: Grouping
    codec: CodecSettings
    training: EncodingOptions
    """Options of the encoding, of the codec's own kind."""
    budget: Budget | None = None
    """None: as many steps as `training` has."""
    start: Pack | None = None
    """A pack of the same textures in the same order and of the same codec, to continue from; None: from nothing."""
    dirty: frozenset[int] | None = None
    """Groups of `grouping` to train. None: those whose textures do not form a group of `start`, or all without it. Others
    must be groups of `start`."""
    seconds_between_snapshots: float = 2.0


def checked_request(request: TrainingRequest) -> TrainingRequest:
    """Return `request` with its dirty groups named. Raises InputError for what cannot be trained."""
    grouping, start, budget = request.grouping, request.start, request.budget
    check_textures(request.textures, grouping, request.codec)
    if budget is not None:
        (value,) = msgspec.structs.astuple(budget)
        if not (np.isfinite(value) and value > 0):
            name = {"psnr_db": "PSNR"}.get(budget.__struct_fields__[0], budget.__struct_fields__[0])
            raise InputError(f"budget: {name} is {value}; set it above 0")
    if start is not None:
        _check_start(request.textures, request.codec, start)
    everything = frozenset(range(grouping.group_count))
    clean = frozenset() if start is None else frozenset(unchanged_groups(start.grouping, grouping))
    dirty = everything - clean if request.dirty is None else request.dirty
    if not dirty:
        raise InputError("there is no group to train: none has changed; name the groups to train again")
    if not dirty <= everything:
        raise InputError(f"group {max(dirty - everything)}: there are groups 0 to {grouping.group_count - 1} only")
    missing = everything - clean - dirty
    if missing:
        raise InputError(f"group {min(missing)}: has other textures than before, or none; train it too")
    return replace(request, dirty=dirty)


def _check_start(textures: Sequence[SourceTexture], codec: CodecSettings, start: Pack) -> None:
    where = start.path or start.grouping.name
    if start.config != codec:
        raise InputError(f"{where}: was made with another codec; encode from nothing, or with the pack's own codec")
    known = [(t.pixel_hash, t.width, t.height, t.maps, t.channels, t.color_space, t.wrap) for t in start.textures]
    given = [(t.pixel_hash, *t.size, t.maps, t.channels, t.color_space, t.wrap) for t in textures]
    if known != given:
        raise InputError(f"{where}: does not hold these textures in this size and order; encode from nothing")


ProgressListener = Callable[["TrainingProgress"], None]
EndReason = Literal["done", "target reached", "target not reached", "cancelled"]


@dataclass(frozen=True, kw_only=True)
class TrainingProgress(EncodingProgress):
    """One report of a training under way. Its `share` counts the measuring of results too, and never falls."""

    elapsed_seconds: float
    """Time of training in seconds, without pauses."""
    note: str = ""
    """A line for a log, or nothing."""

    @property
    def phase(self) -> str:
        """Return the work under way as text: `measuring texture 5 of 13`, or without counts where it has no steps."""
        return f"{self.work} {self.step} of {self.steps}" if self.steps else self.work

    @property
    def ktexels_per_second(self) -> float:
        """Speed of the training in thousand texels a second."""
        return self.texels / self.elapsed_seconds / 1e3

    @property
    def mean_psnr_db(self) -> float:
        """PSNR in dB of the latest samples of all textures together; 0 before the first step."""
        summary = PsnrSummary.of(list(self.psnr_db.values()))
        return 0.0 if summary is None else summary.of_mean_mse_db


@dataclass(frozen=True)
class GroupOutcome:
    """The result of a group's training. PSNR in dB of the mean square error of its textures' mip 0, over 8-bit values."""

    group: int
    before_db: float | None
    """None for a group that did not exist before."""
    after_db: float
    """PSNR of the training's result, also where it was not kept."""
    kept_old: bool = False
    """True if the training found nothing better, so that the group is unchanged."""

    def line(self) -> str:
        """Return the outcome as one line."""
        if self.before_db is None:
            return f"group {self.group}: {self.after_db:.2f} dB"
        if self.kept_old:
            return (
                f"group {self.group}: left unchanged at {self.before_db:.2f} dB; training gave {self.after_db:.2f} dB"
            )
        return f"group {self.group}: {self.before_db:.2f} dB before, {self.after_db:.2f} dB now"


@dataclass(frozen=True)
class Ended:
    """The training is over; its final snapshots were sent before."""

    reason: EndReason
    outcomes: tuple[GroupOutcome, ...] = ()
    record: Mapping[str, Any] = field(default_factory=dict)
    """Record of the training for the pack: JSON values only."""


class TrainingHost(Protocol):
    """Runs a training: receives its reports, and may pause or cancel it."""

    def interruption(self) -> None:
        """Called many times a second; waits while training is paused, and raises TrainingCancelledError to end it."""

    def seconds(self) -> float:
        """Return the seconds of a clock that stands still in pauses."""

    def progress(self, progress: TrainingProgress) -> None:
        """Takes a report, or drops it."""

    def wants_snapshot(self, group: int) -> bool:
        """Return whether an intermediate snapshot of the group would be taken now."""

    def snapshot(self, snapshot: GroupSnapshot) -> None:
        """Takes a snapshot; waits for room for a final one."""
