"""Finding the cheapest precision of a slot's pack that does not show, beside the frames."""

from collections.abc import Callable, Sequence
from functools import partial

from ntc.codec.codec import ChosenPrecision
from ntc.codec.config import Precision
from ntc.codec.model import Pack
from ntc.codec.registry import codec_of
from viewer.jobs.job import Background, JobReport
from viewer.state.events import EmitEvent, Notification, PrecisionFound
from viewer.state.message_log import details_of
from viewer.state.session import Session
from viewer.state.view_state import REFERENCE


class PrecisionSearch:
    """Searches for `session.precision_searches`: takes seconds for a large pack, and no frame waits for it."""

    def __init__(
        self, background: Background, fastest_first: Callable[[Pack], Sequence[Precision]], emit: EmitEvent
    ) -> None:
        """`fastest_first` gives the precisions that the driver has for a pack, on the thread of its OpenGL context."""
        self._background, self._fastest_first, self._emit = background, fastest_first, emit

    def step(self, session: Session) -> None:
        """Report what has been found since the last call, and why."""
        for side in sorted(session.precision_searches):
            slot = session.view.slots[side]
            pack = session.packs.get(slot.source)
            if slot.source == REFERENCE or pack is None:
                self._emit(PrecisionFound(side, None))
                continue
            job = self._background.submit(("precision", pack), partial(self._found, pack, self._fastest_first(pack)))
            if not job.done:
                continue
            if error := job.future.exception():
                self._emit(PrecisionFound(side, None))
                self._emit(Notification(f"{slot.source}: {job.problem}", "error", details_of(error)))
                continue
            chosen = job.result()
            self._emit(PrecisionFound(side, chosen.precision))
            self._emit(Notification(f"{slot.source}: precision {chosen.precision}: {chosen.reason}"))

    def _found(self, pack: Pack, fastest_first: Sequence[Precision], _report: JobReport) -> ChosenPrecision:
        return codec_of(pack.config).chosen_precision(pack, fastest_first)
