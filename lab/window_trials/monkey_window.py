"""Window under random input from a seed: keys, clicks, drags, drops, sizes, commands and attempts to close it.

    python -m lab.window_trials.monkey_window FOLDER --scene FILE --seed 1 --seconds 60 --journal FILE

FOLDER holds the scenes and files that are dropped. Started by `lab.window_trials`.
"""

import argparse
import random
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from imgui_bundle import imgui  # isort: skip
import glfw

from lab.window_trials.random_calls import random_call
from lab.window_trials.run_journal import Journal, fingerprint
from ntc.errors import InputError
from viewer.app.imgui_window import ImguiWindow
from viewer.app.window_app import WindowApp, WindowContent
from viewer.commands import bindings
from viewer.commands.keys import Chord, parse_chord
from viewer.scene.load import load_scene
from viewer.script.directions import MODIFIER_KEYS
from viewer.state.open_files import InitialView
from viewer.state.pack_files import open_packs, packs_beside
from viewer.training import run_store
from viewer.training.run_log import Run
from viewer.ui.picture_input import imgui_key

SLOW_MS = 250.0
"""Time in ms beyond which a frame is recorded, with the work that the window shows."""
FIRST_PICTURES = 3
"""Number of first pictures, which make buffers, compile programs and upload the scene."""
SECONDS_BETWEEN_ACTIONS = 0.05
SIZES = ((1280, 720), (1024, 640), (900, 600), (640, 480), (360, 260))
ENCODE_SHARE = 0.7
"""Share of encodings among the commands about trainings."""
CAMERA_KEYS = tuple(parse_chord(key) for key in "WASDQE123")


