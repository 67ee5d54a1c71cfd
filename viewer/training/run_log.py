"""Training runs of the window: the one under way, and the log of those that have ended."""

import math
import time
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ntc.codec.model import Pack
from ntc.codec.quality import psnr_of_mse
from ntc.errors import InputError
from ntc.training.messages import TrainingProgress, TrainingRequest, ended_pack
from viewer.scene.json_text import time_left
from viewer.scene.model import Scene
from viewer.training.preparation import TrainingJob, job_title, settings_text

MOST_POINTS = 400
"""Largest number of points of a curve. When it is full every second one is dropped: a long run costs no more than a short one."""
MOST_RUNS = 100
MOST_PACKS = 8
"""Most packs of ended runs in memory, besides those that are shown."""


@dataclass(frozen=True, eq=False)
class Run:
    """A training run that has ended. Its pack can be opened again."""

    number: int
    title: str
    """Title of the training, such as `retrain 1 group (3)`."""
    settings: str
    """Recipe, size, budget."""
    groups: int
    """Decoders of the pack."""
    outcome: str
    """Outcome of the run: `done`, `cancelled`, `failed` and so on."""
    seconds: float
    """Time of training in seconds, without preparation and pauses."""
    psnr_db: float | None
    """PSNR in dB of the mean square error over textures; of samples where the run did not end by itself. None where not known."""
    lines: tuple[str, ...] = ()
    """Outcome of each group, a line each."""
    pack: Pack | None = field(default=None, repr=False)
    """None where the run made none, and where it is in a file alone."""
    autosave: Path | None = None
    """File of its pack in the data folder; None without one."""
    saved: Path | None = None
    """File that the user saved its pack to."""
    discarded: bool = False
    """True if the user discarded the run."""
    earlier: bool = False
    """True for a run of an earlier window."""
    open_as: str = ""
    """Name of its open pack after the user has saved it; "" before."""

    @property
    def name(self) -> str:
        """Name under which its pack is open."""
        return self.open_as or f"run {self.number}"

    @property
    def file(self) -> Path | None:
        """File of its pack; None without one."""
        return self.saved or self.autosave

    @property
    def has_pack(self) -> bool:
        """True if its pack is in memory or in a file."""
        return self.pack is not None or self.file is not None

    @property
    def is_unsaved(self) -> bool:
        """True if the run made a pack that the user neither kept nor discarded."""
        return self.has_pack and self.saved is None and not self.discarded

    @property
    def fate(self) -> str:
        """Outcome of the run and the decision about its pack: `done, kept`."""
        decision = "kept" if self.saved is not None else "discarded" if self.discarded else ""
        return f"{self.outcome}, {decision}" if decision else self.outcome


def mean_of_psnr(values: list[float]) -> float:
    """Return the PSNR in dB of the mean of the mean square errors that belong to `values`."""
    return psnr_of_mse(float(np.mean([255.0**2 * 10.0 ** (-value / 10.0) for value in values])))


@dataclass
class Curves:
    """Loss by group and PSNR by texture over a run, at most MOST_POINTS of each."""

    seconds: list[float] = field(default_factory=list)
    losses: dict[int, list[float]] = field(default_factory=dict)
    """Loss by group; nan before it is trained."""
    psnr_db: dict[int, list[float]] = field(default_factory=dict)
    """PSNR in dB by texture; nan before it is trained."""
    mean_db: list[float] = field(default_factory=list)
    """PSNR in dB of all textures under training together."""

    def add(self, progress: TrainingProgress) -> None:
        """Add a point to the curves."""
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
        """Return [points] float64, as plots take them."""
        return np.array(curve, np.float64)


def earlier_run(number: int, file: Path) -> Run:
    """Return the run of an earlier window whose autosaved pack is `file`."""
    then = time.localtime(file.stat().st_mtime)
    clock = time.strftime("%H:%M" if then[:3] == time.localtime()[:3] else "%Y-%m-%d %H:%M", then)
    grouping = file.stem.rpartition(".")[2]
    return Run(number, f"{grouping} of {clock}", "", 0, f"autosaved {clock}", 0.0, None, autosave=file, earlier=True)


