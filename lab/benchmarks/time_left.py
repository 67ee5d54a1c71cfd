"""Times that an encoding is forecast to take, and times left that are shown on the way, against the truth.

The scene is prepared and its rates are measured as behind the offer of a window, then it is encoded by the same process. Each call
adds a row to the record. With one folder in NTC_VIEWER_DATA_DIR, a row knows the speed that rows before it have learned.

    python -m lab.benchmarks.time_left courtyard --json lab/benchmarks/results/time_left.json

With --processor-time, one thread of this process encodes, and its processor time is the clock: as on a machine without other load.
"""

import argparse
import json
import multiprocessing
import os
import sys
import tempfile
import time
from bisect import bisect_left
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

from lab.runner import machine, run, write_record
from ntc.codec.block.config import BlockOptions
from ntc.errors import InputError
from ntc.training.messages import GroupSnapshot, TrainingProgress, checked_request
from ntc.training.trainer import Trainer
from ntc.worker.client import warm_up
from viewer.jobs.job import JobReport
from viewer.locations import CACHE_FOLDER_VARIABLE, DATA_FOLDER_VARIABLE, named_scene
from viewer.scene.json_text import counted
from viewer.scene.load import load_scene
from viewer.scene.model import Scene
from viewer.training.live_training import LiveTraining
from viewer.training.pace import Pace
from viewer.training.preparation import EncodeScene, prepare
from viewer.training.settings import TrainingSettings, with_setting

SECONDS_BETWEEN_LOOKS = 0.05
MOMENTS = (0.15, 0.25, 0.5, 0.75, 0.9)
"""Shares of the time of an encoding at which the time left is read."""


def _busy(parent: int) -> None:
    """Keep a core busy while the process `parent` lives."""
    while os.getppid() == parent:
        sum(range(10_000))


class OtherLoad:
    """Processes that each keep a core busy."""

    def __init__(self, count: int) -> None:
        self._count = count
        self._processes: list[multiprocessing.Process] = []

    def begin(self) -> None:
        """Start them. No effect where they run."""
        if not self._processes:
            self._processes = [
                multiprocessing.Process(target=_busy, args=(os.getpid(),), daemon=True) for _ in range(self._count)
            ]
            for process in self._processes:
                process.start()

    def end(self) -> None:
        """End them."""
        for process in self._processes:
            process.kill()


@contextmanager
def other_load(count: int) -> Iterator[OtherLoad]:
    """Yield other load, which ends with the block."""
    load = OtherLoad(count)
    try:
        yield load
    finally:
        load.end()


def encoded(scene: Scene, options: argparse.Namespace, load: OtherLoad) -> dict[str, Any]:
    """Encode `scene` once; returns the row."""
    training = LiveTraining(lambda _event: None)
    training.plan = plan_of(options)
    if options.load_from == 0.0:
        load.begin()
    training.enter(scene)
    training.prepare_ahead(scene)
    began = time.monotonic()
    while training.rates.is_busy and time.monotonic() - began < options.looking:
        training.tick(scene, frozenset())
        time.sleep(SECONDS_BETWEEN_LOOKS)
    forecast = training.rates.forecast(training.plan, scene)
    assert forecast is not None
    training.start(EncodeScene(training.plan), scene, None)
    active, accepted = training.active, time.monotonic()
    assert active is not None
    said: list[tuple[float, float | None, float]] = []
    while training.active is not None:
        training.tick(scene, frozenset())
        now, progress = time.monotonic() - accepted, active.progress
        share = 0.0 if progress is None else progress.share
        said.append((now, active.seconds_left, share))
        if options.load_from <= share:
            load.begin()
        time.sleep(SECONDS_BETWEEN_LOOKS)
    took = time.monotonic() - accepted
    encoding = 0.0 if active.progress is None else active.progress.elapsed_seconds
    outcome = training.log.runs[-1].outcome
    training.close()
    if outcome != "done":
        raise InputError(f"{scene.name}: the encoding ended as {outcome}")
    return row_of(scene, options, forecast.line().split(" -> ")[0], forecast.seconds, took, said) | {
        "encoding_seconds": encoding
    }


