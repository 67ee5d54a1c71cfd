"""What happens when numbers blow up: the step is dropped, the last good state comes back, and rates are lowered."""

from torch import Tensor

from ntc.errors import InputError
from ntc.training.batch import NotFiniteError, StepReport, TrainingCohort

STEPS_BETWEEN_KEEPING = 50
MOST_IN_A_ROW = 3
LOWERED = 0.5


class TrainingFailedError(InputError):
    """Loss or gradients were not finite several times in a row."""


class TrainingGuard:
    """Runs the steps of a cohort and keeps a copy of its last good state."""

    def __init__(self, cohort: TrainingCohort, rate_factor: float = 1.0, dropped: int = 0) -> None:
        self._cohort = cohort
        self.rate_factor = rate_factor
        """What all rates are multiplied by, besides the schedule."""
        self.dropped = dropped
        """Steps dropped so far."""
        self._in_a_row = 0
        self._kept: dict[str, Tensor] = {}
        self._keep()

    def _keep(self) -> None:
        self._kept = {name: value.clone() for name, value in self._cohort.state().items()}

    def advance(self) -> tuple[StepReport | None, str]:
        """One step, and what is to be said about it. No report when the step was dropped.

        Raises TrainingFailedError after several in a row; the cohort then has its last good state.
        """
        cohort = self._cohort
        if cohort.step % STEPS_BETWEEN_KEEPING == 0 and not self._in_a_row:
            self._keep()
        try:
            report = cohort.advance(self.rate_factor)
        except NotFiniteError:
            return None, self._drop()
        self._in_a_row = 0
        return report, ""

    def _drop(self) -> str:
        cohort, step = self._cohort, self._cohort.step
        cohort.load(self._kept)
        good = cohort.step
        self.dropped += 1
        self._in_a_row += 1
        if self._in_a_row >= MOST_IN_A_ROW:
            raise TrainingFailedError(
                f"training: loss or gradients were not finite in {MOST_IN_A_ROW} steps in a row, the last at step {step}; "
                "lower the learning rates, or look for a damaged texture"
            )
        self.rate_factor *= LOWERED
        # The dropped step counts: a training ends when it was to end.
        cohort.step = step + 1
        return (
            f"step {step}: loss or gradients are not finite; dropped, back to the state of step {good}, "
            f"rates lowered to {self.rate_factor:g} of the schedule"
        )
