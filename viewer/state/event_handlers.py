"""Applies the events of jobs and of the renderer to the session."""

from dataclasses import replace

from viewer.state.events import Event, Notification, PackClosed, PackUpdated, PrecisionFound, RunStarted
from viewer.state.session import PreviousView, Session
from viewer.state.view_state import REFERENCE


def apply_event(session: Session, event: Event) -> None:
    """Change the session as `event` says."""
    match event:
        case Notification(text=text, kind=kind, details=details):
            session.say(text, kind, details)
        case PackUpdated(name=name, pack=pack):
            if session.packs.get(name) is not pack:
                session.packs = {**session.packs, name: pack}
        case PackClosed(name=name):
            _close_pack(session, name)
        case RunStarted():
            _show_run(session, event)
        case PrecisionFound(side=side, precision=precision):
            session.precision_wishes -= {side}
            if precision is not None:
                session.view = session.view.with_slot(side, replace(session.view.slots[side], precision=precision))


def _close_pack(session: Session, name: str) -> None:
    packs = {other: pack for other, pack in session.packs.items() if other != name}
    view, previous = session.view, session.previous_views.get(name)
    if view.slot_a.source == name and previous is not None:
        view = replace(view, slot_a=previous.slot_a, slot_b=previous.slot_b, compare=previous.compare)
    gone = {slot.source for slot in (view.slot_a, view.slot_b)} - {REFERENCE, *packs}
    a, b = (replace(slot, source=REFERENCE) if slot.source in gone else slot for slot in (view.slot_a, view.slot_b))
    session.view, session.packs = replace(view, slot_a=a, slot_b=b), packs


def _show_run(session: Session, run: RunStarted) -> None:
    view = session.view
    previous = PreviousView(view.slot_a, view.slot_b, view.compare)
    session.previous_views = {**session.previous_views, run.name: previous}
    slot_b = view.slot_b
    if run.base_name is not None and run.base_name in session.packs:
        # The base is decoded as A was: no other decode of it is needed.
        slot_b = replace(view.slot_a, source=run.base_name)
    path = "cached" if view.slot_a.source == REFERENCE else view.slot_a.path
    compare = "wipe" if view.slot_a.source == REFERENCE and view.slot_b.source == REFERENCE else view.compare
    slot_a = replace(view.slot_a, source=run.name, path=path)
    session.view = replace(view, slot_a=slot_a, slot_b=slot_b, compare=compare)
