"""Steps that recover from numbers that are not finite: back to the last good state, at lower learning rates."""

from torch import Tensor

from ntc.codec.grid.training.batch import StepReport, TrainingBatch
from ntc.errors import NotFiniteError, TrainingFailedError

STEPS_BETWEEN_COPIES = 50
MOST_DROPPED_IN_A_ROW = 3
RATE_AFTER_DROP = 0.5
"""What all rates are multiplied by after a dropped step."""


class RollbackStepper:
    """Runs the steps of a batch and keeps a copy of its last good state."""

    def __init__(self, batch: TrainingBatch, rate_factor: float = 1.0, dropped: int = 0) -> None:
        self._batch = batch
        self.rate_factor = rate_factor
        """What all rates are multiplied by, besides the schedule."""
        self.dropped = dropped
        """Steps dropped so far."""
        self._in_a_row = 0
        self._good_state: dict[str, Tensor] = {}
        self._copy_state()

    def _copy_state(self) -> None:
        self._good_state = {name: value.clone() for name, value in self._batch.state().items()}

    def advance(self) -> tuple[StepReport | None, str]:
        """One step: its report, and a note for the log. The report is None when the step was dropped.

        Raises TrainingFailedError after several in a row; the batch then has its last good state.
        """
        batch = self._batch
        if batch.step % STEPS_BETWEEN_COPIES == 0 and not self._in_a_row:
            self._copy_state()
        try:
            report = batch.advance(self.rate_factor)
        except NotFiniteError:
            return None, self._drop()
        self._in_a_row = 0
        return report, ""

    def _drop(self) -> str:
        batch, step = self._batch, self._batch.step
        batch.load(self._good_state)
        good = batch.step
        self.dropped += 1
        self._in_a_row += 1
        if self._in_a_row >= MOST_DROPPED_IN_A_ROW:
            raise TrainingFailedError(
                f"training: loss or gradients were not finite in {MOST_DROPPED_IN_A_ROW} steps in a row, the last at step {step}; "
                "lower the learning rates, or look for a damaged texture"
            )
        self.rate_factor *= RATE_AFTER_DROP
        # The dropped step counts, so that a training is as long as planned.
        batch.step = step + 1
        return (
            f"step {step}: loss or gradients are not finite; dropped, back to the state of step {good}, "
            f"rates lowered to {self.rate_factor:g} of the schedule"
        )
