"""Long trial of real windows on a virtual screen: windows under random input, and windows without input.

    python -m lab.window_trials [SCENE ...] --seconds 1800 --seed 1 --json trial.json

Windows under random input open in turn over the same files and settings. Sometimes two are open, and some are killed. After each
window the trial checks its exit status, that every pack beside a scene matches the scene, and that every finished run is a pack on
disk or was discarded.

Windows without input open the built-in scene or one of SCENE, with the packs beside it and by a random path, while images and
read-backs from the GPU are delayed. Each must stop at the picture that `render` draws, and then draw no further frame. Needs Xvfb.
"""

import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, get_args

from lab.runner import options, run, write_record
from lab.window_trials.run_journal import fingerprint, read_journal
from lab.window_trials.virtual_display import remembering_in, virtual_display
from ntc.errors import InputError
from ntc.pack.file import read_pack
from ntc.pack.match import require_match
from tests.end_to_end.conftest import two_squares
from tests.support.rest.plan import Plan
from tests.support.rest.records import ALONE, Played, play
from tests.support.rest.truth import Truth
from viewer.scene.load import load_scene
from viewer.state.pack_files import match_scene, packs_beside
from viewer.state.view_state import PathChoice

LONGEST_WINDOW = 90.0
"""Longest time of a window in seconds."""
KILLED_SHARE, TWO_SHARE = 0.2, 0.2
SECONDS_TO_END = 60.0
REST_SHARE = 0.25
"""Share of rounds with a window without input."""
SLOWEST = 2.0
"""Longest delay in seconds of images and read-backs in such a window."""
IDLE_SECONDS, PATIENCE = 20.0, 180.0
"""Times in seconds for which such a window is watched at rest, and within which it must come to rest."""
SIZE = (1280, 720)


@dataclass
class Findings:
    """Findings of the trial."""

    seconds: float = 0.0
    windows: int = 0
    killed: int = 0
    runs: int = 0
    """Number of runs that ended with a pack."""
    at_rest: int = 0
    """Number of windows without input."""
    frames: int = 0
    """Number of frames of windows that were not killed."""
    slow_frames: dict[str, int] = field(default_factory=dict)
    """Numbers of frames over 250 ms by kind: with work shown in the window, first pictures, slow passes, and others."""
    slowest_ms: dict[str, int] = field(default_factory=dict)
    """Longest time of a frame of each kind."""
    problems: list[str] = field(default_factory=list)


def _kind_of_slow(entry: dict[str, Any]) -> str:
    if entry["doing"]:
        return "said to be under way"
    if entry["first"]:
        return "first pictures of a window"
    return "drawing" if entry["passes_ms"] > 0.6 * entry["ms"] else "others"


