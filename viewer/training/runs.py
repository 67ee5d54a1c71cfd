"""The log of runs, and how a run went so far."""

import math
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ntc.metrics.metrics import psnr_of_mse
from ntc.pack.model import Pack
from ntc.worker.protocol import WorkerProgress

MOST_POINTS = 400
"""Of a curve; then every second one goes, so that a long run costs no more than a short one."""


@dataclass(frozen=True, eq=False)
class Run:
    """One training, ended. Its pack can be shown again."""

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
    """Mean over textures, in dB; of samples where the run did not end by itself. None where nothing is known."""
    lines: tuple[str, ...] = ()
    """What became of each group."""
    pack: Pack | None = field(default=None, repr=False)
    """None where nothing came of it, or so many runs followed that it was let go."""
    saved: Path | None = None

    @property
    def name(self) -> str:
        """As which its pack is open."""
        return run_name(self.number)


def run_name(number: int) -> str:
    """Under which a run's pack is open in the session."""
    return f"run {number}"


def mean_psnr_db(pack: Pack) -> float | None:
    """PSNR in dB of the mean square error over the textures of `pack`; None where not all have been measured."""
    known = [texture.psnr_db for texture in pack.textures]
    if not known or any(value is None for value in known):
        return None
    return mean_of_psnr([value for value in known if value is not None])


def mean_of_psnr(values: list[float]) -> float:
    """PSNR in dB of the mean of the mean square errors that belong to `values`."""
    return float(psnr_of_mse(float(np.mean([255.0**2 * 10.0 ** (-value / 10.0) for value in values]))))


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

    def add(self, progress: WorkerProgress) -> None:
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
