"""Effects of commands outside the session: slow ones run in the background, others at their point of a frame."""

import time
from concurrent.futures import CancelledError
from functools import partial
from typing import TypeVar

import moderngl

from ntc.errors import InputError
from ntc.io import numbered_path, write_bytes
from viewer.app.exporting import Exporting
from viewer.capture.film import Film, read_pixels
from viewer.commands import run
from viewer.commands.command import Context
from viewer.commands.effects import (
    CancelExport,
    CancelOpening,
    CloseWindow,
    Effect,
    Export,
    Measure,
    OpenScene,
    RaisePanel,
    ReadVariant,
    ResetLayout,
    RunCommand,
    TakeFilm,
    TakePicture,
    WriteText,
)
from viewer.gl.context import GraphicsContext
from viewer.gl.program import ShaderError
from viewer.jobs.job import Job
from viewer.render.viewport import Viewport
from viewer.scene.images import write_png
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
    """Slow effects in their order. Frames show the scene before while another one is read."""

    def __init__(self, context: Context) -> None:
        self._context = context
        self._waiting: list[Slow] = []
        self._job: Job[ReadScene] | Job[Scene] | None = None
        """Job that reads files for the first of `_waiting`."""
        self._is_shown = False
        """True where a frame has shown what is waiting."""

    def add(self, effect: Slow) -> None:
        """Add an effect to the queue."""
        self._waiting.append(effect)

    @property
    def is_under_way(self) -> bool:
        """True while something is being opened."""
        return bool(self._waiting)

    @property
    def is_due(self) -> bool:
        """True where the next frame begins or ends an effect."""
        return self.is_under_way and (self._job is None or self._job.done)

    def advance(self) -> None:
        """Continue, before a frame, with what the last frame has shown."""
        while self._is_shown and self._waiting:
            effect, job = self._waiting[0], self._job
            if job is None and not isinstance(effect, RunCommand):
                self._job = self._read(effect).start("opening")
                return
            if job is not None and not job.done:
                return
            self._waiting.pop(0)
            self._job = None
            try:
                self._finish(effect, None if job is None else job.result())
            except CancelledError:
                name = effect.path.name if isinstance(effect, OpenScene) else "the material variant"
                notify(self._context.session, f"{name}: opening was cancelled")
            except InputError as error:
                notify(self._context.session, str(error), "error", details_of(error))

    def _read(self, effect: OpenScene | ReadVariant) -> Job[ReadScene] | Job[Scene]:
        if isinstance(effect, OpenScene):
            return Job(partial(read_scene, effect.path))
        return Job(partial(read_variant, self._context.session.scene, effect.variant))

    def _finish(self, effect: Slow, result: ReadScene | Scene | None) -> None:
        """Open the files that were read. Raises InputError."""
        context = self._context
        if isinstance(effect, RunCommand):
            run(context, effect.command_id, *effect.values)
        elif isinstance(result, Scene):
            show_variant(context.session, result)
        elif isinstance(effect, OpenScene) and isinstance(result, ReadScene):
            open_scene(context.session, result)

    def note_shown(self) -> None:
        """Note that a frame has shown `work`."""
        self._is_shown = self.is_under_way

    def cancel(self) -> None:
        """Cancel the reading."""
        if self._job is not None:
            self._job.cancel()

    @property
    def work(self) -> tuple[Work, ...]:
        """Present and waiting work, for the status bar."""
        result = [Work(_title(effect)) for effect in self._waiting]
        if self._job is not None:
            report = self._job.report
            result[0] = Work(result[0].title, report.share or None, report.seconds_left, "file.cancel-opening")
        return tuple(result)


REASONS = {
    RaisePanel: "a panel comes to the front",
    ResetLayout: "panels go back to their places",
    Measure: "the picture is measured",
    TakePicture: "a picture is written",
}
"""Reason of a frame, by the effect that waits for it."""
Kind = TypeVar("Kind")


