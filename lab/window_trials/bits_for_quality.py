"""Seconds and clicks from a closed program to "this texture needs so many bits for 40 dB", in a real window.

    python -m lab.window_trials.bits_for_quality --json lab/benchmarks/results/bits_for_quality_llvmpipe.json

The scene is made by this script: 5 materials of 2048x2048 texels with base colour, normals, and occlusion, roughness and metalness.
The window is opened on a virtual screen, on empty settings and caches, and clicked with the mouse as a person would.
"""

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from imgui_bundle import imgui  # isort: skip
from numpy.typing import NDArray

from lab.window_trials.virtual_display import remembering_in, virtual_display
from ntc.io import write_text
from tests.support.gltf_builder import GltfBuilder, png
from viewer.app.imgui_window import ImguiWindow
from viewer.app.window_app import WindowApp, WindowContent
from viewer.scene.load import load_scene
from viewer.state.open_files import InitialView

MATERIALS = 5
LONGEST = 150.0
"""Seconds after which the trial is given up."""
PAUSE = 0.4
"""Seconds that a person takes at least between seeing something and clicking on it."""


@dataclass
class Answer:
    """What came of a trial."""

    seconds: float
    """Seconds from the start of the process to the answer."""
    clicks: int
    answer: str
    """Answer as the window shows it."""
    guess: str
    """First answer, from one or two bitrates."""
    guess_seconds: float
    window_seconds: float
    """Seconds to the first frame."""
    size: int
    """Texels of a side of the textures."""


def _grain(size: int, seed: int) -> NDArray[np.float64]:
    """Return [size, size] smooth noise of several scales, 0 to 1."""
    random, total = np.random.default_rng(seed), np.zeros((size, size))
    for side in (8, 64, 256, 1024):
        cells = random.random((min(side, size), min(side, size)))
        total += np.kron(cells, np.ones((size // len(cells), size // len(cells)))) / side**0.4
    return np.asarray((total - total.min()) / np.ptp(total))


def write_scene(path: Path, size: int) -> Path:
    """Write the scene: a square for each material, beside each other."""
    builder, primitives = GltfBuilder(), []
    for number in range(MATERIALS):
        height = _grain(size, 10 * number)
        tint = np.random.default_rng(number).uniform(0.4, 1.0, 3)
        base = (height[..., None] * tint * 255.0).astype(np.uint8)
        slopes = [np.roll(height, 1, axis) - np.roll(height, -1, axis) for axis in (1, 0)]
        normal = np.stack([*(0.5 + 2.0 * slope for slope in slopes), np.full_like(height, 0.9)], axis=-1)
        orm = np.stack([0.5 + height / 2.0, _grain(size, 10 * number + 1), height > 0.6], axis=-1)
        maps = [builder.image(png(base), name=f"stone {number}")]
        maps += [builder.image(png((np.clip(own, 0.0, 1.0) * 255.0).astype(np.uint8))) for own in (normal, orm)]
        textures = [builder.add("textures", source=image) for image in maps]
        pbr = {"baseColorTexture": {"index": textures[0]}, "metallicRoughnessTexture": {"index": textures[2]}}
        more = {"normalTexture": {"index": textures[1]}, "occlusionTexture": {"index": textures[2]}}
        material = builder.add("materials", name=f"stone {number}", pbrMetallicRoughness=pbr, **more)
        corners = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 0, 0], [1, 1, 0], [0, 1, 0]], np.float32)
        places = corners * 0.95 + np.array([number, 0.0, 0.0], np.float32)
        primitives.append(builder.triangle(material, POSITION=places, TEXCOORD_0=corners[:, :2].copy()))
    return builder.drawn(*primitives).write(path)


