"""Commands that would hold up the window's thread: scenes are read beside the frames, and what cannot be is announced by a frame."""

import time
from concurrent.futures import CancelledError
from functools import partial
from pathlib import Path
from typing import Any

from ntc.errors import InputError
from viewer.commands import run_or_notify
from viewer.commands.command import Context
from viewer.jobs.job import Job, JobReport
from viewer.scene.load import load_scene
from viewer.scene.model import Scene
from viewer.scene.scene_files import PACK_SUFFIX, PANORAMA_SUFFIXES
from viewer.state.event_handlers import apply_event, notify
from viewer.state.events import SceneRead
from viewer.state.message_log import details_of
from viewer.ui.facts import Work

OPENING = ("file.open", "file.open-recent")
READING_AGAIN = ("materials.variant",)
"""Reading a scene, and drawing it first, takes seconds."""
LEAST_SHARE = 0.03
"""Of the work: before that its end cannot be told."""
SECONDS_BETWEEN_FRAMES = 0.1
"""While a scene is read, frames show how far it is so often."""


def _read(path: Path, report: JobReport) -> Scene:
    return load_scene(path, report=report)


class SlowCommands:
    """Runs commands of the user interface. Slow ones wait for a frame that says what is done; the scene that one opens is read in a
    thread, while frames go on with the scene before."""

    def __init__(self, context: Context) -> None:
        self._context = context
        self._waiting: list[tuple[str, tuple[Any, ...]]] = []
        self._announced = False
        """Whether a frame shows what is waiting."""
        self._shown_at = self._began = 0.0

    def emit(self, command_id: str, *values: Any) -> None:
        """Run a command, or have it wait; what keeps it from being carried out becomes a message."""
        # Without a file, a dialog is opened.
        if (command_id in OPENING and values) or command_id in READING_AGAIN:
            self._waiting.append((command_id, values))
        else:
            run_or_notify(self._context, command_id, *values)

    @property
    def are_waiting(self) -> bool:
        """Whether something is still to be done."""
        return bool(self._waiting)

    @property
    def is_due(self) -> bool:
        """Whether the next frame does something, or shows how far the work is."""
        opening = self._context.opening
        if opening is None or opening.done:
            return self.are_waiting
        return time.monotonic() - self._shown_at >= SECONDS_BETWEEN_FRAMES

    def run_announced(self) -> None:
        """Before a frame: run what the last one has shown, one command after the other."""
        while self._announced and self._waiting:
            command_id, values = self._waiting[0]
            path = Path(str(values[0])) if command_id in OPENING else None
            if (
                path is not None
                and path.suffix.lower() not in (PACK_SUFFIX, *PANORAMA_SUFFIXES)
                and not self._has_read(path)
            ):
                return
            self._waiting.pop(0)
            run_or_notify(self._context, command_id, *values)

    def _has_read(self, path: Path) -> bool:
        """Whether the scene at `path` can be opened now; a command whose scene cannot be read, or is not wanted, is dropped."""
        job = self._context.opening
        if job is None:
            self._began = time.monotonic()
            self._context.opening = Job(partial(_read, path)).start("opening")
            return False
        if not job.done:
            return False
        self._context.opening = None
        session = self._context.session
        try:
            apply_event(session, SceneRead(path, job.result()))
            return True
        except CancelledError:
            notify(session, f"{path.name}: not opened, as you asked")
        except InputError as error:
            notify(session, str(error), "error", details_of(error))
        self._waiting.pop(0)
        return False

    def note_shown(self) -> None:
        """A frame has shown `work`."""
        self._announced, self._shown_at = bool(self._waiting), time.monotonic()

    def close(self) -> None:
        """End what is read."""
        if self._context.opening is not None:
            self._context.opening.cancel()
            self._context.opening = None

    @property
    def work(self) -> tuple[Work, ...]:
        """What is done, and about to be done, for the status bar."""
        titles = (
            f"opening {Path(str(values[0])).name}" if command_id in OPENING else "reading the scene again"
            for command_id, values in self._waiting
        )
        found = [Work(title) for title in titles]
        job = self._context.opening
        if job is not None and found:
            share = job.report.share
            seconds = time.monotonic() - self._began
            left = seconds * (1.0 - share) / share if share >= LEAST_SHARE else None
            found[0] = Work(found[0].title, share or None, left, "file.cancel-opening")
        return tuple(found)
