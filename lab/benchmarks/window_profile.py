"""Python's share of a frame of the window: its time without that of passes and of ImGui's drawing.

    python -m lab.benchmarks.window_profile --size 960x540

Draws the built-in scene with all panels, once with a camera that rests and once with one that moves. Each is timed without a
profiler first; then again under cProfile, which names the functions but makes them slower.
"""

import argparse
import cProfile
import json
import pstats
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any
from unittest import mock

from imgui_bundle import imgui

from lab.bench.scene import nudged
from lab.benchmarks.measuring import median, report, size_of
from ntc.io import write_text
from tests.support.driven_app import DrivenApp
from viewer.gl.timer import PassTimer
from viewer.locations import builtin_scene_path
from viewer.scene.load import load_scene
from viewer.state.pack_files import open_packs, packs_beside
from viewer.state.settings import ViewerSettings

SHOWN_FUNCTIONS = 10
OWN_PACKAGES = ("viewer", "ntc")


@dataclass
class _Drawing:
    """Seconds of the current frame spent in OpenGL."""

    passes: float = 0.0
    interface: float = 0.0
    frames: list[tuple[float, float, float]] = field(default_factory=list)
    """(wall, passes, interface) in ms."""

    def take(self, wall: float) -> None:
        """Record a frame that took `wall` seconds."""
        self.frames.append((wall * 1e3, self.passes * 1e3, self.interface * 1e3))
        self.passes = self.interface = 0.0


@contextmanager
def _watched(drawing: _Drawing) -> Iterator[None]:
    """Count the time of passes, which the timer waits for, and of ImGui's drawing."""
    measure, draw = PassTimer.measure, imgui.backends.opengl3_render_draw_data

    @contextmanager
    def timed_pass(timer: PassTimer, name: str) -> Iterator[None]:
        start = time.perf_counter()
        with measure(timer, name):
            yield
        drawing.passes += time.perf_counter() - start

    def timed_draw(data: imgui.ImDrawData) -> None:
        start = time.perf_counter()
        draw(data)
        drawing.interface += time.perf_counter() - start

    with (
        mock.patch.object(PassTimer, "measure", timed_pass),
        mock.patch.object(imgui.backends, "opengl3_render_draw_data", timed_draw),
    ):
        yield


def _frames(app: DrivenApp, moving: bool, count: int, around: Callable[[Callable[[], None]], None]) -> None:
    """Draw `count` frames; `around` is called with each."""
    camera = app.session.view.camera
    for number in range(count):
        if moving:
            app.run("camera.set", nudged(camera, number))
        around(app.frame)
        # The window would show the frame here. What the renderer still has to do belongs to no later frame.
        app.screenshot()


def time_frames(app: DrivenApp, moving: bool, count: int) -> dict[str, float]:
    """Medians in ms of a whole frame, its passes, ImGui's drawing, and the rest: Python with what it calls."""
    drawing = _Drawing()

    def timed(frame: Callable[[], None]) -> None:
        start = time.perf_counter()
        frame()
        drawing.take(time.perf_counter() - start)

    with _watched(drawing):
        _frames(app, moving, count, timed)
    return {
        "frame ms": median([wall for wall, _, _ in drawing.frames]),
        "passes ms": median([passes for _, passes, _ in drawing.frames]),
        "ImGui drawing ms": median([interface for _, _, interface in drawing.frames]),
        "Python ms": median([wall - passes - interface for wall, passes, interface in drawing.frames]),
    }


def profile_frames(app: DrivenApp, moving: bool, count: int) -> list[dict[str, Any]]:
    """All functions of viewer and ntc, those with most time of their own first, in ms a frame under the profiler.

    ImGui's functions are not seen by the profiler: they count for the function that calls them. Those of OpenGL are.
    """
    profiler = cProfile.Profile()

    def profiled(frame: Callable[[], None]) -> None:
        profiler.runcall(frame)

    with _watched(_Drawing()):
        _frames(app, moving, count, profiled)
    root = Path(__file__).resolve().parents[2]
    rows = []
    for (file, line, name), (_, calls, own, whole, _) in pstats.Stats(profiler).stats.items():  # type: ignore[attr-defined]
        path = Path(file)
        if path.is_relative_to(root) and path.relative_to(root).parts[0] in OWN_PACKAGES:
            rows.append(
                {
                    "function": f"{path.relative_to(root)}:{line} {name}",
                    "calls a frame": calls / count,
                    "own ms": own / count * 1e3,
                    "with callees ms": whole / count * 1e3,
                }
            )
    return sorted(rows, key=lambda row: -float(row["own ms"]))


def main() -> int:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--size", type=size_of, default=(960, 540), metavar="WxH")
    parser.add_argument("--frames", type=int, default=30)
    parser.add_argument("--overlay", action="store_true", help="with the divergence overlay and its panel")
    parser.add_argument("--json", type=Path, help="write the figures to this file")
    given = parser.parse_args()
    path = builtin_scene_path()
    with tempfile.TemporaryDirectory() as pictures:
        settings = replace(ViewerSettings(), show_panels=True, column_folded=False)
        app = DrivenApp(load_scene(path), open_packs(packs_beside(path)), given.size, Path(pictures), settings)
        # A coarse picture would be another one.
        app.run("view.coarse-while-moving", False)
        if given.overlay:
            app.run("overlay.kind", "divergence")
        app.settle()
        facts: dict[str, Any] = {
            "size": "{}x{}".format(*given.size),
            "frames": given.frames,
            "overlay": given.overlay,
            "renderer": app.frontend.facts().renderer,
        }
        rows, functions = [], {}
        for name, moving in (("rests", False), ("moves", True)):
            times = time_frames(app, moving, given.frames)
            found = profile_frames(app, moving, given.frames)
            rows.append({"camera": name, **times, "profiled functions ms": sum(row["own ms"] for row in found)})
            functions[name] = found[:SHOWN_FUNCTIONS]
        app.close()
    for name, top in functions.items():
        report(f"Camera {name}: functions, under the profiler", top, {}, None)
    report("A frame of the window", rows, facts, None)
    if given.json is not None:
        write_text(given.json, json.dumps({**facts, "rows": rows, "functions": functions}, indent=1) + "\n")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
