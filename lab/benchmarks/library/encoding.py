"""`python -m lab.benchmarks.library.encoding LARGE FOLDER --json F`: encoding thousands of textures by jobs.

LARGE holds large images, of which crops are made in FOLDER. Compared are one worker, two, and a Ray cluster of two machines (both are
this one), in one thread each: seconds, and that they give the same shards. Then workers are killed at random, and a machine; the whole
command is killed at random moments and begun again; and the peak memory of the command's own process is measured over numbers of tiny
textures. Figures are written after each part; `--parts` chooses some, and the others stay as they were.
"""

import contextlib
import json
import os
import random
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Literal

import tyro

from lab.benchmarks.library.crops import write_crops, write_tiny
from lab.runner import machine, write_record
from ntc.library.index import read_index
from ntc.library.writer import problems

Part = Literal["workers", "kills", "resume", "memory"]
PEAK = """
import sys
from pathlib import Path
from viewer.cli import main
if __name__ == "__main__":
    status = main(sys.argv[2:])
    peak = [line.split()[1] for line in Path("/proc/self/status").read_text().splitlines() if line.startswith("VmHWM")]
    Path(sys.argv[1]).write_text(peak[0])
    sys.exit(status)
"""
WORKER_MARK = b"spawn_main"
"""In the command line of a spawned worker."""


@dataclass(frozen=True)
class Options:
    """Measure encoding by jobs."""

    large: Annotated[Path, tyro.conf.Positional]
    """Large images."""
    folder: Annotated[Path, tyro.conf.Positional]
    """For crops and libraries."""
    textures: int = 2000
    side: int = 128
    """Texels of a crop's side."""
    tiny: tuple[int, ...] = (200, 2_000, 20_000)
    """Numbers of tiny textures, for memory."""
    kills: int = 10
    """Workers that are killed in one run."""
    stops: int = 20
    """Moments at which the whole command is killed."""
    parts: tuple[Part, ...] = ("workers", "kills", "resume", "memory")
    json: Path | None = None
    """Where to write the figures."""


@dataclass
class Bench:
    """The figures so far, and where things lie."""

    options: Options
    figures: dict[str, Any] = field(default_factory=dict)

    def note(self, name: str, value: Any) -> None:
        """Keep and print a figure."""
        self.figures[name] = value
        print(f"{name}: {json.dumps(value)}", flush=True)
        write_record(self.options.json, self.figures)


@contextlib.contextmanager
def command(source: Path, library: Path, *arguments: str) -> Iterator[subprocess.Popen[bytes]]:
    """`encode` of `source` into `library` in a process of its own; its peak memory is written beside the library."""
    # In a folder of its own: beside libraries it would find them as packages.
    program = library.parent / "program" / "measured_command.py"
    program.parent.mkdir(exist_ok=True)
    program.write_text(PEAK)
    own = [
        sys.executable,
        str(program),
        str(library.with_suffix(".peak")),
        "encode",
        str(source),
        "--out",
        str(library),
    ]
    with library.with_suffix(".log").open("wb") as log:
        process = subprocess.Popen([*own, "--grouping", "universal", *arguments], stdout=log, stderr=log)
        try:
            yield process
        finally:
            process.wait()


def measured(source: Path, library: Path, *arguments: str) -> dict[str, Any]:
    """A whole run into a new library. Raises RuntimeError where it fails."""
    shutil.rmtree(library, ignore_errors=True)
    began, before = time.monotonic(), os.times()
    with command(source, library, *arguments) as process:
        pass
    after = os.times()
    if process.returncode != 0:
        raise RuntimeError(library.with_suffix(".log").read_text()[-2000:])
    seconds = time.monotonic() - began
    report = json.loads((library.with_name(f"{library.name}.report") / "report.json").read_text())
    return {
        "seconds": round(seconds, 1),
        "cpu_seconds": round(sum(after[2:4]) - sum(before[2:4]), 1),
        "seconds_of_jobs": round(report["seconds"], 1),
        "peak_mb": round(int(library.with_suffix(".peak").read_text()) / 1024, 1),
        "encoded": report["encoded_now"],
        "failed": len(report["failed"]),
        "jobs_tried_again": report["jobs_tried_again"],
    }


def state_of(library: Path) -> dict[str, Any]:
    """Whether the library is whole, and how often it names a texture."""
    index = read_index(library)
    named = [texture.pixel_hash for shard in index.shards.values() for texture in shard.textures]
    return {
        "textures": len(set(named)),
        "named_twice": len(named) - len(set(named)),
        "problems": list(problems(library)),
    }


def same(one: Path, other: Path) -> bool:
    """Whether two libraries have the same shards."""
    return set(read_index(one).shards) == set(read_index(other).shards)


@contextlib.contextmanager
def ray_cluster() -> Iterator[tuple[str, Any, Any]]:
    """(address, cluster, second machine) of two machines with one core each."""
    from ray.cluster_utils import Cluster

    cluster: Any = Cluster(initialize_head=True, head_node_args={"num_cpus": 1, "include_dashboard": False})
    try:
        yield cluster.address, cluster, cluster.add_node(num_cpus=1)
    finally:
        cluster.shutdown()


