"""Shared part of the window and its content without a window: session, training, drawing."""

from collections.abc import Iterator
from pathlib import Path

from imgui_bundle import imgui

from viewer.app.effects import Effects
from viewer.app.frontend import Frontend
from viewer.commands import run_or_notify
from viewer.commands.command import Context
from viewer.gl.context import GraphicsContext
from viewer.locations import unsaved_runs_folder
from viewer.script.host import ScriptHost, Turn
from viewer.script.script import Script, play_script
from viewer.state.session import Session
from viewer.training.run_store import UnsavedRuns
from viewer.ui.theme import Appearance
from viewer.ui.widgets import WidgetRects


class App(ScriptHost):
    """Session that is shown and driven by commands. An ImGui context is current in all calls."""

    prepares_ahead = False
    """True where a person may start an encoding at any moment; for scripts and tests the processes would be wasted."""
    autosaves_runs = False
    """True where runs are autosaved in the user's data folder."""

    def __init__(self, graphics: GraphicsContext, session: Session) -> None:
        self.session = session
        unsaved = UnsavedRuns(unsaved_runs_folder()) if self.autosaves_runs else None
        self.context = Context(session, imgui.get_clipboard_text, imgui.set_clipboard_text, unsaved)
        self.training = self.context.training
        self.effects = Effects(self.context)
        self.frontend = self._frontend(graphics)
        self._appearance = Appearance()

    def _frontend(self, graphics: GraphicsContext) -> Frontend:
        return Frontend(graphics, self.context, self.effects, self.prepares_ahead)

    @property
    def is_settled(self) -> bool:
        """True where further frames would show nothing new."""
        return not self.frontend.reasons(self.size)

    @property
    def is_opening(self) -> bool:
        """True while a file is being opened."""
        return self.effects.opening.is_under_way

    @property
    def is_closing(self) -> bool:
        """True where the window is to be closed."""
        return self.effects.is_closing

    @property
    def widgets(self) -> WidgetRects:
        """Labelled widgets of the last frame."""
        return self.frontend.interface.rects

    def run(self, command_id: str, *values: object) -> None:
        """Run a command with typed values; an error becomes a message."""
        run_or_notify(self.context, command_id, *values)

    def open_files(self, paths: list[Path]) -> None:
        """Open scenes and packs, as when they are dropped on the window."""
        for path in paths:
            self.run("file.open", path)

    def played(self, script: Script) -> Iterator[Turn]:
        """Play a script: yield for every frame that it needs, and while it waits. Raises InputError with file and line."""
        return play_script(script, self)

    def _apply_appearance(self, monitor_scale: float) -> None:
        """Apply theme and scale before a frame. `monitor_scale` is the monitor's pixels per window unit."""
        self._appearance.apply(self.session.settings.theme, self.session.settings.ui_scale, monitor_scale)