class ProcessorTimeHost:
    """Host of a training whose clock is the processor time of the thread that encodes."""

    def __init__(self) -> None:
        self.said: list[tuple[float, float | None, float]] = []
        """(seconds, seconds left, share of the work) of each report."""

    def interruption(self) -> None:
        """Let work continue."""

    def seconds(self) -> float:
        """Return the processor time of this thread in seconds."""
        return time.thread_time()

    def progress(self, progress: TrainingProgress) -> None:
        """Take a report."""
        self.said.append((progress.elapsed_seconds, progress.seconds_left, progress.share))

    def wants_snapshot(self, group: int) -> bool:
        """Return whether a snapshot is wanted: never."""
        del group
        return False

    def snapshot(self, snapshot: GroupSnapshot) -> None:
        """Drop a final snapshot."""


def encoded_by_processor_time(scene: Scene, options: argparse.Namespace) -> dict[str, Any]:
    """Encode `scene` once in this thread, which has encoded before as that of a worker has; returns the row."""
    request = prepare(EncodeScene(plan_of(options)), scene, None, JobReport())
    assert isinstance(request.training, BlockOptions)
    pace, request = Pace(), replace(request, training=replace(request.training, threads=1))
    request = replace(request, expected_seconds=pace.expected_seconds(request))
    warm_up()
    host = ProcessorTimeHost()
    trainer = Trainer(checked_request(request), host)
    began = host.seconds()
    trainer.run()
    took = host.seconds() - began
    pace.note_run(request, took)
    return row_of(scene, options, counted(len(request.textures), "texture"), request.expected_seconds, took, host.said)


def row_of(
    scene: Scene,
    options: argparse.Namespace,
    what: str,
    offered: float | None,
    took: float,
    said: Sequence[tuple[float, float | None, float]],
) -> dict[str, Any]:
    """Return the row of an encoding that took so many seconds; `said` has (second, seconds left, share of the work), ascending."""
    row: dict[str, Any] = {
        "scene": options.title or scene.name,
        "clock": "processor" if options.processor_time else "wall",
        "what": what,
        "load": options.load,
        "load_from": options.load_from,
        "load_average": os.getloadavg()[0],
        "offered_seconds": offered,
        "seconds": took,
    }
    for moment in MOMENTS:
        now, left, share = said[bisect_left([at for at, _, _ in said], moment * took)]
        row |= {f"said_{moment:.0%}": left, f"left_{moment:.0%}": took - now, f"share_{moment:.0%}": share}
    errors = [left / (took - now) for now, left, _ in said if left is not None and 0.15 <= now / took <= 0.9]
    return row | {"least_ratio": min(errors, default=None), "most_ratio": max(errors, default=None)}


def plan_of(options: argparse.Namespace) -> TrainingSettings:
    """Return the settings that the options name."""
    plan = TrainingSettings()
    for text in options.set:
        name, value = text.split("=", 1)
        plan = with_setting(plan, name, value)
    return plan


def main() -> None:
    """Encode, print the row and add it to the record."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scene", type=Path)
    parser.add_argument("--title", help="name of the row; default: that of the scene")
    parser.add_argument(
        "--set", nargs="*", default=[], metavar="NAME=VALUE", help="settings as training.set takes them"
    )
    parser.add_argument("--looking", type=float, default=15.0, help="seconds before accepting, at most")
    parser.add_argument("--load", type=int, default=0, help="other processes that each keep a core busy")
    parser.add_argument("--load-from", type=float, default=0.0, help="share of the encoding at which they begin")
    parser.add_argument(
        "--processor-time", action="store_true", help="encode by one thread, timed by its processor time"
    )
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder, other_load(options.load) as load:
        for variable in (CACHE_FOLDER_VARIABLE, DATA_FOLDER_VARIABLE):
            os.environ.setdefault(variable, folder)
        scene = load_scene(named_scene(options.scene))
        row = encoded_by_processor_time(scene, options) if options.processor_time else encoded(scene, options, load)
    sys.stdout.write(json.dumps(row, indent=2) + "\n")
    if options.json is not None:
        before = json.loads(options.json.read_text())["rows"] if options.json.exists() else []
        rows = [*(each for each in before if (each["scene"], each["clock"]) != (row["scene"], row["clock"])), row]
        write_record(options.json, {**machine(), "rows": rows})


if __name__ == "__main__":
    run(main)