def workers_of(process: int) -> list[int]:
    """Processes that a command has begun to encode in."""
    found = []
    with contextlib.suppress(OSError):
        for child in Path(f"/proc/{process}/task/{process}/children").read_text().split():
            if WORKER_MARK in Path(f"/proc/{child}/cmdline").read_bytes():
                found.append(int(child))
    return found


def measure_workers(bench: Bench, crops: Path, place: Path) -> None:
    """One worker, two, and a cluster."""
    one, two, cluster = place / "one", place / "two", place / "cluster"
    bench.note("one_worker", measured(crops, one, "--workers", "1"))
    bench.note("two_workers", measured(crops, two, "--workers", "2"))
    with ray_cluster() as (address, _, _):
        bench.note("ray_two_machines", measured(crops, cluster, "--ray", address))
    bench.note("same_shards", same(one, two) and same(one, cluster))
    for name in ("two_workers", "ray_two_machines"):
        for what in ("seconds", "seconds_of_jobs"):
            share = bench.figures["one_worker"][what] / bench.figures[name][what]
            bench.note(f"speed_up_{name}_{what}", round(share, 2))


def measure_kills(bench: Bench, crops: Path, place: Path) -> None:
    """Workers that are killed at random, and a machine of a cluster."""
    one, killed, lost = place / "one", place / "killed", place / "lost"
    expected = bench.figures["two_workers"]["seconds"]
    chance = random.Random(0)
    shutil.rmtree(killed, ignore_errors=True)
    done = 0
    with command(crops, killed, "--workers", "2") as process:
        while process.poll() is None:
            time.sleep(chance.uniform(0.2, 1.6) * 0.6 * expected / max(bench.options.kills, 1))
            workers = workers_of(process.pid)
            if done < bench.options.kills and workers:
                with contextlib.suppress(ProcessLookupError):
                    os.kill(chance.choice(workers), signal.SIGKILL)
                    done += 1
    again = killed.with_suffix(".log").read_text().count("tried again: ")
    told = {
        "workers_killed": done,
        "jobs_tried_again": again,
        "status": process.returncode,
        "same_shards": same(one, killed),
    }
    bench.note("killed_workers", {**told, **state_of(killed)})
    with ray_cluster() as (address, cluster, node):
        killer = threading.Timer(0.5 * expected, lambda: cluster.remove_node(node, allow_graceful=False))
        killer.start()
        found = measured(crops, lost, "--ray", address)
        killer.join()
    bench.note("lost_machine", {**found, "same_shards": same(one, lost), **state_of(lost)})


def measure_resume(bench: Bench, crops: Path, place: Path) -> None:
    """The whole command, killed at random moments and begun again."""
    stopped, chance = place / "stopped", random.Random(1)
    shutil.rmtree(stopped, ignore_errors=True)
    counts, rewritten = [], 0
    written: dict[Path, int] = {}
    for stop in range(bench.options.stops + 1):
        with command(crops, stopped, "--workers", "2") as process:
            if stop < bench.options.stops:
                with contextlib.suppress(subprocess.TimeoutExpired):
                    process.wait(chance.uniform(0.5, 12.0))
                process.kill()
        if (stopped / "shards").is_dir():
            now = {path: path.stat().st_mtime_ns for path in (stopped / "shards").glob("*.ntc") if path.name[0] != "."}
            rewritten += sum(now.get(path) != time_before for path, time_before in written.items())
            written = now
            counts.append(len(read_index(stopped).places))
    told = {"stops": bench.options.stops, "textures_after_each": counts, "shards_lost_or_rewritten": rewritten}
    same_shards = same(place / "one", stopped)
    bench.note("resumed", {**told, "status": process.returncode, "same_shards": same_shards, **state_of(stopped)})


def measure_memory(bench: Bench, place: Path) -> None:
    """Peak memory of the command's own process, and seconds, over numbers of tiny textures."""
    found = {}
    for count in bench.options.tiny:
        folder = place / f"tiny-{count}"
        write_tiny(folder, count)
        found[count] = measured(folder, place / f"library-{count}", "--workers", "2")
        bench.note("tiny_textures", found)


def main() -> None:
    """Measure the parts that are asked for."""
    options = tyro.cli(Options)
    bench = Bench(options)
    if options.json is not None and options.json.is_file():
        bench.figures = json.loads(options.json.read_text())
    place = options.folder
    place.mkdir(parents=True, exist_ok=True)
    crops = place / f"crops-{options.textures}-{options.side}"
    bench.note("machine", {**machine(), "textures": options.textures, "side": options.side})
    if set(options.parts) - {"memory"}:
        write_crops(options.large, crops, options.textures, options.side)
    if "workers" in options.parts:
        measure_workers(bench, crops, place)
    if "kills" in options.parts:
        measure_kills(bench, crops, place)
    if "resume" in options.parts:
        measure_resume(bench, crops, place)
    if "memory" in options.parts:
        measure_memory(bench, place)


if __name__ == "__main__":
    main()
