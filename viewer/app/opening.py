"""What is opened one after the other: scenes are read beside the frames, and a frame says what holds up the window before it does."""

import time
from concurrent.futures import CancelledError
from functools import partial

from ntc.errors import InputError
from viewer.app.work_under_way import seconds_left
from viewer.commands import run
from viewer.commands.command import Context
from viewer.commands.effects import OpenScene, ReadVariant, RunCommand
from viewer.commands.leaving import asks_about_runs
from viewer.jobs.job import Job
from viewer.scene.model import Scene
from viewer.state.event_handlers import notify
from viewer.state.message_log import details_of
from viewer.state.open_files import ReadScene, open_scene, read_scene, read_variant, show_variant
from viewer.ui.facts import Work

Slow = OpenScene | ReadVariant | RunCommand


def _title(effect: Slow) -> str:
    if isinstance(effect, RunCommand):
        return effect.announced
    return f"opening {effect.path.name}" if isinstance(effect, OpenScene) else "reading the scene again"


class Opening:
    """Carries out slow effects, the first one first. Frames go on with the scene before while another one is read."""

    def __init__(self, context: Context) -> None:
        self._context = context
        self._waiting: list[Slow] = []
        self._job: Job[ReadScene] | Job[Scene] | None = None
        """What reads for the first of `_waiting`."""
        self._is_shown = False
        """Whether a frame shows what is waiting."""
        self._began = 0.0

    def add(self, effect: Slow) -> None:
        """Have an effect wait for its turn."""
        self._waiting.append(effect)

    @property
    def is_under_way(self) -> bool:
        """Whether something is still to be opened."""
        return bool(self._waiting)

    @property
    def is_due(self) -> bool:
        """Whether the next frame begins or ends something."""
        return self.is_under_way and (self._job is None or self._job.done)

    def advance(self) -> None:
        """Before a frame: go on with what the last one has shown."""
        while self._is_shown and self._waiting:
            effect, job = self._waiting[0], self._job
            if job is None and not isinstance(effect, RunCommand):
                self._job, self._began = self._read(effect).start("opening"), time.monotonic()
                return
            if job is not None and not job.done:
                return
            self._waiting.pop(0)
            self._job = None
            try:
                self._finish(effect, None if job is None else job.result())
            except CancelledError:
                name = effect.path.name if isinstance(effect, OpenScene) else "the material variant"
                notify(self._context.session, f"{name}: not opened, as you asked")
            except InputError as error:
                notify(self._context.session, str(error), "error", details_of(error))

    def _read(self, effect: OpenScene | ReadVariant) -> Job[ReadScene] | Job[Scene]:
        if isinstance(effect, OpenScene):
            return Job(partial(read_scene, effect.path))
        return Job(partial(read_variant, self._context.session.scene, effect.variant))

    def _finish(self, effect: Slow, found: ReadScene | Scene | None) -> None:
        """Open what was read. Raises InputError."""
        context = self._context
        if isinstance(effect, RunCommand):
            run(context, effect.command_id, *effect.values)
        elif isinstance(found, Scene):
            show_variant(context.session, found)
        elif isinstance(effect, OpenScene) and isinstance(found, ReadScene):
            what = f"{effect.path.name} is opened"
            # Runs may have begun while it was read.
            if effect.decision is None and asks_about_runs(context, what, "file.open-leaving", effect.path):
                return
            open_scene(context.session, found)
            if effect.decision is not None:
                context.training.leave_scene(effect.decision)
            if effect.then is not None:
                run(context, effect.then.command_id, *effect.then.values)

    def note_shown(self) -> None:
        """A frame has shown `work`."""
        self._is_shown = self.is_under_way

    def cancel(self) -> None:
        """End what is read."""
        if self._job is not None:
            self._job.cancel()

    @property
    def work(self) -> tuple[Work, ...]:
        """What is done, and about to be done, for the status bar."""
        found = [Work(_title(effect)) for effect in self._waiting]
        if self._job is not None:
            share = self._job.report.share
            found[0] = Work(found[0].title, share or None, seconds_left(share, self._began), "file.cancel-opening")
        return tuple(found)
