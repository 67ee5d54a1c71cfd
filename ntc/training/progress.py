"""Reports of a training under way, and the question whether it should stop."""

import math
import time
from collections.abc import Callable
from dataclasses import dataclass

import torch

SECONDS_BETWEEN_REPORTS = 0.25


@dataclass(frozen=True)
class TrainingProgress:
    """One report of a training under way."""

    step: int
    steps: int
    psnr_db: float
    """Running PSNR in dB of the samples, all lods mixed, before 8-bit rounding."""
    texels_per_second: float
    seconds_left: float
    loss: float
    freezing_scale: float
    note: str = ""
    """Something to be put down in a log, or nothing."""


class TrainingCancelledError(Exception):
    """The caller asked to stop; nothing is delivered."""


ProgressListener = Callable[[TrainingProgress], None]
CancelQuestion = Callable[[], bool]
Interruption = Callable[[], None]
"""Called many times within a step. It may wait, and the step goes on when it returns; what it raises ends the training."""


def no_interruption() -> None:
    """Lets training go on."""


class TrainingClock:
    """Counts the steps of all cohorts together and reports about four times a second."""

    def __init__(self, steps: int, listener: ProgressListener | None, cancelled: CancelQuestion | None) -> None:
        self._steps, self._listener, self._cancelled = steps, listener, cancelled
        self._start = self._last_report = time.monotonic()
        self._step = self._first_step = 0
        self._texels = 0
        self._mean_loss = math.nan

    def skip(self, steps: int) -> None:
        """Count steps that were done before, or need not be done."""
        self._step += steps
        self._first_step += steps

    def ask(self) -> None:
        """Raises TrainingCancelledError when the caller asks to stop."""
        if self._cancelled is not None and self._cancelled():
            raise TrainingCancelledError

    def tick(self, loss: torch.Tensor, texels: int, scale: float, note: str = "") -> None:
        """Count one step of `texels` samples, with their mean square error."""
        self._step += 1
        self._texels += texels
        now = time.monotonic()
        due = note or now - self._last_report >= SECONDS_BETWEEN_REPORTS or self._step >= self._steps
        if self._listener is None or not due:
            return
        self._last_report = now
        value = float(loss)
        if math.isfinite(value):
            self._mean_loss = value if math.isnan(self._mean_loss) else 0.7 * self._mean_loss + 0.3 * value
        elapsed = max(now - self._start, 1e-6)
        known_loss = 1.0 if math.isnan(self._mean_loss) else self._mean_loss
        self._listener(
            TrainingProgress(
                step=self._step,
                steps=self._steps,
                psnr_db=-10.0 * math.log10(max(known_loss, 1e-12)),
                texels_per_second=self._texels / elapsed,
                seconds_left=elapsed / max(1, self._step - self._first_step) * (self._steps - self._step),
                loss=value,
                freezing_scale=scale,
                note=note,
            )
        )
