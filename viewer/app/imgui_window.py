"""Window of the window system with its OpenGL context and ImGui, and what to do when a reset driver loses them."""

import contextlib
import ctypes
import shlex
import time
import traceback
import warnings
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, TypeVar

# Before glfw: each of the two brings a libglfw, and both must use the same.
from imgui_bundle import imgui, implot  # isort: skip
import glfw
from moderngl_window.context.glfw.window import Window

from ntc.errors import InputError
from ntc.io import write_text
from viewer.gl.context import GraphicsContext, wrap_context
from viewer.gl.context_loss import ContextLostError, SimulatedLosses
from viewer.gl.features import COMPUTE_VERSION, DRAWING_VERSION
from viewer.gl.systems import SYSTEM, set_up_drivers
from viewer.state.pack_files import packs_beside
from viewer.state.session import Session
from viewer.state.view_file import present_view, view_json
from viewer.ui.theme import load_font

RECOVERED: Final = "the graphics driver was reset; everything was uploaded again"
MOST_LOSSES = 3
"""Number of losses within LOSS_SECONDS that ends the window."""
LOSS_SECONDS = 60.0
RESET_SECONDS = 2.0
"""Longest wait for the end of a driver's reset, in seconds."""
PAUSES: Final = (0.0, 1.0, 3.0)
"""Seconds before each attempt to open a new window: a driver that restarts is not there at once."""

Opened = TypeVar("Opened")


