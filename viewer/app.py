"""The window: moderngl-window with glfw, ImGui's own backends, and a loop that rests while nothing changes."""

import ctypes
import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

# Before glfw: each of the two brings a libglfw, and both must use the same.
from imgui_bundle import imgui, implot  # isort: skip
import glfw
from moderngl_window.context.glfw.window import Window

from ntc.errors import InputError
from ntc.pack import Pack
from viewer.actions import OpenFile
from viewer.folders import config_folder
from viewer.frontend import SETTLING_FRAMES, Frontend
from viewer.gl.context import REQUIRED_VERSION, wrap_context
from viewer.scene.model import Scene
from viewer.script.parse import Script
from viewer.script.play import play_script
from viewer.session import FirstLook, Session
from viewer.settings import LAYOUT_FILE, load_settings, make_config_folder, save_settings
from viewer.ui.theme import Appearance

TITLE = "ntc-viewer"
IDLE_SECONDS = 0.2
"""Longest rest while nothing happens: messages must end, and coarse pictures become whole."""
FRAMES_VARIABLE = "NTC_VIEWER_EXIT_AFTER_FRAMES"
"""Environment variable for tests: close after this many frames."""
LARGEST_MONITOR_SCALE = 4.0
PICTURES = Path("ntc-viewer-pictures")


@dataclass(frozen=True, eq=False)
class WindowContent:
    """What the window opens with."""

    scene: Scene
    packs: Mapping[str, Pack]
    first: FirstLook
    script: Script = ()
    """What is played when it has opened; then it stays open, unless the script closes it."""
    size: tuple[int, int] | None = None
    """(width, height) in screen units; None: as it was last."""
    pictures: Path = PICTURES
    """Folder for pictures, views and paths."""


