"""Search for the fastest precision of a slot's pack without visible error, in the background."""

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
    """Search for `session.precision_searches`. It takes seconds for a large pack; no frame waits for it."""

    def __init__(
        self, background: Background, fastest_first: Callable[[Pack], Sequence[Precision]], emit: EmitEvent
    ) -> None:
        """Make the search; `fastest_first` gives the driver's precisions for a pack, on the thread of the OpenGL context."""
        self._background, self._fastest_first, self._emit = background, fastest_first, emit

    def step(self, session: Session) -> None:
        """Report precisions found since the last call, with the reasons."""
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
