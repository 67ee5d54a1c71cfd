"""Record what the program does, file by file, and compare two records to the bit.

    python -m lab.benchmarks.behaviour record DIR [--repository CHECKOUT] [--part NAME ...]
    python -m lab.benchmarks.behaviour compare A B

For changes that must change nothing: record the tree before and after, on one machine, and compare. Only the command
line is driven (`python -m viewer ...` in a process of its own), so that the layout of modules does not matter. Parts:

    pictures  `render` of the built-in and of a small scene, and scripts of every pack x path x precision x camera
    packs     `encode` of a small folder and of a small scene, every grouping, both recipes, on the CPU
    decodes   `decode` of packs by every backend, precision and some levels
    info      `info` of scenes, packs and folders, as text and as JSON; all texts of --help
    refused   bad input: exit status and message
    scripts   `view --headless` through the commands of docs/reference/commands.md: pictures, whole windows, saved views
    training  the commands training.*: short trainings of a small scene, and the packs they write

Every run leaves a folder with its files and `output.txt`: exit status and what it printed. What differs from run to run
is left out: times (in output.txt, timings_ms of stats.json), folders, training's progress lines, pictures of the panels
Timings and Log and of figures of *measure* (milliseconds), of messages (they fade by the clock) and of a flickering
or moving camera, files with a date in their name, the choices of path `auto` (it times), and what is seen before a
training ends. `bench`, `doctor`, studies and real windows are not run: they tell of the machine, or take too long.
"""

import argparse
import re
import shutil
import sys
import tempfile
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from lab.benchmarks.behaviour.comparison import compare
from lab.benchmarks.behaviour.inputs import make_inputs
from lab.benchmarks.behaviour.parts import PARTS, encodings
from lab.benchmarks.behaviour.program import Program, Run


def encode_small_packs(program: Program, jobs: int) -> None:
    """Put the packs beside the small scene that other parts look at: those of the part packs, encoded anew."""
    chosen = [run for run in encodings() if re.fullmatch(r"scene \w+ best", run.name)]

    def encode(run: Run) -> None:
        folder = program.work / "encoded" / run.name
        program.record(run, folder)
        shutil.copy(folder / "pack.ntc", program.work / "scene" / f"small.{run.name.split()[1]}.ntc")

    with ThreadPoolExecutor(jobs) as pool:
        list(pool.map(encode, chosen))


def record(into: Path, repository: Path, parts: Sequence[str], jobs: int) -> None:
    """Record parts of what the program of a checkout does; parts recorded there before are replaced."""
    with tempfile.TemporaryDirectory(prefix="behaviour-") as name:
        program = Program(repository.resolve(), Path(name).resolve())
        make_inputs(program)
        if set(parts) != {"packs"}:
            encode_small_packs(program, jobs)
        for part in parts:
            started = time.monotonic()
            shutil.rmtree(into / part, ignore_errors=True)
            runs = list(PARTS[part]())
            if len({run.name for run in runs}) != len(runs):
                raise ValueError(f"{part}: two runs of one name")
            with ThreadPoolExecutor(jobs) as pool:
                list(pool.map(lambda run, part=part: program.record(run, into / part / run.name), runs))
            print(f"{part}: {len(runs)} runs in {time.monotonic() - started:.0f} s", flush=True)


def main() -> int:
    """The command line; the exit status is 1 where records differ."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(dest="command", required=True)
    recording = commands.add_parser("record", help="run the program and keep what it does")
    recording.add_argument("folder", type=Path)
    recording.add_argument("--repository", type=Path, default=Path.cwd(), help="the checkout; else the present folder")
    recording.add_argument("--part", nargs="+", choices=tuple(PARTS), default=tuple(PARTS), help="else all")
    recording.add_argument("--jobs", type=int, default=2, help="runs at the same time")
    comparing = commands.add_parser("compare", help="say what differs between two records")
    comparing.add_argument("a", type=Path)
    comparing.add_argument("b", type=Path)
    arguments = parser.parse_args()
    if arguments.command == "record":
        record(arguments.folder, arguments.repository, arguments.part, arguments.jobs)
        return 0
    return 0 if compare(arguments.a, arguments.b) else 1


if __name__ == "__main__":
    sys.exit(main())