def _open_window(size: tuple[int, int]) -> Window:
    version = (REQUIRED_VERSION // 100, REQUIRED_VERSION // 10 % 10)
    try:
        return Window(title=TITLE, size=size, gl_version=version, resizable=True, vsync=True, aspect_ratio=None)
    except Exception as error:
        raise InputError(
            f"no window could be opened ({error}); check DISPLAY and the OpenGL driver, or use ntc-viewer render"
        ) from error


class WindowApp:
    """A window around a Frontend."""

    def __init__(self, content: WindowContent) -> None:
        folder = config_folder()
        settings, problem = load_settings(folder)
        self._folder: Path | None = folder
        """Where settings are written; None where that cannot be: they are forgotten."""
        try:
            make_config_folder(folder)
        except InputError as error:
            self._folder, problem = None, f"{error}; settings are not kept"
        self._window = _open_window(content.size or settings.window_size)
        self._handle: Any = self._window._window
        self._context = wrap_context(self._window.ctx, self._address)
        imgui.create_context()
        implot.create_context()
        io = imgui.get_io()
        io.set_ini_filename(str(self._folder / LAYOUT_FILE) if self._folder is not None else "")
        io.config_flags |= imgui.ConfigFlags_.docking_enable
        self._appearance = Appearance()
        self._awake = SETTLING_FRAMES
        self._listen()
        # ImGui's callbacks pass every event on to the ones that are installed before them.
        address = ctypes.cast(self._handle, ctypes.c_void_p).value or 0
        imgui.backends.glfw_init_for_opengl(address, True)
        imgui.backends.opengl3_init("#version 330")
        self.session = Session(content.scene, content.packs, settings, content.first)
        self.frontend = Frontend(self._context, self.session, content.pictures)
        self._playing: Iterator[None] | None = play_script(content.script, self) if content.script else None
        if problem is not None:
            self.session.say(problem, "error")

    @staticmethod
    def _address(name: str) -> int:
        return ctypes.cast(glfw.get_proc_address(name), ctypes.c_void_p).value or 0

    def _wake(self, *_event: object) -> None:
        self._awake = SETTLING_FRAMES

    def _listen(self) -> None:
        for listen in (
            glfw.set_cursor_pos_callback,
            glfw.set_mouse_button_callback,
            glfw.set_scroll_callback,
            glfw.set_key_callback,
            glfw.set_char_callback,
            glfw.set_window_refresh_callback,
            glfw.set_cursor_enter_callback,
        ):
            listen(self._handle, self._wake)
        listen_to_drops: Any = glfw.set_drop_callback
        listen_to_drops(self._handle, self._dropped)

    def _dropped(self, _window: object, paths: Any, *_rest: object) -> None:
        for path in paths:
            self.session.apply(OpenFile(Path(path)))
        self._wake()

    def _monitor_scale(self) -> float:
        """Window units per unit of normal scale. Where a window has more pixels than units, ImGui draws finer by itself."""
        width, _ = glfw.get_window_size(self._handle)
        pixels, _ = glfw.get_framebuffer_size(self._handle)
        asked = glfw.get_window_content_scale(self._handle)[0]
        return min(max(asked * width / max(pixels, 1), 1.0), LARGEST_MONITOR_SCALE)

    def _frame(self, size: tuple[int, int]) -> None:
        settings = self.session.settings
        self._appearance.apply(settings.theme, settings.ui_scale, self._monitor_scale())
        imgui.backends.opengl3_new_frame()
        imgui.backends.glfw_new_frame()
        imgui.new_frame()
        draw_data = self.frontend.build(size)
        screen = self._context.gl.screen
        screen.viewport = (0, 0, *size)
        self.frontend.paint(screen, draw_data)
        glfw.swap_buffers(self._handle)

    @property
    def size(self) -> tuple[int, int]:
        """(width, height) of the content in pixels."""
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
        """Let the script go on to where it needs the next frame; a line that cannot be carried out ends it."""
        if self._playing is None:
            return
        try:
            next(self._playing)
        except StopIteration:
            self._playing = None
        except InputError as error:
            self._playing = None
            self.session.say(f"{error}; the script ends here", "error")
        self._wake()

    def run(self, frames: int | None = None) -> None:
        """Draw until the window is closed, or `frames` frames have been drawn."""
        drawn = 0
        last_size = (0, 0)
        while not (glfw.window_should_close(self._handle) or self.session.closing or drawn == frames):
            glfw.poll_events()
            width, height = glfw.get_framebuffer_size(self._handle)
            if width <= 0 or height <= 0:
                # Minimised.
                glfw.wait_events_timeout(IDLE_SECONDS)
                continue
            if (width, height) != last_size or self.frontend.needs_frame((width, height)):
                self._wake()
            last_size = (width, height)
            if drawn > 0:
                self._play_on()
            if self._awake > 0 or self._keys_held() or frames is not None:
                self._awake = max(0, self._awake - 1)
                self._frame((width, height))
                drawn += 1
            elif not self.frontend.prepare_next():
                glfw.wait_events_timeout(min(IDLE_SECONDS, self.frontend.seconds_until_change))

    def _keys_held(self) -> bool:
        """Whether a held key moves the camera."""
        return any(glfw.get_key(self._handle, key) == glfw.PRESS for key in map(ord, "WASDQE"))

    def close(self) -> None:
        """Remember settings and layout, and free everything."""
        width, height = glfw.get_window_size(self._handle)
        settings = self.session.present_settings()
        try:
            if width > 0 and height > 0:
                settings = replace(settings, window_size=(max(width, 320), max(height, 200)))
            if self._folder is not None:
                save_settings(self._folder, settings)
        finally:
            self.session.close()
            self.frontend.release()
            imgui.backends.opengl3_shutdown()
            imgui.backends.glfw_shutdown()
            implot.destroy_context()
            imgui.destroy_context()
            self._window.destroy()


def run_window(content: WindowContent) -> int:
    """Open the window and stay until it is closed. Raises InputError where no window can be opened."""
    app = WindowApp(content)
    frames = os.environ.get(FRAMES_VARIABLE, "")
    try:
        app.run(int(frames) if frames.isdigit() else None)
    finally:
        app.close()
    return 0
