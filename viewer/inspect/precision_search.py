"""Finding the cheapest precision of a slot's pack that does not show, beside the frames."""

from dataclasses import replace
from functools import partial

from ntc.accuracy.precision_choice import ChosenPrecision, chosen_precision
from ntc.codec.precision import Precision
from ntc.pack.model import Pack
from viewer.jobs.background import Background, Finished, JobReport
from viewer.state.actions import SetSlot
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
            answer = self._background.ask(("precision", pack), partial(self._found, pack))
            if isinstance(answer, Finished):
                session.precision_wishes -= {side}
                if isinstance(answer.value, ChosenPrecision):
                    session.apply(SetSlot(side, replace(slot, precision=answer.value.precision)))
                    session.say(f"{slot.source}: precision {answer.value.precision}: {answer.value.reason}")
                else:
                    session.say(f"{slot.source}: {answer.problem}", "error", answer.details)

    def _found(self, pack: Pack, _report: JobReport) -> ChosenPrecision:
        return chosen_precision(pack, self._supported)
