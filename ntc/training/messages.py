"""Messages of a training: the request, snapshots of groups, progress, and the protocol of its host. No torch is imported."""

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
    """A group as a pack stores it, at one moment of the training."""

    version: int
    """Number of the group's snapshot in the training, from 1 on."""
    group: int
    """Number of the group in the request's grouping."""
    members: tuple[int, ...]
    """Indices of the group's textures."""
    textures: tuple[EncodedTexture, ...]
    """The encoded members. Those of codec `grid` have a PSNR only in the final snapshot."""
    decoder: Decoder
    final: bool = False
    """True for the last snapshot of a group."""
    settings: CodecSettings | None = None
    """Settings of the resulting pack, if encoding chooses them. None: those of the request."""


def apply_snapshot(pack: Pack, snapshot: GroupSnapshot) -> Pack:
    """Return `pack` with the group of the snapshot. All other textures and decoders are the same objects.

    If the group's textures are a group of `pack`, its decoder is replaced. Otherwise the textures are being regrouped: they leave
    their groups and get a new decoder, and unused decoders are dropped. Until training ends, groups are then numbered differently than
    in the request. Raises ValueError for textures that `pack` does not have.
    """
    members = snapshot.members
    for index, encoded in zip(members, snapshot.textures, strict=True):
        if not 0 <= index < len(pack.textures) or pack.textures[index].pixel_hash != encoded.pixel_hash:
            raise ValueError(f"texture {index} of the snapshot, {encoded.name}, is not the one of the pack")
    groups = list(pack.grouping.groups)
    decoders = list(pack.decoders)
    target = groups[members[0]]
    if {index for index, group in enumerate(groups) if group == target} == set(members):
        decoders[target] = snapshot.decoder
    else:
        target = len(decoders)
        decoders.append(snapshot.decoder)
        for index in members:
            groups[index] = target
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
    """Return `pack` with its groups numbered as in `grouping`.

    Raises ValueError if `grouping` does not put the same textures together.
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
    """Return the groups of `new` that have the same textures as a group of `old`: {number in `new`: number in `old`}."""
    members = {old.members(group): group for group in range(old.group_count)}
    old_numbers = {group: members.get(new.members(group)) for group in range(new.group_count)}
    return {group: number for group, number in old_numbers.items() if number is not None}


def moved_texture(grouping: Grouping, texture: int, group: int) -> Grouping:
    """Return `grouping` with `texture` moved to `group`, which may be the next unused number. An empty group is removed.

    Raises InputError for numbers out of range.
    """
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
    """The request of a training: textures, grouping, settings, budget, and the pack to start from."""

    textures: tuple[SourceTexture, ...]
    grouping: Grouping
    codec: CodecSettings
    training: EncodingOptions
    """Options of the encoding; the type is the codec's."""
    budget: Budget | None = None
    """Budget of the training. None: the steps in `training`."""
    start: Pack | None = None
    """Pack to continue from: the same textures in the same order, and the same codec settings. None: start from scratch."""
    dirty: frozenset[int] | None = None
    """Groups of `grouping` to train. All others must have the same textures as a group of `start`. None: all groups for which `start`
    has no such group."""
    seconds_between_snapshots: float = 2.0
    """Least time between two snapshots of a group."""


def checked_request(request: TrainingRequest) -> TrainingRequest:
    """Return `request` with `dirty` filled in. Raises InputError if the request cannot be trained."""
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
    """A progress report of a training. Its `share` includes the measuring of results, and never falls."""

    elapsed_seconds: float
    """Seconds of training, without pauses."""
    note: str = ""
    """Line for the log; empty for none."""

    @property
    def phase(self) -> str:
        """The current work as text, such as `measuring texture 5 of 13`; without counts if it has no steps."""
        return f"{self.work} {self.step} of {self.steps}" if self.steps else self.work

    @property
    def ktexels_per_second(self) -> float:
        """Speed of the training in thousand texels per second."""
        return self.texels / self.elapsed_seconds / 1e3

    @property
    def mean_psnr_db(self) -> float:
        """PSNR in dB of the latest samples of all textures, of their mean square error; 0 before the first step."""
        summary = PsnrSummary.of(list(self.psnr_db.values()))
        return 0.0 if summary is None else summary.of_mean_mse_db


@dataclass(frozen=True)
class GroupOutcome:
    """The result of a group's training.

    PSNRs are in dB over 8-bit values, of the mean square error of the textures' mip 0.
    """

    group: int
    before_db: float | None
    """PSNR before the training. None for a new group."""
    after_db: float
    """PSNR of the training's result, also if it was rejected."""
    rejected: bool = False
    """True if the result was worse than before and was rejected: the group is unchanged."""

    def line(self) -> str:
        """Return the outcome as one line of text."""
        if self.before_db is None:
            return f"group {self.group}: {self.after_db:.2f} dB"
        if self.rejected:
            return (
                f"group {self.group}: left unchanged at {self.before_db:.2f} dB; training gave {self.after_db:.2f} dB"
            )
        return f"group {self.group}: {self.before_db:.2f} dB before, {self.after_db:.2f} dB now"


@dataclass(frozen=True)
class Ended:
    """The end of a training. All final snapshots were sent before it."""

    reason: EndReason
    outcomes: tuple[GroupOutcome, ...] = ()
    record: Mapping[str, Any] = field(default_factory=dict)
    """Record of the training for the pack: JSON values only."""


class TrainingHost(Protocol):
    """Host of a training: receives its reports, and may pause or cancel it."""

    def interruption(self) -> None:
        """Wait while training is paused; raise TrainingCancelledError to cancel it. Called many times a second."""

    def seconds(self) -> float:
        """Return the time in seconds of a clock that stops during pauses."""

    def progress(self, progress: TrainingProgress) -> None:
        """Take a progress report, or drop it."""


class SnapshotReceiver(Protocol):
    """Receives groups of a training while it goes on."""

    def wants_snapshot(self, group: int) -> bool:
        """Return whether the host would take an intermediate snapshot of `group` now."""

    def snapshot(self, snapshot: GroupSnapshot) -> None:
        """Take a snapshot. For a final one, wait until there is room."""