class Trial:
    """Trial with its scenes, settings and journals in one folder. Windows at rest open `scenes` and the built-in scene."""

    def __init__(self, folder: Path, display: str, seed: int, scenes: list[Path], truth: Truth) -> None:
        self._folder, self._display, self._random = folder, display, random.Random(seed)
        self._rest_scenes, self._truth = [None, *scenes], truth
        self._files = folder / "files"
        self.findings = Findings()
        self._scenes = [self._make_scene(name, number) for number, name in enumerate(("red", "green", "blue"))]
        for name, data in (
            ("picture.png", b"\x89PNG\r\n\x1a\n1234"),
            ("notes.txt", b"hello"),
            ("broken.glb", b"glTF" * 9),
        ):
            (self._files / name).write_bytes(data)
        self._journals: list[Path] = []

    def _make_scene(self, name: str, seed: int) -> Path:
        (self._files / name).mkdir(parents=True)
        return two_squares(seed).write(self._files / name / f"{name}.glb")

    def run(self, seconds: float) -> None:
        """Open windows for `seconds`."""
        began = time.monotonic()
        while (left := seconds - (time.monotonic() - began)) > 5.0:
            if self._random.random() < REST_SHARE:
                self._watch_rest()
            else:
                self._open_windows(min(left, self._random.uniform(15.0, LONGEST_WINDOW)))
            self.findings.seconds = round(time.monotonic() - began, 1)
            sys.stdout.write(
                f"{self.findings.seconds:7.0f} s, {self.findings.windows} windows, {self.findings.problems[-3:]}\n"
            )

    def _open_windows(self, length: float) -> None:
        windows = [self._start(length) for _ in range(2 if self._random.random() < TWO_SHARE else 1)]
        if self._random.random() < KILLED_SHARE:
            time.sleep(self._random.uniform(5.0, length))
            windows[0].send_signal(signal.SIGKILL)
            self.findings.killed += 1
        for window in windows:
            self._wait_for(window, length)
        self._check_packs()
        self._check_runs()

    def _watch_rest(self) -> None:
        scene, path = self._random.choice(self._rest_scenes), self._random.choice(get_args(PathChoice))
        plan = Plan(
            (*([] if scene is None else [str(scene)]), "--path", path),
            slowest_read=self._random.uniform(0.0, SLOWEST),
            slowest_answer=self._random.uniform(0.0, SLOWEST),
            seed=self._random.randrange(1 << 30),
            idle_seconds=IDLE_SECONDS,
            patience=PATIENCE,
        )
        self.findings.at_rest += 1
        with tempfile.TemporaryDirectory() as folder:
            problem = self._problem_at_rest(play(self._display, Path(folder), plan, SIZE, ALONE))
        if problem:
            self._add_problem(f"at rest: {plan.arguments}, seed {plan.seed}: {problem}")

    def _problem_at_rest(self, played: Played) -> str:
        """Return the problem of a window without input; "" for none."""
        if played.problem or not played.rests:
            return played.problem or "it does not rest"
        if not self._truth.verdict(played.of("start")).is_right:
            return "another picture than that of render"
        frames = played.idle.frames if played.idle is not None else 0
        return f"{frames} frames while it rests" if frames else ""

    def _start(self, seconds: float) -> subprocess.Popen[str]:
        seed, scene = self._random.randrange(1 << 30), self._random.choice(self._scenes)
        self._journals.append(self._folder / f"journal-{self.findings.windows}.jsonl")
        self.findings.windows += 1
        command = [sys.executable, "-m", "lab.window_trials.monkey_window", str(self._files), "--scene", str(scene)]
        return subprocess.Popen(
            [*command, "--seed", str(seed), "--seconds", f"{seconds:.1f}", "--journal", str(self._journals[-1])],
            env=remembering_in(self._folder, self._display),
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
        )

    def _wait_for(self, window: subprocess.Popen[str], seconds: float) -> None:
        try:
            _, errors = window.communicate(timeout=seconds + SECONDS_TO_END)
        except subprocess.TimeoutExpired:
            window.kill()
            _, errors = window.communicate()
            self.findings.problems.append(f"window {self.findings.windows}: hung\n{errors[-2000:]}")
            return
        if window.returncode not in (0, -signal.SIGKILL) or "Traceback" in errors:
            self.findings.problems.append(f"window {self.findings.windows}: exit {window.returncode}\n{errors[-3000:]}")

    def _check_packs(self) -> None:
        for path in self._scenes:
            scene = load_scene(path)
            for pack_path in packs_beside(path):
                try:
                    pack = read_pack(pack_path)
                    require_match(pack, match_scene(pack, scene), scene.name)
                except InputError as error:
                    self._add_problem(f"beside {path.name}: {error}")

    def _check_runs(self) -> None:
        on_disk = set()
        for path in self._folder.rglob("*.ntc"):
            try:
                on_disk.add(fingerprint(read_pack(path)))
            except InputError as error:
                self._add_problem(f"{path.name}: {error}")
        ended: dict[str, str] = {}
        discarded, slow, slowest, frames = set(), Counter[str](), Counter[str](), 0
        for entry in (line for journal in self._journals for line in read_journal(journal)):
            if entry["event"] == "run":
                ended[entry["pack"]] = f"{Path(entry['scene']).name} run {entry['run']}"
                if entry["discarded"]:
                    discarded.add(entry["pack"])
            elif entry["event"] == "slow":
                kind = _kind_of_slow(entry)
                slow[kind] += 1
                slowest[kind] = max(slowest[kind], entry["ms"])
            elif entry["event"] == "end":
                frames += entry["frames"]
        self.findings.runs, self.findings.frames = len(ended), frames
        self.findings.slow_frames, self.findings.slowest_ms = dict(slow), dict(slowest)
        for pack, what in ended.items():
            if pack not in on_disk | discarded:
                self._add_problem(f"lost: {what}")

    def _add_problem(self, line: str) -> None:
        if line not in self.findings.problems:
            self.findings.problems.append(line)


def main() -> int:
    """Run the trial; status 1 where there is a problem."""
    parser = options(__doc__)
    parser.add_argument("scenes", nargs="*", type=Path, metavar="SCENE", help="opened by windows at rest")
    parser.add_argument("--seconds", type=float, default=1800.0)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--keep", type=Path, help="folder for files and journals, which stays")
    given = parser.parse_args()
    folder = given.keep or Path(tempfile.mkdtemp(prefix="ntc-viewer-trial-"))
    folder.mkdir(parents=True, exist_ok=True)
    with virtual_display(*SIZE) as display, Truth() as truth:
        trial = Trial(folder, display, given.seed, [scene.resolve() for scene in given.scenes], truth)
        trial.run(given.seconds)
    write_record(given.json, asdict(trial.findings))
    if given.keep is None:
        shutil.rmtree(folder)
    for problem in trial.findings.problems:
        sys.stdout.write(f"{problem}\n")
    return 1 if trial.findings.problems else 0


if __name__ == "__main__":
    run(main)
