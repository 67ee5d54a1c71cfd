"""Content of the window without a window, for scripts and tests."""

import time
from collections import deque
from collections.abc import Mapping
from pathlib import Path

import moderngl
from imgui_bundle import imgui, implot

from ntc.codec.model import Pack
from viewer.app.app import App
from viewer.gl.context import create_headless_context
from viewer.gl.read_back import Fence
from viewer.scene.model import Scene
from viewer.script.script import Script
from viewer.state.open_files import InitialView, new_session
from viewer.state.settings import ViewerSettings
from viewer.ui.theme import load_font

FRAME_SECONDS = 1.0 / 60.0
FRAMES_AHEAD = 2
"""Frames that the GPU may have yet to draw, as with a screen. Drivers keep all that frames ahead need: Mesa's llvmpipe gigabytes."""
REST_SECONDS = 0.02
"""Time between two looks for changes while a script waits, in seconds."""


class HeadlessApp(App):
    """Session, user interface and renderer without a window, driven by a script."""

    def __init__(
        self,
        scene: Scene,
        packs: Mapping[str, Pack],
        size: tuple[int, int],
        pictures: Path,
        settings: ViewerSettings | None = None,
        initial: InitialView | None = None,
        device: str | None = None,
    ) -> None:
        """Make the content. `size` (width, height) is in pixels, `pictures` is the folder for pictures and views, `device` is that of
        `create_headless_context`."""
        self._size = size
        self.graphics = create_headless_context(device)
        self.framebuffer = self._make_framebuffer(size)
        self._ahead: deque[Fence] = deque()
        """A fence after each frame that the GPU may have yet to draw."""
        self._imgui = imgui.create_context()
        imgui.set_current_context(self._imgui)
        implot.create_context()
        io = imgui.get_io()
        load_font()
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
        """Size (width, height) in pixels."""
        return self._size

    def resize(self, size: tuple[int, int]) -> None:
        """Resize the content, from the next frame on."""
        framebuffer = self._make_framebuffer(size)
        self._release_framebuffer()
        self.framebuffer, self._size = framebuffer, size
        imgui.get_io().display_size = imgui.ImVec2(*size)

    def _release_framebuffer(self) -> None:
        for texture in self.framebuffer.color_attachments:
            texture.release()
        self.framebuffer.release()

    def play(self, script: Script) -> None:
        """Play a script to its end. Raises InputError with its file and line where a line cannot be carried out."""
        awake = 0
        for turn in self.played(script):
            awake = max(awake, self.frontend.frames_needed(self._size))
            if turn == "frame" or awake > 0:
                awake = max(0, awake - 1)
                self.frame()
            else:
                # Background work needs the processors, and Python's lock.
                time.sleep(REST_SECONDS)

    def frame(self, count: int = 1) -> None:
        """Draw this many frames."""
        for _ in range(count):
            imgui.get_io().delta_time = FRAME_SECONDS
            self._apply_appearance(1.0)
            imgui.backends.opengl3_new_frame()
            imgui.new_frame()
            draw_data = self.frontend.build(self._size)
            self.frontend.paint(self.framebuffer, draw_data)
            self.frontend.presented()
            self._ahead.append(Fence(self.graphics.functions))
            if len(self._ahead) > FRAMES_AHEAD:
                self._ahead.popleft().wait()

    def close(self) -> None:
        """Free everything."""
        self.effects.close()
        self.training.close()
        for fence in self._ahead:
            fence.release()
        self.frontend.release()
        imgui.set_current_context(self._imgui)
        imgui.backends.opengl3_shutdown()
        implot.destroy_context()
        imgui.destroy_context(self._imgui)
        self._release_framebuffer()
        self.graphics.gl.release()
