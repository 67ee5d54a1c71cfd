"""What the window and the training process say to each other: immutable, and without torch."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

from ntc.codec.config import CodecConfig
from ntc.codec.textures import SourceTexture
from ntc.pack.model import Grouping, Pack
from ntc.training.config import TrainingConfig
from ntc.training.snapshot import GroupSnapshot


@dataclass(frozen=True)
class StepBudget:
    """Train for so many steps."""

    steps: int


@dataclass(frozen=True)
class TimeBudget:
    """Train for so many seconds, pauses not counted; the schedule ends in its decay when they are over."""

    seconds: float


@dataclass(frozen=True)
class QualityBudget:
    """Train until samples of the trained textures together reach a PSNR, then let the rates fall to the end; at most as long as
    the training's settings say."""

    psnr_db: float


Budget = StepBudget | TimeBudget | QualityBudget


@dataclass(frozen=True, eq=False)
class TrainingRequest:
    """What is to be trained."""

    textures: tuple[SourceTexture, ...]
    grouping: Grouping
    codec: CodecConfig
    training: TrainingConfig
    budget: Budget | None = None
    """None: as long as `training` says."""
    start: Pack | None = None
    """A pack of the same textures in the same order and of the same codec, to go on from; None: from nothing."""
    dirty: frozenset[int] | None = None
    """Groups of `grouping` to train. None: those whose textures do not form a group of `start`, or all without it. Others
    must be groups of `start`."""
    seconds_between_snapshots: float = 2.0


@dataclass(frozen=True, eq=False)
class StartTraining:
    """To the worker: begin. Arrays of the request are places in a block."""

    request: TrainingRequest
    input_block: str
    snapshot_block: str
    regions: Mapping[int, int]
    """Where the region of each dirty group begins in the snapshot block."""


@dataclass(frozen=True)
class Pause:
    """To the worker: stop at once, and wait."""


@dataclass(frozen=True)
class Resume:
    """To the worker: go on."""


@dataclass(frozen=True)
class Cancel:
    """To the worker: end the training; nothing is delivered."""


@dataclass(frozen=True)
class SnapshotTaken:
    """To the worker: the region of a group may be written again."""

    group: int


@dataclass(frozen=True)
class ProgressTaken:
    """To the worker: the last progress has been read."""


Command = StartTraining | Pause | Resume | Cancel | SnapshotTaken | ProgressTaken


@dataclass(frozen=True)
class Ready:
    """The worker process listens. Not passed on."""


@dataclass(frozen=True)
class Received:
    """The worker has opened its blocks and copied the request. Not passed on."""


@dataclass(frozen=True)
class Paused:
    """Training stands still, and takes no processor time."""


@dataclass(frozen=True)
class Resumed:
    """Training goes on."""


@dataclass(frozen=True)
class WorkerProgress:
    """How far a training is. Reports that nobody took are not kept: each is the latest."""

    step: int
    of: int
    """Steps in all, as planned now."""
    eta_seconds: float
    elapsed_seconds: float
    """Of training, without pauses."""
    losses: Mapping[int, float]
    """By group: mean square error of its latest samples, colours in [0, 1], all lods mixed. Groups not yet begun are missing."""
    psnr_db: Mapping[int, float]
    """By texture: PSNR in dB of its latest samples."""
    freezing_scale: float
    """Of the decoder's updates: 1 free, 0 frozen."""
    ktexels_per_second: float
    note: str = ""
    """Something to be put down in a log, or nothing."""


@dataclass(frozen=True)
class GroupOutcome:
    """How a group's training ended. PSNR in dB of the mean square error of its textures' mip 0, over 8-bit values."""

    group: int
    before_db: float | None
    """None where the group was not there before."""
    after_db: float
    """Of what the training found, also where it was not kept."""
    kept_old: bool = False
    """Whether the training found nothing better, so that the group is what it was."""

    def line(self) -> str:
        """One line about it."""
        if self.before_db is None:
            return f"group {self.group}: {self.after_db:.2f} dB"
        if self.kept_old:
            return (
                f"group {self.group}: stays at {self.before_db:.2f} dB; training it again gave {self.after_db:.2f} dB, "
                "so the old one was kept"
            )
        return f"group {self.group}: {self.before_db:.2f} dB before, {self.after_db:.2f} dB now"


EndReason = Literal["done", "target reached", "target not reached", "cancelled"]


@dataclass(frozen=True)
class Ended:
    """The training is over; its last snapshots were sent before. Not passed on: `Finished` is."""

    reason: EndReason
    outcomes: tuple[GroupOutcome, ...] = ()
    record: Mapping[str, Any] = field(default_factory=dict)
    """What the pack says of its training."""


@dataclass(frozen=True, eq=False)
class Finished:
    """The training is over."""

    reason: EndReason
    outcomes: tuple[GroupOutcome, ...] = ()
    pack: Pack | None = None
    """What came of it; None when it was cancelled."""


@dataclass(frozen=True)
class Failed:
    """The training, or its whole process, failed; the worker can be started again."""

    line: str
    """One line: what happened, and what to do about it."""
    details: str = ""
    """For a log."""


Report = Paused | Resumed | WorkerProgress | GroupSnapshot | Finished | Failed
"""What the window gets to see."""
WorkerReport = Ready | Received | Paused | Resumed | WorkerProgress | GroupSnapshot | Ended | Failed
"""What the worker sends. Arrays of snapshots are places in the snapshot block."""