class Effects:
    """Effects that are still to be carried out. They outlive a lost OpenGL context, and continue in the next one."""

    def __init__(self, context: Context) -> None:
        self._session, self._context = context.session, context
        self.opening = Opening(context)
        self.exporting = Exporting(context.session)
        self.is_closing = False
        """True where the window is to be closed."""
        self._waiting: tuple[Effect, ...] = ()
        self._film: Film | None = None
        context.perform = self.perform

    def perform(self, effect: Effect) -> None:
        """Carry out an effect, or keep it until its point of a frame. Raises InputError."""
        match effect:
            case OpenScene() | ReadVariant():
                self.opening.add(effect)
            case Export():
                self.exporting.begin(effect)
            case RunCommand() if effect.announced:
                self.opening.add(effect)
            case RunCommand():
                run(self._context, effect.command_id, *effect.values)
            case CancelOpening() | CancelExport():
                (self.opening if isinstance(effect, CancelOpening) else self.exporting).cancel()
            case WriteText():
                write_bytes(effect.path, effect.text.encode() if isinstance(effect.text, str) else effect.text)
                if effect.message:
                    notify(self._session, effect.message)
                if effect.then is not None:
                    self.perform(effect.then)
            case TakeFilm():
                self._end_film()
                self._film = Film(self._session.pictures_folder / effect.file) if effect.file is not None else None
            case CloseWindow():
                self.is_closing = True
            case Measure():
                # Its table is there.
                self._waiting = (*self._waiting, RaisePanel("Compare"), effect)
            case _:
                self._waiting = (*self._waiting, effect)

    @property
    def reasons(self) -> tuple[str, ...]:
        """Reasons for the next frame, as lines."""
        opened = ("a file is opened",) if self.opening.is_due else ()
        exported = ("an export has ended",) if self.exporting.is_due else ()
        return (*dict.fromkeys(REASONS[type(effect)] for effect in self._waiting), *opened, *exported)

    @property
    def need_whole_picture(self) -> bool:
        """True where the next picture must have full resolution."""
        return any(isinstance(effect, Measure | TakePicture) for effect in self._waiting)

    def take(self, kind: type[Kind]) -> list[Kind]:
        """Take the waiting effects of one kind, which the caller carries out."""
        taken: list[Kind] = [effect for effect in self._waiting if isinstance(effect, kind)]
        self._waiting = tuple(effect for effect in self._waiting if not isinstance(effect, kind))
        return taken

    def write_pictures(self, graphics: GraphicsContext, framebuffer: moderngl.Framebuffer, picture: Viewport) -> None:
        """Write and film the frame on its framebuffer. Raises ContextLostError; the rest waits for the next frame."""
        if self._film is not None and self._film.wants(now := time.monotonic()):
            self._film.add(read_pixels(framebuffer), now)
        for effect in [effect for effect in self._waiting if isinstance(effect, TakePicture)]:
            try:
                self._write_picture(effect, graphics, framebuffer, picture)
            except (InputError, ShaderError, moderngl.Error, MemoryError) as error:
                line = " ".join(str(error).split()) or "out of memory while writing the picture"
                notify(self._session, line, "error")
            self._waiting = tuple(other for other in self._waiting if other is not effect)

    def _write_picture(
        self, effect: TakePicture, graphics: GraphicsContext, framebuffer: moderngl.Framebuffer, picture: Viewport
    ) -> None:
        session, kind = self._session, effect.kind
        if effect.file is not None:
            path = session.pictures_folder / effect.file
        else:
            path = session.dated_file("" if kind == "window" else f"-{kind}", ".png")
        # Scripts name the exact file, and overwrite it each time.
        path = path if effect.quiet else numbered_path(path)
        shown = read_pixels(framebuffer) if kind == "window" else picture.alone(kind, session.window.picture_size)
        graphics.reset.check()
        write_png(path, shown)
        if not effect.quiet:
            notify(session, f"wrote {path.absolute()}")

    def _end_film(self) -> None:
        film, self._film = self._film, None
        if film is None:
            return
        try:
            count = film.write()
            notify(self._session, f"wrote {film.path}: {count} pictures")
        except (InputError, OSError, MemoryError) as error:
            notify(self._session, f"{film.path}: cannot be written ({error})", "error")

    def close(self) -> None:
        """End all effects: a film is written, a scene is not opened."""
        self._end_film()
        self.opening.cancel()
        self.exporting.close()
