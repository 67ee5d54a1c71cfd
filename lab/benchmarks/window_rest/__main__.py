"""Starts of real windows that nobody touches: does each come to rest on the picture that `render` draws, and does it rest?

    python -m lab.benchmarks.window_rest --starts 50 --seed 1 --data ../shared/data --json rest.json
    python -m lab.benchmarks.window_rest --starts 5 --idle-seconds 20

Each start opens a random scene with its pack of 4 bits by a random path, while images and what is read back from the GPU come late by
up to a random time. Packs are encoded once for each scene. Exit status 1 where a window rests on another picture, does not come to
rest, or draws while it rests. Needs Xvfb.
"""

import os
import random
import shutil
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, get_args

from lab.runner import options, report, run, size_of
from lab.window_trials.virtual_display import virtual_display
from ntc.codec.quality import finite_or_none
from ntc.errors import InputError
from tests.support.rest.plan import Plan
from tests.support.rest.records import ALONE, Played, play
from tests.support.rest.truth import Truth
from viewer.state.view_state import PathChoice

BUILTIN = "builtin"
SCENES = {
    "dutch_ship": "scenes/dutch_ship/dutch_ship_medium_1k.gltf",
    "portal": "scenes/portal/portal.glb",
    "polyhaven_props": "scenes/polyhaven_props/wooden_bookshelf_worn_1k.gltf",
    "ur3e_ktx2": "scenes/ur3e_ktx2/shoulder.gltf",
    "lantern": "scenes/lantern/glTF/Lantern.gltf",
    "jungle": "scenes/jungle/scene.gltf",
}
"""By name, in the folder of data; besides the built-in one."""
SLOWEST = 2.0
"""Seconds by which what is read comes later at most."""
ENCODING = ("--codec", "block", "--bits", "4", "--texture-size", "512", "--grouping", "clustered")


@dataclass(frozen=True)
class Start:
    """One window."""

    scene: str
    path: PathChoice
    slowest_read: float
    slowest_answer: float
    seed: int


def chosen_starts(count: int, seed: int, scenes: Mapping[str, Path | None]) -> Iterator[Start]:
    """As many starts, the same for the same seed and scenes."""
    numbers = random.Random(seed)
    for number in range(count):
        scene, path = numbers.choice(sorted(scenes)), numbers.choice(get_args(PathChoice))
        yield Start(scene, path, numbers.uniform(0.0, SLOWEST), numbers.uniform(0.0, SLOWEST), seed * 1000 + number)


def with_packs(data: Path, work: Path) -> dict[str, Path | None]:
    """The scenes of `data` that are there, by name, copied into `work` with a pack beside each; None for the built-in one.

    Raises InputError where one cannot be encoded.
    """
    found: dict[str, Path | None] = {BUILTIN: None}
    for name, file in SCENES.items():
        source = data / file
        if source.is_file():
            found[name] = _with_pack(source, work / name)
        else:
            print(f"{name}: no {source}")
    return found


def _with_pack(source: Path, folder: Path) -> Path:
    scene, pack = folder / source.name, folder / f"{source.stem}.clustered.ntc"
    if pack.is_file():
        return scene
    for file in source.parent.rglob("*"):
        if file.is_file():
            copy = folder / file.relative_to(source.parent)
            copy.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(file, copy)
    print(f"encoding {scene}")
    command = [sys.executable, "-m", "viewer", "encode", str(scene), "--out", str(pack), *ENCODING]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise InputError(f"{scene}: cannot be encoded ({done.stderr.strip()})")
    return scene


def measured(start: Start, played: Played, truth: Truth) -> dict[str, Any]:
    """A row of the table: what became of a start.

    `read s` and `answer s`: by how much images and answers of the GPU came later at most. `equal %`: pixels within 1/255 of `render`;
    `screen %`: pixels on the screen that are those of the window's picture. `A dB` and `render A dB`: slot A against the originals.
    """
    row: dict[str, Any] = {
        "scene": start.scene,
        "path": start.path,
        "read s": start.slowest_read,
        "answer s": start.slowest_answer,
        "seed": start.seed,
        "right": False,
        "equal %": None,
        "screen %": None,
        "PSNR dB": None,
        "A dB": None,
        "render A dB": None,
        "rest s": None,
        "frames": None,
        "idle frames": None,
        "idle CPU s": None,
        "problem": played.problem,
    }
    if played.problem or not played.rests:
        return row
    rest = played.of("start")
    verdict = truth.verdict(rest)
    # JSON has no infinity: equal pictures have no PSNR.
    row |= {
        "right": verdict.is_right,
        "equal %": 100.0 * verdict.share,
        "screen %": 100.0 * verdict.on_screen,
        "PSNR dB": finite_or_none(verdict.psnr_db),
        "A dB": verdict.shown_db and finite_or_none(verdict.shown_db),
        "render A dB": verdict.rendered_db and finite_or_none(verdict.rendered_db),
        "rest s": rest.seconds,
        "frames": rest.frames,
    }
    if played.idle is not None:
        row |= {"idle frames": played.idle.frames, "idle CPU s": played.idle.processor_seconds}
    return row


def main() -> int:
    """Run from the command line."""
    parser = options(__doc__)
    parser.add_argument("--starts", type=int, default=50, help="windows to open")
    parser.add_argument("--seed", type=int, default=1, help="of scenes, paths and delays")
    parser.add_argument("--data", type=Path, default=Path("../shared/data"), help="folder with scenes/")
    parser.add_argument("--work", type=Path, default=Path(tempfile.gettempdir(), "ntc-window-rest"), help="keeps packs")
    parser.add_argument("--size", type=size_of, default=(1280, 720), metavar="WxH")
    parser.add_argument("--idle-seconds", type=float, default=0.0, help="watch each window at rest for so long")
    given = parser.parse_args()
    scenes = with_packs(given.data.resolve(), given.work)
    rows = []
    with virtual_display(*given.size) as display, Truth() as truth:
        for start in chosen_starts(given.starts, given.seed, scenes):
            scene = scenes[start.scene]
            plan = Plan(
                (*([str(scene)] if scene is not None else []), "--path", start.path),
                slowest_read=start.slowest_read,
                slowest_answer=start.slowest_answer,
                seed=start.seed,
                idle_seconds=given.idle_seconds,
                patience=180.0,
            )
            with tempfile.TemporaryDirectory() as folder:
                rows.append(measured(start, play(display, Path(folder), plan, given.size, ALONE), truth))
            row = rows[-1]
            print(start, "right" if row["right"] else f"WRONG {row['problem']}", row["equal %"], flush=True)
    wrong = [row for row in rows if not row["right"] or row["idle frames"]]
    facts = {
        "size": "{}x{}".format(*given.size),
        "seed": given.seed,
        "starts": len(rows),
        "wrong": len(wrong),
        "idle seconds": given.idle_seconds,
        "cores": os.cpu_count(),
        "median rest s": statistics.median([row["rest s"] or 0.0 for row in rows] or [0.0]),
    }
    report("Windows at rest", rows, facts, given.json)
    return 1 if wrong else 0


if __name__ == "__main__":
    run(main)
