"""What the window and its content without one have in common: a session, what trains for it, and what draws it."""

from collections.abc import Iterator
from pathlib import Path

from imgui_bundle import imgui

from viewer.app.effects import Effects
from viewer.app.frontend import Frontend
from viewer.commands import run_or_notify
from viewer.commands.command import Context
from viewer.gl.context import GraphicsContext
from viewer.locations import kept_runs_folder
from viewer.script.script import Script, play_script
from viewer.script.stage import Turn
from viewer.state.session import Session
from viewer.training.kept_runs import KeptRuns
from viewer.ui.theme import Appearance
from viewer.ui.widgets import WidgetRects


class App:
    """A session that is shown, and driven by commands. An ImGui context is current in all calls."""

    prepares_ahead = False
    """Whether a person may ask for an encoding at any moment; scripts and tests would start processes for nothing."""
    keeps_runs = False
    """Whether runs that nobody has decided about are kept in the user's data folder."""

    def __init__(self, graphics: GraphicsContext, session: Session) -> None:
        self.session = session
        kept = KeptRuns(kept_runs_folder()) if self.keeps_runs else None
        self.context = Context(session, imgui.get_clipboard_text, imgui.set_clipboard_text, kept)
        self.training = self.context.training
        self.effects = Effects(self.context)
        self.frontend = self._frontend(graphics)
        self._appearance = Appearance()

    def _frontend(self, graphics: GraphicsContext) -> Frontend:
        return Frontend(graphics, self.context, self.effects, self.prepares_ahead)

    @property
    def size(self) -> tuple[int, int]:
        """(width, height) of the content in pixels."""
        raise NotImplementedError

    @property
    def is_settled(self) -> bool:
        """Whether nothing is to come that the next frames would show."""
        return not self.frontend.reasons(self.size)

    @property
    def is_opening(self) -> bool:
        """Whether a file is still to be opened."""
        return self.effects.opening.is_under_way

    @property
    def is_closing(self) -> bool:
        """Whether the window is to be closed."""
        return self.effects.is_closing

    @property
    def widgets(self) -> WidgetRects:
        """The labelled widgets of the last frame."""
        return self.frontend.interface.rects

    def resize(self, size: tuple[int, int]) -> None:
        """Give the content this size (width, height) in pixels, from the next frame on."""
        raise NotImplementedError

    def run(self, command_id: str, *values: object) -> None:
        """Run a command with typed values; what keeps it from being carried out becomes a message."""
        run_or_notify(self.context, command_id, *values)

    def open_files(self, paths: list[Path]) -> None:
        """Open scenes and packs, as when they are dropped on the window."""
        for path in paths:
            self.run("file.open", path)

    def played(self, script: Script) -> Iterator[Turn]:
        """Plays a script: yields for every frame that it needs, and while it waits. Raises InputError with its file and line."""
        return play_script(script, self)

    def _apply_appearance(self, monitor_scale: float) -> None:
        """To be called before a frame begins. `monitor_scale`: pixels per window unit that the monitor asks for."""
        self._appearance.apply(self.session.settings.theme, self.session.settings.ui_scale, monitor_scale)
