"""History of changes to the view, the settings and the panels, for undo and redo."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields, replace
from operator import attrgetter
from time import monotonic
from typing import Any

from viewer.scene.model import Scene
from viewer.state.session import Session
from viewer.state.view_state import Slot

SECONDS_TOGETHER = 1.0
"""Time in seconds within which repetitions of one command, such as those of a drag, count as one change."""
MOST_CHANGES = 200
NOT_UNDONE = (
    "view.size",
    *(f"settings.{name}" for name in ("window_size", "column_folded", "keys", "first_steps", "recent_files")),
)
"""Fields that undo does not change, because they follow the window or record recent files."""
VALUES = ("view", "settings")
"""Attributes of the session whose fields are undone separately."""
NAMES = (
    *VALUES,
    "resolution",
    *(f"navigation.{name}" for name in ("bookmarks", "speed_notches")),
    *(f"inspection.{name}" for name in ("selected_texture", "flat_texture", "block", "pixel", "errors")),
    *(f"window.{name}" for name in ("open_panels", "show_panels", "flickers")),
)
"""Attributes of the session that can be undone. Their values are immutable."""
_read = attrgetter(*NAMES)


def present_state(session: Session) -> tuple[Any, ...]:
    """Return references to all values that can be undone, in the order of NAMES."""
    return tuple(_read(session))


def _changed(before: tuple[Any, ...], after: tuple[Any, ...]) -> Iterator[tuple[str, Any, Any]]:
    """Yield (name, value before, value after) of each difference; only different objects are compared."""
    for name, old, new in zip(NAMES, before, after, strict=True):
        if old is new:
            continue
        if name in VALUES:
            for field in fields(new):
                if f"{name}.{field.name}" not in NOT_UNDONE:
                    yield f"{name}.{field.name}", getattr(old, field.name), getattr(new, field.name)
        else:
            yield name, old, new


@dataclass(frozen=True)
class Change:
    """Change by one command, or by successive runs of the same command."""

    command_id: str
    title: str
    values: Mapping[str, tuple[Any, Any]]
    """(value before, value after) by name."""
    when: float
    """Monotonic time of the last repetition, in seconds."""


class History:
    """History of the changes in one window and one scene."""

    def __init__(self) -> None:
        self._done: tuple[Change, ...] = ()
        self._undone: tuple[Change, ...] = ()
        self._scene: Scene | None = None

    def can_undo(self, session: Session) -> bool:
        """Return True where there is a change to undo."""
        return bool(self._done) and self._scene is session.scene

    def can_redo(self, session: Session) -> bool:
        """Return True where a change was undone and no other change was made since."""
        return bool(self._undone) and self._scene is session.scene

    def note(self, command_id: str, title: str, before: tuple[Any, ...], after: tuple[Any, ...], scene: Scene) -> None:
        """Record that a command changed state `before` to `after` (`present_state`). Another `scene` empties the history first."""
        if scene is not self._scene:
            self._done, self._undone, self._scene = (), (), scene
        values = {name: (old, new) for name, old, new in _changed(before, after) if old != new}
        if not values:
            return
        self._undone, now = (), monotonic()
        last = self._done[-1] if self._done else None
        if last is not None and last.command_id == command_id and now - last.when < SECONDS_TOGETHER:
            together = {name: (last.values.get(name, pair)[0], pair[1]) for name, pair in values.items()}
            values, self._done = {**last.values, **together}, self._done[:-1]
        self._done = (*self._done, Change(command_id, title, values, now))[-MOST_CHANGES:]

    def undo(self, session: Session) -> str:
        """Undo the last change, which must exist, and return its title."""
        change, self._done = self._done[-1], self._done[:-1]
        self._undone = (*self._undone, change)
        _restore(session, {name: (new, old) for name, (old, new) in change.values.items()})
        return change.title

    def redo(self, session: Session) -> str:
        """Redo the change that was undone last, which must exist, and return its title."""
        change, self._undone = self._undone[-1], self._undone[:-1]
        self._done = (*self._done, replace(change, when=0.0))
        _restore(session, change.values)
        return change.title


def _restore(session: Session, values: Mapping[str, tuple[Any, Any]]) -> None:
    """Set the attributes in `values`, by name (present value, new value), to their new values."""
    if "view.camera" in values:
        session.navigation.motion = None
    for path, (_, value) in values.items():
        group, _, name = path.rpartition(".")
        # A slot whose source was closed stays as it is.
        if isinstance(value, Slot) and value.source not in session.open_sources:
            continue
        if group in VALUES:
            setattr(session, group, replace(getattr(session, group), **{name: value}))
        else:
            setattr(getattr(session, group) if group else session, name, value)