class MonkeyWindow(WindowApp):
    """Window that makes random input between its frames."""

    def __init__(self, content: WindowContent, files: list[Path], seed: int, seconds: float, journal: Journal) -> None:
        super().__init__(content)
        self._random, self._files, self._journal = random.Random(seed), files, journal
        self._ends, self._next_action = time.monotonic() + seconds, 0.0
        self._held: list[tuple[float, Callable[[], None]]] = []
        """Keys and buttons that are held: (time to release, function that releases)."""
        self._known: dict[tuple[str, int], bool] = {}
        """Recorded runs by scene and number: whether each had been discarded."""
        self._actions = {
            self._press_a_key: 30,
            self._click_a_widget: 30,
            self._click_somewhere: 8,
            self._drag: 10,
            self._turn_the_wheel: 5,
            self._type: 4,
            self._run_a_command: 30,
            self._train: 10,
            self._drop: 3,
            self._resize: 2,
            self._close_the_window: 1,
        }

    def _next_size(self) -> tuple[int, int]:
        now = time.monotonic()
        size = super()._next_size()
        for at, let_go in [entry for entry in self._held if entry[0] <= now]:
            let_go()
            self._held.remove((at, let_go))
        if now >= self._ends:
            self.run("file.quit")
        elif now >= self._next_action:
            self._next_action = now + self._random.expovariate(1.0 / SECONDS_BETWEEN_ACTIONS)
            (action,) = self._random.choices(list(self._actions), list(self._actions.values()))
            action()
            self._wake()
        return size

    def _frame(self, window: ImguiWindow, size: tuple[int, int]) -> None:
        began = time.perf_counter()
        super()._frame(window, size)
        spent = 1e3 * (time.perf_counter() - began)
        if spent > SLOW_MS:
            passes = sum(self.frontend.facts().timings_ms.values())
            first = self.frontend.picture.frames_drawn <= FIRST_PICTURES
            self._journal.write("slow", ms=round(spent), doing=self._doing(), first=first, passes_ms=round(passes))
        self._note_runs()

    def _doing(self) -> str:
        """Return the work that the window shows; "" for none."""
        return ", ".join(work.title for work in self.frontend.facts().work)

    def _note_runs(self) -> None:
        for run in self.training.log.runs:
            key = (self.session.scene_key, run.number)
            if run.pack is not None and self._known.get(key) != run.discarded:
                self._known[key] = run.discarded
                self._write_run(run, key[0], run.discarded)

    def _write_run(self, run: Run, scene: str, discarded: bool) -> None:
        assert run.pack is not None
        self._journal.write("run", scene=scene, run=run.number, pack=fingerprint(run.pack), discarded=discarded)

    def _later(self, seconds: float, let_go: Callable[[], None]) -> None:
        self._held.append((time.monotonic() + seconds, let_go))

    def _key(self, chord: Chord, down: bool) -> None:
        io = imgui.get_io()
        for is_held, key in zip((chord.ctrl, chord.shift, chord.alt), MODIFIER_KEYS.values(), strict=True):
            if is_held:
                io.add_key_event(key, down)
        io.add_key_event(imgui_key(chord.key), down)

    def _press_a_key(self) -> None:
        chords = [chord for of_command in bindings({}).chords.values() for chord in of_command]
        extra = [parse_chord(name) for name in ("Escape", "Enter", "Space", "Tab")]
        chord = self._random.choice([*chords, *extra, *CAMERA_KEYS])
        self._key(chord, True)
        self._later(self._random.choice((0.0, 0.05, 0.5)), lambda: self._key(chord, False))

    def _place(self) -> tuple[float, float]:
        size = imgui.get_io().display_size
        return self._random.uniform(0.0, size.x), self._random.uniform(0.0, size.y)

    def _click_at(self, place: tuple[float, float]) -> None:
        io, button = imgui.get_io(), self._random.choice((0, 0, 0, 0, 1, 2))
        io.add_mouse_pos_event(*place)
        for _ in range(self._random.choice((1, 1, 1, 2))):
            io.add_mouse_button_event(button, True)
            io.add_mouse_button_event(button, False)

    def _click_a_widget(self) -> None:
        labels = self.widgets.labels()
        if labels:
            self._click_at(self.widgets.centre(self._random.choice(labels)))

    def _click_somewhere(self) -> None:
        self._click_at(self._place())

    def _drag(self) -> None:
        io, button = imgui.get_io(), self._random.choice((0, 0, 1, 2))
        io.add_mouse_pos_event(*self._place())
        io.add_mouse_button_event(button, True)
        io.add_mouse_pos_event(*self._place())
        end = self._place()
        self._later(0.1, lambda: io.add_mouse_pos_event(*end))
        self._later(0.15, lambda: io.add_mouse_button_event(button, False))

    def _turn_the_wheel(self) -> None:
        imgui.get_io().add_mouse_wheel_event(0.0, self._random.uniform(-3.0, 3.0))

    def _type(self) -> None:
        imgui.get_io().add_input_characters_utf8(self._random.choice(("a", "12", "zz.ntc", "0.5", "/tmp", "ä€", "-1")))

    def _train(self) -> None:
        # Encoding is frequent, because most commands about trainings need a run.
        self._run_a_command("training.encode" if self._random.random() < ENCODE_SHARE else "training.")

    def _run_a_command(self, subject: str = "") -> None:
        command, texts = random_call(self.context, self._files, self._random, subject)
        self._journal.write("command", line=" ".join([command.id, *texts]))
        # Only scripts can contain text that does not parse.
        with suppress(InputError):
            self.run(command.id, *command.parse(texts))

    def _drop(self) -> None:
        path = self._random.choice(self._files)
        self._journal.write("drop", file=str(path))
        self._dropped(None, [str(path)])

    def _resize(self) -> None:
        glfw.set_window_size(self._handle, *self._random.choice(SIZES))

    def _close_the_window(self) -> None:
        glfw.set_window_should_close(self._handle, True)


def main() -> None:
    """Open the window on a scene and wait until it closes itself."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--scene", type=Path, required=True)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--journal", type=Path, required=True)
    options = parser.parse_args()
    scene = load_scene(options.scene)
    files = sorted(path for path in options.folder.rglob("*") if path.is_file())
    content = WindowContent(
        scene, open_packs(packs_beside(options.scene)), InitialView(), pictures=options.folder / "pictures"
    )
    journal = Journal(options.journal)
    # The trial checks every finished run, therefore none may be deleted.
    run_store.MOST_FILES = 1_000_000
    app = MonkeyWindow(content, files, options.seed, options.seconds, journal)
    try:
        app.show()
    except BaseException as error:
        app.leave(error)
        raise
    finally:
        app.close()
    journal.write("end", frames=app.frontend.picture.frames_drawn)


if __name__ == "__main__":
    main()
