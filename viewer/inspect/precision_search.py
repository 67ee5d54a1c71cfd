"""Finding the cheapest precision of a slot's pack that does not show, beside the frames."""

from dataclasses import replace
from functools import partial

from ntc.accuracy.precision_choice import ChosenPrecision, chosen_precision
from ntc.codec.precision import Precision
from ntc.pack.model import Pack
from viewer.jobs.background import Background
from viewer.jobs.job import JobReport
from viewer.state.actions import SetSlot
from viewer.state.message_log import details_of
from viewer.state.session import Session
from viewer.state.view_state import REFERENCE


class PrecisionSearch:
    """Fulfils `session.precision_wishes`: takes seconds for a large pack, and no frame waits for it."""

    def __init__(self, background: Background, supported: tuple[Precision, ...]) -> None:
        self._background, self._supported = background, supported

    def step(self, session: Session) -> None:
        """Set what has been found since the last call, and say why."""
        for side in sorted(session.precision_wishes):
            slot = session.view.slot_a if side == "a" else session.view.slot_b
            pack = session.packs.get(slot.source)
            if slot.source == REFERENCE or pack is None:
                session.precision_wishes -= {side}
                continue
            job = self._background.ask(("precision", pack), partial(self._found, pack))
            if not job.done:
                continue
            session.precision_wishes -= {side}
            if error := job.future.exception():
                session.say(f"{slot.source}: {job.problem}", "error", details_of(error))
                continue
            chosen = job.result()
            session.apply(SetSlot(side, replace(slot, precision=chosen.precision)))
            session.say(f"{slot.source}: precision {chosen.precision}: {chosen.reason}")

    def _found(self, pack: Pack, _report: JobReport) -> ChosenPrecision:
        return chosen_precision(pack, self._supported)