class AskingWindow(WindowApp):
    """A window that clicks on itself until it shows the answer."""

    def __init__(self, content: WindowContent, started: float) -> None:
        super().__init__(content)
        self._started, self._next, self._clicked = started, 0.0, False
        self.clicks, self.first = 0, 0.0
        self.guess, self.guessed, self.answer, self.answered = "", 0.0, "", 0.0
        self._steps: list[tuple[str, Callable[[], bool]]] = [
            ("Textures", lambda: "texture filter" in self.widgets.labels()),
            ("texture 0", lambda: self.session.inspection.selected_texture == 0),
        ]

    def _frame(self, window: ImguiWindow, size: tuple[int, int]) -> None:
        super()._frame(window, size)
        self.first = self.first or time.time()

    def _next_size(self) -> tuple[int, int]:
        if self.first and not self.frontend.interface.is_settling(self.session):
            self._act()
        return super()._next_size()

    def _act(self) -> None:
        now = time.monotonic()
        if not self._steps and not self.answer and "rate answer" in self.widgets.labels():
            text = self.widgets.explanation("rate answer")
            self.guess, self.guessed = self.guess or f"40 {text}", self.guessed or time.time()
            if "about" not in text:
                self.answer, self.answered = f"40 {text}", time.time()
        if self.answer or time.time() - self._started > LONGEST:
            self.run("window.close")
            self._wake()
            return
        if self._clicked and self._steps and self._steps[0][1]():
            self._steps.pop(0)
            self._clicked, self._next = False, now + PAUSE
        if self._steps and now >= self._next and self._steps[0][0] in self.widgets.labels():
            io = imgui.get_io()
            io.add_mouse_pos_event(*self.widgets.centre(self._steps[0][0]))
            io.add_mouse_button_event(0, True)
            io.add_mouse_button_event(0, False)
            self.clicks, self._clicked, self._next = self.clicks + 1, True, now + 6.0
        self._wake()


def play(scene: Path, started: float, journal: Path, labels: bool) -> None:
    """Open the window on `scene`, and write what came of it into `journal`."""
    opened = load_scene(scene)
    app = AskingWindow(WindowContent(opened, {}, InitialView(), pictures=scene.parent), started)
    try:
        app.show()
    finally:
        app.close()
    seconds = app.answered - started if app.answer else LONGEST
    size = opened.textures[0].size[0]
    guess_seconds = round(app.guessed - started, 1) if app.guess else LONGEST
    window_seconds = round(app.first - started, 1)
    answer = Answer(round(seconds, 1), app.clicks, app.answer, app.guess, guess_seconds, window_seconds, size)
    write_text(journal, json.dumps(asdict(answer)))
    if labels:
        sys.stdout.write("\n".join(app.widgets.labels()) + "\n")


def main() -> None:
    """Make the scene, play, and print the result."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--json", type=Path)
    parser.add_argument("--size", type=int, default=2048)
    parser.add_argument("--labels", action="store_true", help="print the labels of the last frame's widgets")
    parser.add_argument("--play", type=Path, help=argparse.SUPPRESS)
    parser.add_argument("--started", type=float, default=0.0, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.play is not None:
        play(options.play, options.started, options.json, options.labels)
        return
    with tempfile.TemporaryDirectory() as name, virtual_display(1280, 720) as display:
        folder = Path(name)
        scene = write_scene(folder / "stones.glb", options.size)
        found: dict[str, object] = {"cores": os.cpu_count()}
        # The first time ever compiles loops and shaders; later ones find them in the cache.
        for which in ("first", "second"):
            before = resource.getrusage(resource.RUSAGE_CHILDREN)
            command = [sys.executable, "-m", "lab.window_trials.bits_for_quality", "--play", str(scene)]
            command += ["--json", str(folder / "answer.json"), "--started", f"{time.time():.3f}"]
            command += ["--labels"] * options.labels
            load = os.getloadavg()[0]
            subprocess.run(command, env=remembering_in(folder, display), check=True)
            after = resource.getrusage(resource.RUSAGE_CHILDREN)
            cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
            answer = json.loads((folder / "answer.json").read_text())
            found[which] = {**answer, "cpu_seconds": round(cpu, 1), "load_before": round(load, 1)}
    text = json.dumps(found, indent=2) + "\n"
    sys.stdout.write(text)
    if options.json is not None:
        write_text(options.json, text)


if __name__ == "__main__":
    main()
