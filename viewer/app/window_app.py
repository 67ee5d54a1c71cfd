"""Window of moderngl-window, with the backends of ImGui and glfw, and a loop that sleeps while nothing changes."""

import contextlib
import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

# Before glfw: each of the two brings a libglfw, and both must use the same.
import imgui_bundle  # noqa: F401  # isort: skip
import glfw

from ntc.codec.model import Pack
from ntc.errors import InputError
from viewer.app.app import App
from viewer.app.imgui_window import (
    MOST_LOSSES,
    RECOVERED,
    RESET_SECONDS,
    ImguiWindow,
    LossHistory,
    Placement,
    context_lost_error,
    open_again,
)
from viewer.gl.context_loss import ContextLostError, SimulatedLosses
from viewer.locations import config_folder
from viewer.scene.model import Scene
from viewer.script.host import Turn
from viewer.script.script import Script
from viewer.state.event_handlers import notify
from viewer.state.open_files import InitialView, new_session
from viewer.state.settings import LAYOUT_FILE, load_settings, make_config_folder, save_settings
from viewer.ui.theme import Appearance
from viewer.ui.user_interface import SETTLING_FRAMES

IDLE_SECONDS = 0.2
"""Longest rest in seconds while nothing happens: messages must end, and coarse pictures become whole."""
WAITING_SECONDS = 0.02
"""Time between two looks whether a waiting script continues, in seconds."""
FRAMES_VARIABLE = "NTC_VIEWER_EXIT_AFTER_FRAMES"
"""Environment variable for tests: close after this many frames."""
LARGEST_MONITOR_SCALE = 4.0
PICTURES = Path("ntc-viewer-pictures")


@dataclass(frozen=True, eq=False)
class WindowContent:
    """Scene, packs, view and script that the window opens with."""

    scene: Scene
    packs: Mapping[str, Pack]
    initial: InitialView
    script: Script = ()
    """Script to play in the open window; the window stays open unless the script closes it."""
    size: tuple[int, int] | None = None
    """Size (width, height) in screen units; None takes the last size."""
    pictures: Path = PICTURES
    """Folder for pictures, views and paths."""


