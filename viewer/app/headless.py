"""The window's content without a window: for scripts, and for tests that click and take pictures."""

from collections.abc import Mapping
from pathlib import Path

import moderngl
import numpy as np
from imgui_bundle import imgui, implot
from numpy.typing import NDArray

from ntc.pack.model import Pack
from viewer.app.app import App
from viewer.capture.picture_writer import read_pixels
from viewer.gl.context import create_headless_context
from viewer.scene.model import Scene
from viewer.script.parse import Script
from viewer.state.open_files import InitialView, new_session
from viewer.state.settings import ViewerSettings
from viewer.ui.user_interface import SETTLING_FRAMES

FRAME_SECONDS = 1.0 / 60.0


class HeadlessApp(App):
    """Session, user interface and renderer under EGL, driven by calls instead of a person."""

    def __init__(
        self,
        scene: Scene,
        packs: Mapping[str, Pack],
        size: tuple[int, int],
        pictures: Path,
        settings: ViewerSettings | None = None,
        initial: InitialView | None = None,
    ) -> None:
        """`size` (width, height) in pixels; `pictures`: where pictures, views and camera paths are written."""
        self._size = size
        self.graphics = create_headless_context()
        self._framebuffer = self._make_framebuffer(size)
        self._imgui = imgui.create_context()
        imgui.set_current_context(self._imgui)
        implot.create_context()
        io = imgui.get_io()
        io.set_ini_filename("")
        io.config_flags |= imgui.ConfigFlags_.docking_enable
        io.display_size = imgui.ImVec2(*size)
        imgui.backends.opengl3_init("#version 330")
        session = new_session(scene, packs, settings or ViewerSettings(), initial or InitialView(), pictures)
        super().__init__(self.graphics, session)

    def _make_framebuffer(self, size: tuple[int, int]) -> moderngl.Framebuffer:
        memory, what = self.graphics.memory, f"a window of {size[0]} x {size[1]}"
        with memory.transaction():
            return memory.framebuffer(what, [memory.texture(what, size, 4)])

    @property
    def size(self) -> tuple[int, int]:
        """(width, height) in pixels."""
        return self._size

    def resize(self, size: tuple[int, int]) -> None:
        """Give the content this size, from the next frame on."""
        framebuffer = self._make_framebuffer(size)
        self._release_framebuffer()
        self._framebuffer, self._size = framebuffer, size
        imgui.get_io().display_size = imgui.ImVec2(*size)

    def _release_framebuffer(self) -> None:
        for texture in self._framebuffer.color_attachments:
            texture.release()
        self._framebuffer.release()

    def play(self, script: Script) -> None:
        """Play a script to its end. Raises InputError with its file and line where a line cannot be carried out."""
        for _ in self.played(script):
            self.frame()

    def frame(self, count: int = 1) -> None:
        """Draw this many frames."""
        for _ in range(count):
            imgui.get_io().delta_time = FRAME_SECONDS
            self._apply_appearance(1.0)
            imgui.backends.opengl3_new_frame()
            imgui.new_frame()
            draw_data = self.frontend.build(self._size)
            self.frontend.paint(self._framebuffer, draw_data)

    def settle(self) -> None:
        """Draw until the layout rests."""
        self.frame(SETTLING_FRAMES)
        while self.frontend.interface.is_settling(self.session):
            self.frame()

    def move(self, x: float, y: float) -> None:
        """Move the mouse."""
        imgui.get_io().add_mouse_pos_event(x, y)
        self.frame()

    def button(self, down: bool, button: int = 0) -> None:
        """Press or release a mouse button (0 left, 1 right, 2 middle)."""
        imgui.get_io().add_mouse_button_event(button, down)
        self.frame()

    def show_panel(self, title: str) -> None:
        """Bring a panel to the front."""
        self.run("window.panel", title)
        self.settle()

    def double_click(self, label: str) -> None:
        """Click twice on the widget called `label`. Raises KeyError when there is none."""
        self.move(*self.widgets.centre(label))
        for down in (True, False, True, False):
            self.button(down)
        self.settle()

    def click(self, label: str) -> None:
        """Click on the widget called `label`. Raises KeyError when there is none."""
        self.click_at(*self.widgets.centre(label))

    def click_at(self, x: float, y: float) -> None:
        """Click at a place in window pixels."""
        self.move(x, y)
        self.button(True)
        self.button(False)
        self.settle()

    def drag(self, start: tuple[float, float], end: tuple[float, float], button: int = 0) -> None:
        """Drag from one place to another."""
        self.move(*start)
        self.button(True, button)
        for share in (0.5, 1.0):
            self.move(start[0] + (end[0] - start[0]) * share, start[1] + (end[1] - start[1]) * share)
        self.button(False, button)
        self.settle()

    def key(self, key: imgui.Key, down: bool) -> None:
        """Press or release a key."""
        imgui.get_io().add_key_event(key, down)
        self.frame()

    def press(self, key: imgui.Key) -> None:
        """Press and release a key."""
        self.key(key, True)
        self.key(key, False)
        self.settle()

    def type(self, text: str) -> None:
        """Type into the active field."""
        imgui.get_io().add_input_characters_utf8(text)
        self.settle()

    def drop(self, path: Path) -> None:
        """Drop a file on the window."""
        self.open_files([path])
        self.settle()

    def screenshot(self) -> NDArray[np.uint8]:
        """[H, W, 3] uint8: what the window would show."""
        return read_pixels(self._framebuffer)

    def close(self) -> None:
        """Free everything."""
        self.training.close()
        self.frontend.release()
        imgui.set_current_context(self._imgui)
        imgui.backends.opengl3_shutdown()
        implot.destroy_context()
        imgui.destroy_context(self._imgui)
        self._release_framebuffer()
        self.graphics.gl.release()
