"""The log of training runs with the packs that they made, and the curves of a run."""

import math
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ntc.codec.model import Pack
from ntc.codec.quality import psnr_of_mse
from ntc.errors import InputError
from ntc.training.progress import TrainingProgress

MOST_POINTS = 400
"""Of a curve; when it is full every second one is dropped, so that a long run costs no more than a short one."""
MOST_RUNS = 100
MOST_PACKS = 8
"""Packs of ended runs that are kept, besides those that are shown."""


@dataclass(frozen=True, eq=False)
class Run:
    """A training run that has ended. Its pack can be opened again."""

    number: int
    title: str
    """What was trained."""
    settings: str
    """Recipe, size, budget."""
    groups: int
    """Decoders of the pack."""
    outcome: str
    """How it ended: `done`, `cancelled`, `failed` and so on."""
    seconds: float
    """Of training, without preparation and pauses."""
    psnr_db: float | None
    """PSNR in dB of the mean square error over textures; of samples where the run did not end by itself. None where not known."""
    lines: tuple[str, ...] = ()
    """What became of each group."""
    pack: Pack | None = field(default=None, repr=False)
    """None where the run made none, or so many runs followed that it was dropped."""
    saved: Path | None = None
    """The file that it was written to."""
    discarded: bool = False
    """Whether the user did not want it."""
    open_as: str = ""
    """Name under which its pack is open since it was accepted; "" before that."""

    @property
    def name(self) -> str:
        """Name under which its pack is open."""
        return self.open_as or f"run {self.number}"

    @property
    def is_undecided(self) -> bool:
        """Whether it made a pack that was neither accepted nor discarded."""
        return self.pack is not None and self.saved is None and not self.discarded

    @property
    def fate(self) -> str:
        """How it ended, and what became of its pack: `done, accepted`."""
        decision = "accepted" if self.saved is not None else "discarded" if self.discarded else ""
        return f"{self.outcome}, {decision}" if decision else self.outcome


def mean_of_psnr(values: list[float]) -> float:
    """PSNR in dB of the mean of the mean square errors that belong to `values`."""
    return psnr_of_mse(float(np.mean([255.0**2 * 10.0 ** (-value / 10.0) for value in values])))


@dataclass
class Curves:
    """Loss by group and PSNR by texture over a run, at most MOST_POINTS of each."""

    seconds: list[float] = field(default_factory=list)
    losses: dict[int, list[float]] = field(default_factory=dict)
    """By group; nan before it is trained."""
    psnr_db: dict[int, list[float]] = field(default_factory=dict)
    """By texture; nan before it is trained."""
    mean_db: list[float] = field(default_factory=list)
    """Of the textures under training."""

    def add(self, progress: TrainingProgress) -> None:
        """One more point."""
        if not progress.psnr_db:
            return
        if len(self.seconds) >= MOST_POINTS:
            self._thin()
        known = len(self.seconds)
        self.seconds.append(progress.elapsed_seconds)
        self.mean_db.append(mean_of_psnr(list(progress.psnr_db.values())))
        for curves, values in ((self.losses, progress.losses), (self.psnr_db, progress.psnr_db)):
            for key in values.keys() - curves.keys():
                curves[key] = [math.nan] * known
            for key, curve in curves.items():
                curve.append(values.get(key, math.nan))

    def _thin(self) -> None:
        for curve in (self.seconds, self.mean_db, *self.losses.values(), *self.psnr_db.values()):
            del curve[::2]

    @staticmethod
    def array(curve: list[float]) -> NDArray[np.float64]:
        """[points] float64, as plots take them."""
        return np.array(curve, np.float64)


class RunLog:
    """The ended runs of one scene."""

    def __init__(self, first_number: int = 1) -> None:
        """`first_number` is that of the first run."""
        self.runs: tuple[Run, ...] = ()
        """Oldest first."""
        self.undecided: int | None = None
        """Number of the run that is to be accepted or discarded next."""
        self.first_number = first_number

    @property
    def next_number(self) -> int:
        """Number of the run that begins next."""
        return self.runs[-1].number + 1 if self.runs else self.first_number

    @property
    def undecided_runs(self) -> tuple[Run, ...]:
        """All whose packs were neither accepted nor discarded."""
        return tuple(run for run in self.runs if run.is_undecided)

    def __contains__(self, number: int) -> bool:
        return any(run.number == number for run in self.runs)

    def __getitem__(self, number: int) -> Run:
        """A run by its number. Raises InputError."""
        for run in self.runs:
            if run.number == number:
                return run
        raise InputError(f"run {number}: there is no such run; runs so far: {len(self.runs)}")

    def undecided_run(self) -> Run:
        """The run that is to be accepted or discarded. Raises InputError where there is none."""
        if self.undecided is None:
            raise InputError("training: no finished run waits to be accepted or discarded")
        return self[self.undecided]

    def add(self, run: Run) -> None:
        """Add a run that has ended."""
        old = [known.number for known in self.runs if not known.is_undecided][: len(self.runs) + 1 - MOST_RUNS]
        self.runs = (*(known for known in self.runs if known.number not in old), run)
        self.choose_undecided()

    def change(self, changed: Run) -> None:
        """Replace the run of the same number."""
        self.runs = tuple(changed if run.number == changed.number else run for run in self.runs)

    def choose_undecided(self) -> None:
        """Let the newest run that is undecided be the one to accept or discard next."""
        self.undecided = max((run.number for run in self.undecided_runs), default=None)

    def drop_old_packs(self, shown: frozenset[str]) -> tuple[str, ...]:
        """Drop the packs of old runs that were decided, but for the names in `shown`; returns the names of those that were dropped."""
        old = [run for run in self.runs if run.pack is not None][:-MOST_PACKS]
        dropped = [run for run in old if run.name not in shown and not run.is_undecided]
        for run in dropped:
            self.change(replace(run, pack=None))
        return tuple(run.name for run in dropped)