class WindowApp(App):
    """Session in a window, which is opened again where its OpenGL context is lost."""

    prepares_ahead = True
    autosaves_runs = True

    def __init__(self, content: WindowContent) -> None:
        folder = config_folder()
        settings, problem = load_settings(folder)
        self._folder: Path | None = folder
        """Folder for settings; None where they cannot be written."""
        try:
            make_config_folder(folder)
        except InputError as error:
            self._folder, problem = None, f"{error}; settings will not be saved"
        self._losses, self._lost_before = SimulatedLosses.of_environment(), LossHistory()
        self._size = content.size or settings.window_size
        """Last size in screen units."""
        self._awake = SETTLING_FRAMES
        self._window: ImguiWindow | None = None
        window = self._open(Placement(self._size))
        session = new_session(content.scene, content.packs, settings, content.initial, content.pictures)
        super().__init__(window.context, session)
        if settings.first_steps:
            self.run("help.first-steps")
        self._playing: Iterator[Turn] | None = self.played(content.script) if content.script else None
        if problem is not None:
            notify(self.session, problem, "error")

    def _open(self, placement: Placement, layout: str = "") -> ImguiWindow:
        layout_file = self._folder / LAYOUT_FILE if self._folder is not None else None
        self._window = ImguiWindow(placement, layout_file, layout, self._listen, self._losses)
        self._handle: Any = self._window.handle
        return self._window

    def _wake(self, *_event: object) -> None:
        self._awake = SETTLING_FRAMES

    def _listen(self, handle: Any) -> None:
        for listen in (
            glfw.set_cursor_pos_callback,
            glfw.set_mouse_button_callback,
            glfw.set_scroll_callback,
            glfw.set_key_callback,
            glfw.set_char_callback,
            glfw.set_window_refresh_callback,
            glfw.set_cursor_enter_callback,
        ):
            listen(handle, self._wake)
        listen_to_drops: Any = glfw.set_drop_callback
        listen_to_drops(handle, self._dropped)

    def _dropped(self, _window: object, paths: Any, *_rest: object) -> None:
        self.open_files([Path(path) for path in paths])
        self._wake()

    def _monitor_scale(self) -> float:
        """Return window units per unit of normal scale. Where a window has more pixels than units, ImGui draws finer by itself."""
        width, _ = glfw.get_window_size(self._handle)
        pixels, _ = glfw.get_framebuffer_size(self._handle)
        asked = glfw.get_window_content_scale(self._handle)[0]
        return min(max(asked * width / max(pixels, 1), 1.0), LARGEST_MONITOR_SCALE)

    def _frame(self, window: ImguiWindow, size: tuple[int, int]) -> None:
        self._apply_appearance(self._monitor_scale())
        window.set_title(self.session.scene.title)
        window.new_frame()
        draw_data = self.frontend.build(size)
        screen = window.context.gl.screen
        screen.viewport = (0, 0, *size)
        self.frontend.paint(screen, draw_data)
        glfw.swap_buffers(self._handle)
        self.frontend.presented()

    @property
    def size(self) -> tuple[int, int]:
        """Size (width, height) of the content in pixels."""
        width, height = glfw.get_framebuffer_size(self._handle)
        return width, height

    def resize(self, size: tuple[int, int]) -> None:
        """Ask the window system for this size of the content."""
        framebuffer, window = self.size, glfw.get_window_size(self._handle)
        # Screen units may be larger than pixels.
        width, height = (
            max(1, round(side * window[axis] / max(framebuffer[axis], 1))) for axis, side in enumerate(size)
        )
        glfw.set_window_size(self._handle, width, height)

    def _play_on(self) -> None:
        """Continue the script to where it needs the next frame or waits; a failing line ends it."""
        if self._playing is None:
            return
        try:
            if next(self._playing) == "rest":
                return
        except StopIteration:
            self._playing = None
        except InputError as error:
            self._playing = None
            notify(self.session, f"{error}; the script was stopped", "error")
        self._wake()

    def show(self, frames: int | None = None) -> None:
        """Draw until the window is closed, or `frames` frames have been drawn.

        A lost OpenGL context is replaced by a new window. Raises InputError where that fails or happens too often.
        """
        drawn = 0
        last_size = (0, 0)
        while self._window is not None and not (self.is_closing or drawn == frames):
            if glfw.window_should_close(self._handle):
                glfw.set_window_should_close(self._handle, False)
                self.run("file.quit")
                self._wake()
                continue
            try:
                with self._window.context.reset.watched():
                    size = self._next_size()
                    if size != last_size:
                        self._wake()
                    last_size = size
                    drawn += self._step(self._window, size, started=drawn > 0, always=frames is not None)
            except ContextLostError as lost:
                self._recover(self._window, lost)

    def _next_size(self) -> tuple[int, int]:
        """Handle events, and return the size (width, height) of the content in pixels; 0 while it is minimised."""
        glfw.poll_events()
        self._size = glfw.get_window_size(self._handle)
        return self.size

    def _step(self, window: ImguiWindow, size: tuple[int, int], started: bool, always: bool) -> int:
        """Draw a frame where one is due, else prepare the next one or rest. Returns the number of frames drawn."""
        if min(size) <= 0:
            glfw.wait_events_timeout(IDLE_SECONDS)
            return 0
        self._awake = max(self._awake, self.frontend.frames_needed(size))
        if started:
            self._play_on()
        if self._awake > 0 or self._keys_held() or always:
            self._awake = max(0, self._awake - 1)
            self._frame(window, size)
            return 1
        if not self.frontend.picture.prepare_next():
            longest = WAITING_SECONDS if self._playing is not None else IDLE_SECONDS
            glfw.wait_events_timeout(min(longest, self.frontend.seconds_until_change))
        return 0

    def _recover(self, window: ImguiWindow, lost: ContextLostError) -> None:
        """Continue in a new window with the data in memory. Raises InputError, with the view saved to a file, where that fails."""
        window.leave_frame(lost)
        placement, layout = window.placement, window.layout()
        window.context.reset.wait_until_over(RESET_SECONDS)
        self._close_window()
        if self._lost_before.add():
            raise context_lost_error(self.session, lost, f"{MOST_LOSSES} times within a minute") from lost
        try:
            window = open_again(lambda: self._open(placement, layout))
        except InputError as error:
            raise context_lost_error(self.session, lost, str(error)) from error
        earlier, self.frontend = self.frontend, self._frontend(window.context)
        self._appearance = Appearance()
        self.frontend.interface.bring_to_front(earlier.interface.panels_in_front)
        notify(self.session, RECOVERED, details=str(lost))
        self._wake()

    def _close_window(self) -> None:
        """Free the GPU's memory and the window. The session stays."""
        window, self._window = self._window, None
        if window is not None:
            with contextlib.suppress(Exception):
                # A lost context may refuse to free memory.
                self.frontend.release()
            window.close()

    def _keys_held(self) -> bool:
        """Return True where a held key moves the camera."""
        return any(glfw.get_key(self._handle, key) == glfw.PRESS for key in map(ord, "WASDQE"))

    def leave(self, error: BaseException) -> None:
        """End a frame that `error` interrupted; call it before `close`."""
        if self._window is not None:
            self._window.leave_frame(error)

    def close(self) -> None:
        """Save settings and layout, and free everything."""
        width, height = self._size
        settings = self.session.present_settings
        try:
            if width > 0 and height > 0:
                settings = replace(settings, window_size=(max(width, 320), max(height, 200)))
            if self._folder is not None:
                save_settings(self._folder, settings)
        finally:
            self.effects.close()
            self.training.close()
            self._close_window()


def run_window(content: WindowContent) -> int:
    """Open the window and stay until it is closed. Raises InputError where no window can be opened."""
    app = WindowApp(content)
    frames = os.environ.get(FRAMES_VARIABLE, "")
    try:
        app.show(int(frames) if frames.isdigit() else None)
    except BaseException as error:
        app.leave(error)
        raise
    finally:
        app.close()
    return 0