class LossHistory:
    """Times at which contexts were lost."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._losses: deque[float] = deque(maxlen=MOST_LOSSES)

    def add(self) -> bool:
        """Record a loss; returns True where too many came in a short time."""
        self._losses.append(self._clock())
        return len(self._losses) == MOST_LOSSES and self._losses[-1] - self._losses[0] <= LOSS_SECONDS


def open_again(open_window: Callable[[], Opened], pauses: Sequence[float] = PAUSES) -> Opened:
    """Return the result of `open_window`, which is tried after each of `pauses`. Raises the InputError of the last attempt."""
    for pause in pauses[:-1]:
        time.sleep(pause)
        try:
            return open_window()
        except InputError:
            continue
    time.sleep(pauses[-1])
    return open_window()


def _command(session: Session, view: Path) -> str:
    """Return the command line that opens `view` again."""
    scene, packs = session.scene.path, [pack.path for pack in session.packs.values() if pack.path is not None]
    beside = {path.resolve() for path in packs_beside(scene)} if scene is not None else set()
    named = [str(path.resolve()) for path in packs if path.resolve() not in beside]
    arguments = [
        "ntc-viewer",
        "view",
        *([str(scene.resolve())] if scene is not None else []),
        *(["--pack", *named] if named else []),
        "--exec",
        f"view.load {shlex.quote(str(view))}",
        *(["--exec", f"materials.variant {shlex.quote(session.scene.variant)}"] if session.scene.variant else []),
    ]
    return shlex.join(arguments)


def context_lost_error(session: Session, lost: ContextLostError, why: str) -> InputError:
    """Save the view to a file, and return the error to end with; `why` says why there is no new window."""
    path = session.dated_file("-view", ".json").resolve()
    try:
        write_text(path, view_json(present_view(session)))
    except InputError as error:
        return InputError(f"{lost}, {why}; the view could not be saved: {error}")
    return InputError(f"{lost}, {why}; the view is saved; to open it again: {_command(session, path)}")


TITLE = "ntc-viewer"


def _open(size: tuple[int, int], version: int, robust: bool) -> Window:
    """Open a window; with `robust` its context reports its loss. Raises the errors of moderngl-window, moderngl and glfw."""
    gl_version = (version // 100, version // 10 % 10)
    # moderngl-window has no such hint and does not reset hints; initialising glfw twice is harmless.
    if robust and glfw.init():
        glfw.window_hint(glfw.CONTEXT_ROBUSTNESS, glfw.LOSE_CONTEXT_ON_RESET)
    try:
        return Window(title=TITLE, size=size, gl_version=gl_version, resizable=True, vsync=True, aspect_ratio=None)
    except BaseException:
        # This removes hints and windows made so far.
        glfw.terminate()
        raise


def _open_best(size: tuple[int, int]) -> Window:
    """Open a window with the best context of its driver: one that reports losses where possible, else an older version."""
    set_up_drivers()
    problem: Exception | None = None
    for version in (COMPUTE_VERSION, DRAWING_VERSION):
        for robust in (True, False):
            # glfw, moderngl and moderngl-window raise many types, even plain Exception.
            try:
                with warnings.catch_warnings():
                    warnings.simplefilter("ignore", glfw.GLFWError)
                    return _open(size, version, robust)
            except Exception as error:  # noqa: BLE001
                problem = error
    raise InputError(f"no window could be opened ({problem}); {SYSTEM.window}, or use ntc-viewer render") from problem


@dataclass(frozen=True)
class Placement:
    """Place and size of a window in screen units."""

    size: tuple[int, int]
    position: tuple[int, int] | None = None
    """Upper left corner of the content; None leaves it to the window system."""
    maximized: bool = False


class ImguiWindow:
    """Open window. All calls belong to one thread; there is at most one window at a time."""

    def __init__(
        self,
        placement: Placement,
        layout_file: Path | None,
        layout: str,
        listen: Callable[[Any], None],
        losses: SimulatedLosses,
    ) -> None:
        """Open a window. `layout` is that of an earlier window, "" reads `layout_file`. `listen` installs callbacks on a glfw window.

        Raises InputError where no window can be opened.
        """
        self._window = _open_best(placement.size)
        self.handle: Any = self._window._window  # noqa: SLF001  moderngl-window offers no other way to the glfw handle.
        try:
            self.context: GraphicsContext = wrap_context(self._window.ctx, self._address, losses, waits=False)
        except InputError:
            glfw.terminate()
            raise
        self._title = TITLE
        self._place(placement)
        imgui.create_context()
        implot.create_context()
        load_font()
        io = imgui.get_io()
        io.set_ini_filename(str(layout_file) if layout_file is not None else "")
        io.config_flags |= imgui.ConfigFlags_.docking_enable
        if layout:
            imgui.load_ini_settings_from_memory(layout)
        # ImGui's callbacks pass every event on to callbacks installed before.
        listen(self.handle)
        address = ctypes.cast(self.handle, ctypes.c_void_p).value or 0
        imgui.backends.glfw_init_for_opengl(address, True)
        imgui.backends.opengl3_init("#version 330")

    def set_title(self, scene: str) -> None:
        """Show the scene's name in the title; the window system is asked only for a new one."""
        title = f"{scene} - {TITLE}"
        if title != self._title:
            self._title = title
            glfw.set_window_title(self.handle, title)

    @staticmethod
    def _address(name: str) -> int:
        return ctypes.cast(glfw.get_proc_address(name), ctypes.c_void_p).value or 0

    def _place(self, placement: Placement) -> None:
        # Under Wayland programs cannot place windows: glfw warns.
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", glfw.GLFWError)
            if placement.position is not None:
                # The window was created with the size times the monitor's scale; this sets the exact size.
                glfw.set_window_size(self.handle, *placement.size)
                glfw.set_window_pos(self.handle, *placement.position)
            if placement.maximized:
                glfw.maximize_window(self.handle)

    @property
    def placement(self) -> Placement:
        """Present place and size."""
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", glfw.GLFWError)
            width, height = glfw.get_window_size(self.handle)
            left, top = glfw.get_window_pos(self.handle)
            maximized = bool(glfw.get_window_attrib(self.handle, glfw.MAXIMIZED))
        return Placement((width, height), (left, top), maximized)

    def new_frame(self) -> None:
        """Begin ImGui's frame."""
        imgui.backends.opengl3_new_frame()
        imgui.backends.glfw_new_frame()
        imgui.new_frame()

    def layout(self) -> str:
        """Return the layout of panels for the next window; "" before the first frame, which reads it."""
        return imgui.save_ini_settings_to_memory() if imgui.get_frame_count() > 0 else ""

    def leave_frame(self, error: BaseException) -> None:
        """End the frame that `error` interrupted, maybe inside a panel; no frame follows.

        Objects of the interrupted calls are released: parts of ImGui must not outlive its context.
        """
        io = imgui.get_io()
        # ImGui then closes what is open, without complaints.
        io.config_error_recovery_enable_assert = io.config_error_recovery_enable_debug_log = False
        behind: BaseException | None = error
        while behind is not None:
            traceback.clear_frames(behind.__traceback__)
            behind = behind.__cause__ or behind.__context__
        if imgui.get_frame_count() > 0:
            imgui.end_frame()

    def close(self) -> None:
        """Free everything; a lost context may refuse, and is freed as a whole."""
        for free in (imgui.backends.opengl3_shutdown, imgui.backends.glfw_shutdown):
            with contextlib.suppress(Exception):
                free()
        implot.destroy_context()
        imgui.destroy_context()
        with contextlib.suppress(Exception):
            self.context.gl.release()
        self._window.destroy()
