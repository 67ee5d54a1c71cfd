"""Commands that hold up the window's thread: a frame says what is being done before they are run."""

from pathlib import Path
from typing import Any

from viewer.commands import run_or_notify
from viewer.commands.command import Context
from viewer.ui.facts import Work

OPENING = ("file.open", "file.open-recent")
READING_AGAIN = ("materials.variant", "animation.time", "animation.rest")
"""Reading a scene, and drawing it first, takes seconds."""


class SlowCommands:
    """Runs commands of the user interface, slow ones two frames later: the status bar shows them in between."""

    def __init__(self, context: Context) -> None:
        self._context = context
        self._waiting: list[tuple[str, tuple[Any, ...]]] = []
        self._announced = False
        """Whether a frame shows what is waiting."""

    def emit(self, command_id: str, *values: Any) -> None:
        """Run a command, or have it wait; what keeps it from being carried out becomes a message."""
        # Without a file, a dialog is opened.
        if (command_id in OPENING and values) or command_id in READING_AGAIN:
            self._waiting.append((command_id, values))
        else:
            run_or_notify(self._context, command_id, *values)

    @property
    def are_waiting(self) -> bool:
        """Whether the next frames do something."""
        return bool(self._waiting)

    def run_announced(self) -> None:
        """Before a frame: run what the last one has shown."""
        if self._announced:
            waiting, self._waiting, self._announced = self._waiting, [], False
            for command_id, values in waiting:
                run_or_notify(self._context, command_id, *values)

    def note_shown(self) -> None:
        """A frame has shown `work`."""
        self._announced = bool(self._waiting)

    @property
    def work(self) -> tuple[Work, ...]:
        """What is about to be done, for the status bar."""
        return tuple(
            Work(f"opening {Path(str(values[0])).name}" if command_id in OPENING else "reading the scene again")
            for command_id, values in self._waiting
        )
