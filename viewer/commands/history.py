"""What commands have changed of the view, the settings and the panels, so that it can be undone and done again."""

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from time import monotonic
from typing import Any

from viewer.scene.model import Scene
from viewer.state.session import Session
from viewer.state.view_state import Slot
from viewer.training.live_training import LiveTraining

SECONDS_TOGETHER = 1.0
"""The same command again within this time, as by a drag, is undone together with the one before."""
MOST_CHANGES = 200
VIEW, SETTINGS = "view.", "settings."
NOT_UNDONE = (
    f"{VIEW}size",
    *(f"{SETTINGS}{name}" for name in ("window_size", "column_folded", "keys", "first_steps", "recent_files")),
)
"""What follows the window, or only remembers what was done."""
GROUPS = {
    "navigation": ("bookmarks", "speed_notches"),
    "inspection": ("selected_texture", "flat_texture", "block", "pixel", "errors"),
    "window": ("open_panels", "show_panels", "flickers"),
}
"""What is restored of the groups of the session, besides its view, its settings and its resolution."""
RESOLUTION, DISCARDED = "resolution", "discarded"
"""The latter: numbers of the training runs that were discarded."""

State = Mapping[str, Any]


def present_state(session: Session, training: LiveTraining) -> State:
    """All that can be undone, by name."""
    state = {f"{VIEW}{field.name}": getattr(session.view, field.name) for field in fields(session.view)}
    state |= {f"{SETTINGS}{field.name}": getattr(session.settings, field.name) for field in fields(session.settings)}
    for group, names in GROUPS.items():
        state |= {f"{group}.{name}": getattr(getattr(session, group), name) for name in names}
    return {name: value for name, value in state.items() if name not in NOT_UNDONE} | {
        RESOLUTION: session.resolution,
        DISCARDED: training.discarded,
    }


@dataclass(frozen=True)
class Change:
    """What one command, or the same one several times in a row, has changed."""

    command_id: str
    title: str
    before: State
    after: State
    """The same names: those whose values differ."""
    when: float
    """Monotonic seconds of the last of them."""


class History:
    """The changes of one window, in one scene."""

    def __init__(self) -> None:
        self._done: tuple[Change, ...] = ()
        self._undone: tuple[Change, ...] = ()
        self._scene: Scene | None = None

    def can_undo(self, session: Session) -> bool:
        """Whether there is anything to undo."""
        return bool(self._done) and self._scene is session.scene

    def can_redo(self, session: Session) -> bool:
        """Whether something was undone, and nothing else done since."""
        return bool(self._undone) and self._scene is session.scene

    def note(self, command_id: str, title: str, before: State, after: State, scene: Scene) -> None:
        """A command was run, and the state was `before` and is `after`, both in `scene`: the history of another begins anew."""
        if scene is not self._scene:
            self._done, self._undone, self._scene = (), (), scene
        names = [name for name in after if before[name] is not after[name] and before[name] != after[name]]
        if not names:
            return
        self._undone = ()
        change = Change(command_id, title, {n: before[n] for n in names}, {n: after[n] for n in names}, monotonic())
        last = self._done[-1] if self._done else None
        if last is not None and last.command_id == command_id and change.when - last.when < SECONDS_TOGETHER:
            change = replace(change, before={**change.before, **last.before}, after={**last.after, **change.after})
            self._done = self._done[:-1]
        self._done = (*self._done, change)[-MOST_CHANGES:]

    def undo(self, session: Session, training: LiveTraining) -> str:
        """Undo the last change; its title. There must be one."""
        change, self._done = self._done[-1], self._done[:-1]
        self._undone = (*self._undone, change)
        _restore(session, training, change.after, change.before)
        return change.title

    def redo(self, session: Session, training: LiveTraining) -> str:
        """Do again what was undone last; its title. There must be something."""
        change, self._undone = self._undone[-1], self._undone[:-1]
        self._done = (*self._done, replace(change, when=0.0))
        _restore(session, training, change.before, change.after)
        return change.title


def _restore(session: Session, training: LiveTraining, present: State, wanted: State) -> None:
    # First: slots can show the packs of these runs again then.
    for number in wanted.get(DISCARDED, frozenset()) ^ present.get(DISCARDED, frozenset()):
        training.set_discarded(number, number in wanted[DISCARDED])
    known = {name: value for name, value in wanted.items() if not _is_closed(value, session)}
    view = _of(known, VIEW)
    if "camera" in view:
        session.navigation.motion = None
    session.view = replace(session.view, **view)
    session.settings = replace(session.settings, **_of(known, SETTINGS))
    session.resolution = known.get(RESOLUTION, session.resolution)
    for group, names in GROUPS.items():
        for name in names:
            if f"{group}.{name}" in known:
                setattr(getattr(session, group), name, known[f"{group}.{name}"])


def _is_closed(value: object, session: Session) -> bool:
    """Whether it is a slot whose source is not open any more."""
    return isinstance(value, Slot) and value.source not in session.open_sources


def _of(state: State, prefix: str) -> dict[str, Any]:
    return {name.removeprefix(prefix): value for name, value in state.items() if name.startswith(prefix)}
