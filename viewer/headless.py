"""The window's content without a window: for tests that click and take pictures."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from imgui_bundle import imgui, implot
from numpy.typing import NDArray

from ntc.pack import Pack
from viewer.actions import OpenFile
from viewer.frontend import SETTLING_FRAMES, Frontend, read_pixels
from viewer.gl.context import create_headless_context
from viewer.scene.model import Scene
from viewer.session import FirstLook, Session
from viewer.settings import ViewerSettings

FRAME_SECONDS = 1.0 / 60.0


class HeadlessApp:
    """Session, user interface and renderer under EGL, driven by calls instead of a person."""

    def __init__(
        self,
        scene: Scene,
        packs: Mapping[str, Pack],
        size: tuple[int, int],
        pictures: Path,
        settings: ViewerSettings | None = None,
        first: FirstLook | None = None,
    ) -> None:
        self._size = size
        self._context = create_headless_context()
        gl = self._context.gl
        self._framebuffer = gl.framebuffer([gl.texture(size, 4)])
        self._imgui = imgui.create_context()
        imgui.set_current_context(self._imgui)
        implot.create_context()
        io = imgui.get_io()
        io.set_ini_filename("")
        io.display_size = imgui.ImVec2(*size)
        imgui.backends.opengl3_init("#version 330")
        self.session = Session(scene, packs, settings or ViewerSettings(), first or FirstLook())
        self.frontend = Frontend(self._context, self.session, pictures)

    def frame(self, count: int = 1) -> None:
        """Draw this many frames."""
        for _ in range(count):
            imgui.get_io().delta_time = FRAME_SECONDS
            imgui.backends.opengl3_new_frame()
            imgui.new_frame()
            draw_data = self.frontend.build(self._size)
            self.frontend.paint(self._framebuffer, draw_data)

    def settle(self) -> None:
        """Draw until the layout rests."""
        self.frame(SETTLING_FRAMES)

    def move(self, x: float, y: float) -> None:
        """Move the mouse."""
        imgui.get_io().add_mouse_pos_event(x, y)
        self.frame()

    def button(self, down: bool, button: int = 0) -> None:
        """Press or let go of a mouse button (0 left, 1 right, 2 middle)."""
        imgui.get_io().add_mouse_button_event(button, down)
        self.frame()

    def click(self, label: str) -> None:
        """Click on the widget called `label`. Raises KeyError when there is none."""
        self.click_at(*self.frontend.interface.items.centre(label))

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
        """Press or let go of a key."""
        imgui.get_io().add_key_event(key, down)
        self.frame()

    def press(self, key: imgui.Key) -> None:
        """Press a key and let it go."""
        self.key(key, True)
        self.key(key, False)
        self.settle()

    def type(self, text: str) -> None:
        """Type into the active field."""
        imgui.get_io().add_input_characters_utf8(text)
        self.settle()

    def drop(self, path: Path) -> None:
        """Drop a file on the window."""
        self.session.apply(OpenFile(path))
        self.settle()

    def screenshot(self) -> NDArray[np.uint8]:
        """[H, W, 3] uint8: what the window would show."""
        return read_pixels(self._framebuffer)

    def close(self) -> None:
        """Free everything."""
        self.session.close()
        self.frontend.release()
        imgui.set_current_context(self._imgui)
        imgui.backends.opengl3_shutdown()
        implot.destroy_context()
        imgui.destroy_context(self._imgui)
        self._framebuffer.release()
        self._context.gl.release()