class RunLog:
    """The ended runs of one scene."""

    def __init__(self, autosaved: Iterable[Path] = ()) -> None:
        """Begin with the runs of earlier windows, whose files are given, oldest first."""
        self.runs: tuple[Run, ...] = ()
        """Oldest first."""
        self.chosen: int | None = None
        """Number of the unsaved run that the panel asks about; None for none."""
        for number, file in enumerate(autosaved, 1):
            with suppress(FileNotFoundError):
                self.runs = (*self.runs, earlier_run(number, file))

    @property
    def next_number(self) -> int:
        """Number of the run that begins next."""
        return self.runs[-1].number + 1 if self.runs else 1

    @property
    def unsaved_runs(self) -> tuple[Run, ...]:
        """Runs whose packs the user neither kept nor discarded."""
        return tuple(run for run in self.runs if run.is_unsaved)

    def __contains__(self, number: int) -> bool:
        return any(run.number == number for run in self.runs)

    def __getitem__(self, number: int) -> Run:
        """Return a run by its number. Raises InputError."""
        for run in self.runs:
            if run.number == number:
                return run
        raise InputError(f"run {number}: there is no such run; runs so far: {len(self.runs)}")

    def unsaved_run(self, number: int = 0) -> Run:
        """Return a run by its number, 0 for the chosen one. Raises InputError where it has no pack, and where it is kept already."""
        if not number and self.chosen is None:
            raise InputError("training: the panel Training asks about no run; name the number of an unsaved run")
        run = self[number or self.chosen or 0]
        if run.saved is not None or not run.has_pack:
            raise InputError(f"run {run.number}: " + (f"is kept in {run.saved}" if run.saved else "has no pack"))
        return run

    def add(self, run: Run) -> None:
        """Add a run that has ended."""
        old = [known.number for known in self.runs if not known.is_unsaved][: len(self.runs) + 1 - MOST_RUNS]
        self.runs = (*(known for known in self.runs if known.number not in old), run)
        self.chosen = run.number if run.is_unsaved else None

    def change(self, changed: Run) -> None:
        """Replace the run of the same number."""
        self.runs = tuple(changed if run.number == changed.number else run for run in self.runs)

    def drop_old_packs(self, shown: frozenset[str]) -> tuple[str, ...]:
        """Drop the packs of old runs from memory, but for the names in `shown` and unsaved ones without a file; returns the names of
        those that were dropped."""
        old = [run for run in self.runs if run.pack is not None][:-MOST_PACKS]
        dropped = [run for run in old if run.name not in shown and (run.file is not None or run.discarded)]
        for run in dropped:
            self.change(replace(run, pack=None))
        return tuple(run.name for run in dropped)


State = Literal["idle", "preparing", "training", "pausing", "paused", "cancelling"]
MOST_NOTES = 20


@dataclass
class ActiveRun:
    """A training run from the request of the user to its end."""

    number: int
    job: TrainingJob
    scene: Scene
    began: float
    """Monotonic seconds."""
    state: State = "preparing"
    request: TrainingRequest | None = None
    """None while it is prepared."""
    pack: Pack | None = None
    """The pack that it started from, with the snapshots so far."""
    groups_seen: frozenset[int] = frozenset()
    """Groups of which a snapshot has come."""
    progress: TrainingProgress | None = None
    first_picture_seconds: float | None = None
    """Time in seconds from the request to the first snapshot."""
    curves: Curves = field(default_factory=Curves)
    notes: tuple[str, ...] = ()
    published: Pack | None = None
    """`pack` as it was published last."""
    published_at: float = -math.inf
    """Monotonic seconds."""
    autosave: Path | None = None
    """File of its pack in the data folder; None before the first one."""
    autosaved: Pack | None = None
    """`pack` as it was autosaved last."""
    autosaved_at: float = -math.inf
    """Monotonic seconds."""

    @property
    def codec_kind(self) -> str | None:
        """Codec of the pack that it makes; None while it is prepared."""
        return None if self.request is None else self.request.codec.kind

    @property
    def name(self) -> str:
        """Name under which its pack is open."""
        return f"run {self.number}"

    def add_progress(self, progress: TrainingProgress) -> None:
        """Take in a report of the worker."""
        self.progress = progress
        self.curves.add(progress)
        if progress.note:
            self.notes = (*self.notes, progress.note)[-MOST_NOTES:]

    def add_snapshot(self, group: int, pack: Pack | None) -> None:
        """Take in a trained group, and the pack that has it."""
        self.pack = pack
        self.groups_seen |= {group}

    @property
    def seconds_left(self) -> float | None:
        """Time left in seconds; None while it is unknown."""
        return None if self.progress is None else time_left(self.progress.elapsed_seconds, self.progress.share)

    @property
    def is_showable(self) -> bool:
        """True where all groups of the pack decode by its settings: a quality target chooses them while encoding."""
        request = self.request
        return (
            request is not None
            and self.pack is not None
            and (self.pack.config == request.codec or self.groups_seen >= (request.dirty or frozenset()))
        )

    def pack_so_far(self) -> Pack | None:
        """Return the pack of the snapshots, if every group that was to be trained has had one."""
        request, pack = self.request, self.pack
        if request is None or pack is None or not self.groups_seen >= (request.dirty or frozenset()):
            return None
        sizes = [(texture.width, texture.height) for texture in pack.textures]
        if sizes != [source.size for source in request.textures]:
            # A coarse picture to look at is nothing to keep.
            return None
        whole = ended_pack(pack, request.grouping)
        return replace(whole, training={**whole.training, "ended_early": True})

    def ended(self, outcome: str, pack: Pack | None, lines: tuple[str, ...]) -> Run:
        """Return the run as the log keeps it; `pack` is what it made, `lines` say what became of each group."""
        progress = self.progress
        textures = pack.textures if pack is not None else ()
        known = [texture.psnr_db for texture in textures if texture.psnr_db is not None]
        if len(known) < len(textures):
            known = list(progress.psnr_db.values()) if progress is not None else []
        return Run(
            self.number,
            job_title(self.job),
            settings_text(self.job),
            self.request.grouping.group_count if self.request is not None else 0,
            outcome,
            progress.elapsed_seconds if progress is not None else 0.0,
            mean_of_psnr(known) if known else None,
            (*lines, *self.notes),
            pack,
            self.autosave,
        )
