"""What a training reports, and the host that receives it. Needs no torch."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Literal, Protocol

from ntc.codec.quality import PsnrSummary
from ntc.training.snapshot import GroupSnapshot

ProgressListener = Callable[["TrainingProgress"], None]
EndReason = Literal["done", "target reached", "target not reached", "cancelled"]


@dataclass(frozen=True)
class TrainingProgress:
    """One report of a training under way."""

    share: float
    """Of the work done, in [0, 1]; a single large texture moves it."""
    step: int
    steps: int
    """Steps or textures in all, as planned now."""
    seconds_left: float
    elapsed_seconds: float
    """Of training, without pauses."""
    losses: Mapping[int, float]
    """By group: mean square error of its textures, colours in [0, 1]. Groups not yet begun are missing."""
    psnr_db: Mapping[int, float]
    """By texture: PSNR in dB (`Codec.psnr_title` says of what)."""
    freezing_scale: float
    """Of the decoder's updates: 1 free, 0 frozen."""
    ktexels_per_second: float
    work: str = "step"
    """What `step` counts: steps, or textures with what is done to them."""
    note: str = ""
    """A line for a log, or nothing."""

    @property
    def mean_psnr_db(self) -> float:
        """PSNR in dB of the latest samples of all textures together; 0 before the first step."""
        summary = PsnrSummary.of(list(self.psnr_db.values()))
        return 0.0 if summary is None else summary.of_mean_mse_db


@dataclass(frozen=True)
class GroupOutcome:
    """How a group's training ended. PSNR in dB of the mean square error of its textures' mip 0, over 8-bit values."""

    group: int
    before_db: float | None
    """None for a group that did not exist before."""
    after_db: float
    """Of the training's result, also where it was not kept."""
    kept_old: bool = False
    """Whether the training found nothing better, so that the group is unchanged."""

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


@dataclass(frozen=True)
class Ended:
    """The training is over; its final snapshots were sent before."""

    reason: EndReason
    outcomes: tuple[GroupOutcome, ...] = ()
    record: Mapping[str, Any] = field(default_factory=dict)
    """What the pack records of its training: JSON values only."""


class TrainingHost(Protocol):
    """Runs a training: receives its reports, and may pause or cancel it."""

    def interruption(self) -> None:
        """Called many times a second; waits while training is paused, and raises TrainingCancelledError to end it."""

    def seconds(self) -> float:
        """A clock that stands still in pauses."""

    def progress(self, progress: TrainingProgress) -> None:
        """Takes a report, or drops it."""

    def wants_snapshot(self, group: int) -> bool:
        """Whether an intermediate snapshot of the group would be taken now."""

    def snapshot(self, snapshot: GroupSnapshot) -> None:
        """Takes a snapshot; waits for room for a final one."""
