"""A program of its own: loses the contexts of a window and says as JSON what is left. Run by test_context_loss.py,
and by test_real_window.py for a panel that fails."""

import gc
import json
import sys
import threading
import time
from collections.abc import Callable
from dataclasses import replace
from itertools import count
from pathlib import Path
from typing import Any

# Before glfw, as in the program.
from imgui_bundle import imgui, implot  # isort: skip
import glfw
import moderngl

from viewer.app.imgui_window import LossHistory
from viewer.app.window_app import WindowApp, WindowContent, run_window
from viewer.commands import run_line
from viewer.gl.ui_textures import Thumbnails
from viewer.scene.load import load_scene
from viewer.script.script import parse_script
from viewer.state.open_files import InitialView
from viewer.state.pack_files import open_packs, packs_beside

KINDS = (
    moderngl.Buffer,
    moderngl.Texture,
    moderngl.Framebuffer,
    moderngl.VertexArray,
    moderngl.Program,
    moderngl.Context,
)
FRAMES = 12
PATIENCE = 140.0
"""Seconds that a training may take on a busy machine."""


def objects_alive() -> dict[str, int]:
    """Objects of moderngl that have not been released, by kind."""
    gc.collect()
    return {
        kind.__name__: sum(
            isinstance(entry, kind) and not isinstance(entry.mglo, moderngl.InvalidObject) for entry in gc.get_objects()
        )
        for kind in KINDS
    }


def open_app(scene_path: Path, pictures: Path, clock: Callable[[], float]) -> WindowApp:
    """The window with a clock for its losses."""
    packs = open_packs(packs_beside(scene_path))
    app = WindowApp(WindowContent(load_scene(scene_path), packs, InitialView(), size=(700, 420), pictures=pictures))
    app._lost_before = LossHistory(clock)
    return app


def die(app: WindowApp) -> None:
    """From now on OpenGL calls go nowhere, as those on a lost context do."""
    assert app._window is not None
    app._window.context.reset._blame = "innocent"
    glfw.make_context_current(None)  # type: ignore[arg-type]


def take_pictures(app: WindowApp, name: str) -> str:
    """Write the picture, and the window with its panels, when they rest. The view as text."""
    session = app.session
    for _ in range(100):
        app.show(1)
        if app.is_settled:
            break
    session.window.toasts = ()
    app.run("file.screenshot-picture", "plain", f"{name}.png")
    app.show(1)
    session.window.toasts = ()
    app.run("file.screenshot", f"{name}-window.png")
    app.show(1)
    app.run("view.copy")
    return app.context.read_clipboard()


def same_picture(app: WindowApp) -> dict[str, Any]:
    """Pictures before and after a loss; the handles of what must live on, and of what must not."""
    session = app.session
    app.show(FRAMES)
    for line in ("compare.mode wipe", "compare.divider 0.4", "overlay.kind divergence", "window.panel Pixel on"):
        run_line(app.context, line)
    view = session.view
    session.view = replace(view, camera=replace(view.camera, eye=tuple(side * 0.8 for side in view.camera.eye)))  # type: ignore[arg-type]
    views, placements, windows = [], [], []
    for name in ("before", "after"):
        assert app._window is not None
        if name == "before":
            glfw.set_window_size(app._window.handle, 760, 470)
            app.show(FRAMES)
        views.append(take_pictures(app, name))
        placements.append(app._window.placement)
        windows.append(id(app._window))
        if name == "before":
            die(app)
            app.show(1)
    return {
        "views": views,
        "same_window": windows[0] == windows[1],
        "same_place": placements[0] == placements[1],
        "same_session": session is app.session is app.frontend.session,
        "told": [entry.text for entry in session.window.log],
        "details": [entry.details for entry in session.window.log],
    }


def in_a_panel(app: WindowApp) -> dict[str, Any]:
    """One loss in the midst of a table, which ends the frame with an error of moderngl's."""
    session, errors = app.session, [moderngl.Error("cannot make the texture")]

    def fails(_texture: int) -> imgui.ImTextureRef:
        die(app)
        raise errors.pop()

    app.show(FRAMES)
    app.frontend.reader.thumbnail = fails  # type: ignore[method-assign, assignment]
    app.run("window.panel", "Textures")
    app.show(FRAMES)
    return {"told": [entry.text for entry in session.window.log], "raised": not errors}


def fail_in_a_panel(scene_path: Path, pictures: Path) -> None:
    """A window in which a panel fails in the midst of a table."""

    def fails(*_: object) -> None:
        raise RuntimeError("a mistake of this program")

    Thumbnails.__getitem__ = fails  # type: ignore[method-assign, assignment]
    script = parse_script("wait frames 5\nwindow.panel Textures on\nwait frames 30\nfile.quit", "broken")
    packs = open_packs(packs_beside(scene_path))
    run_window(WindowContent(load_scene(scene_path), packs, InitialView(), script, size=(900, 500), pictures=pictures))


DEEDS = {deed.__name__: deed for deed in (same_picture, in_a_panel)}


def main() -> None:
    """Arguments: what to do, scene, folder of pictures."""
    what, scene_path, pictures = sys.argv[1], Path(sys.argv[2]), Path(sys.argv[3])
    if what == fail_in_a_panel.__name__:
        fail_in_a_panel(scene_path, pictures)
        return
    hours = count(0.0, 3600.0)
    app = open_app(scene_path, pictures, lambda: next(hours))
    found = DEEDS[what](app)
    app.close()
    found["imgui_contexts_left"] = sum(
        get() is not None for get in (imgui.get_current_context, implot.get_current_context)
    )
    # Threads that read from a process that was ended find its pipe closed when the machine lets them.
    ending = time.monotonic() + PATIENCE
    while threading.active_count() > 1 and time.monotonic() < ending:
        time.sleep(0.05)
    found["alive_at_the_end"], found["threads"] = objects_alive(), threading.active_count()
    sys.stdout.write(json.dumps(found))


if __name__ == "__main__":
    main()
