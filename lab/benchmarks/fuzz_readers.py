"""Fuzz the readers with mutated files for a number of files or seconds, and record the findings.

Every reader runs in a separate process under libFuzzer, guided by the coverage of the readers' Python code
(needs `pip install atheris`). A finding is an exception other than InputError, a crash, more than 5 seconds or more
than 1 GiB for one file. Its input is written to the folder of findings, and the run continues without it.

    python -m lab.benchmarks.fuzz_readers --runs 200000 --seconds 600 --json lab/benchmarks/results/fuzz_readers.json
"""

import hashlib
import importlib.util
import json
import os
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterable
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from lab.benchmarks.fuzzing import seeds
from lab.runner import options, run, write_record

LIMIT_SECONDS, LIMIT_MEGABYTES = 5, 1024
LARGEST_INPUT = 1 << 14
MEMORY = Path("/dev/shm")
READERS = (
    *("scene", "compressed scene", "moving scene", "mesh", "archive", "pack", "image", "ktx2", "cameras", "settings"),
    *("script", "view"),
)
MOST_FINDINGS = 20
"""Number of findings after which a reader is not fuzzed further."""


@dataclass
class Tally:
    """Results for one reader."""

    reader: str
    seeds: int = 0
    executions: int = 0
    seconds: float = 0.0
    coverage: int = 0
    """Number of reached edges of the instrumented Python code."""
    corpus: int = 0
    peak_rss_mb: int = 0
    slowest_seconds: int = 0
    findings: list[str] = field(default_factory=list)


def reader_seeds(reader: str, folder: Path | None) -> list[bytes]:
    """Return the seeds for `reader`."""
    made: dict[str, Iterable[bytes]] = {
        "scene": [*seeds.scenes(), *seeds.real(folder, (".gltf", ".glb"))],
        "compressed scene": [*seeds.compressed_scenes()],
        "moving scene": [*seeds.moving_scenes()],
        "mesh": [*seeds.meshes()],
        "archive": [*seeds.archives()],
        "pack": [*seeds.packs(), *seeds.real(folder, (".ntc",))],
        "image": [*seeds.images(), *seeds.real(folder, seeds.IMAGE_SUFFIXES)],
        "ktx2": [*seeds.ktx2_images(), *seeds.real(folder, (".ktx2",))],
        "cameras": [*seeds.cameras()],
        "settings": [*seeds.settings()],
        "script": [*seeds.scripts()],
        "view": [*seeds.views()],
    }
    return list(made[reader])


def _numbers(pattern: str, text: str) -> list[int]:
    return [int(number) for number in re.findall(pattern, text)]


def _cause(log: str) -> str:
    """Return the most informative line of libFuzzer's log."""
    lines = [line.strip() for line in log.splitlines()]
    for number, line in enumerate(lines):
        if "Uncaught Python exception" in line:
            return next((text for text in lines[number + 1 :] if text), line)[:300]
    return next((line for line in lines if "ERROR: libFuzzer" in line or "AddressSanitizer" in line), "ended")[:300]


def _run(tally: Tally, runs: int, seconds: float, corpus: Path, findings: Path) -> None:
    """Run one process of the fuzzer. It ends at a finding, or when all is done."""
    prefix = findings / f"{tally.reader.replace(' ', '-')}-"
    known = set(findings.iterdir())
    arguments = [
        *(sys.executable, "-m", "lab.benchmarks.fuzzing.targets", tally.reader),
        *(f"-runs={runs}", f"-max_total_time={max(1, int(seconds))}", f"-max_len={LARGEST_INPUT}"),
        *(f"-timeout={LIMIT_SECONDS}", f"-rss_limit_mb={LIMIT_MEGABYTES}", f"-artifact_prefix={prefix}"),
        *("-print_final_stats=1", str(corpus)),
    ]
    started = time.monotonic()
    # libFuzzer ends the process without further ado: what it leaves is removed here. Files in memory keep off the disk.
    with tempfile.TemporaryDirectory(dir=MEMORY if MEMORY.is_dir() else None) as scratch:
        done = subprocess.run(
            arguments,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            errors="replace",
            env={**os.environ, "TMPDIR": scratch},
            check=False,
        )
    log = done.stdout
    tally.seconds += time.monotonic() - started
    counted = _numbers(r"stat::number_of_executed_units: (\d+)", log) or _numbers(r"^#(\d+)\s", log) or [0]
    tally.executions += counted[-1]
    tally.coverage = max([tally.coverage, *_numbers(r"cov: (\d+)", log)])
    tally.corpus = max([tally.corpus, *_numbers(r"corp: (\d+)/", log)])
    tally.peak_rss_mb = max([tally.peak_rss_mb, *_numbers(r"(?:peak_rss_mb:|rss:) *(\d+)", log)])
    tally.slowest_seconds = max([tally.slowest_seconds, *_numbers(r"slowest_unit_time_sec: +(\d+)", log)])
    if done.returncode != 0:
        new = sorted(path.name for path in set(findings.iterdir()) - known)
        tally.findings.append(f"{_cause(log)} [{', '.join(new) or f'exit {done.returncode}'}]")
        (findings / f"{tally.reader}-{len(tally.findings)}.log").write_text(log[-20000:])


def fuzz(reader: str, runs: int, seconds: float, folder: Path | None, findings: Path) -> Tally:
    """Fuzz `reader` until `runs` files were read, `seconds` have passed, or there are MOST_FINDINGS."""
    tally = Tally(reader)
    with tempfile.TemporaryDirectory() as name:
        corpus = Path(name)
        for data in reader_seeds(reader, folder):
            (corpus / hashlib.sha256(data).hexdigest()[:16]).write_bytes(data)
            tally.seeds += 1
        while tally.executions < runs and tally.seconds < seconds and len(tally.findings) < MOST_FINDINGS:
            before = tally.executions
            _run(tally, runs - tally.executions, seconds - tally.seconds, corpus, findings)
            if tally.executions == before:
                break
    tally.seconds = round(tally.seconds, 1)
    return tally


def main() -> None:
    """Fuzz all readers and write the record."""
    parser = options(__doc__)
    parser.add_argument("--reader", action="append", choices=READERS, help="may be given again; default all")
    parser.add_argument("--runs", type=int, default=200_000, help="files for each reader")
    parser.add_argument("--seconds", type=float, default=600.0, help="time for each reader")
    parser.add_argument("--seeds", type=Path, help="folder of real files; the small ones are used too")
    parser.add_argument(
        "--findings", type=Path, default=Path("fuzz-findings"), help="folder for the inputs of findings"
    )
    parser.add_argument("--more", action="store_true", help="add to the figures that --json names already")
    given = parser.parse_args()
    if importlib.util.find_spec("atheris") is None:
        sys.exit("error: atheris is not installed; pip install '.[fuzz]'")
    given.findings.mkdir(parents=True, exist_ok=True)
    earlier = json.loads(given.json.read_text())["readers"] if given.more else []
    tallies: list[dict[str, Any]] = list(earlier)
    for reader in given.reader or READERS:
        tally = fuzz(reader, given.runs, given.seconds, given.seeds, given.findings)
        tallies.append(asdict(tally))
        print(
            f"{reader}: {tally.executions:,} files in {tally.seconds:.0f} s, {len(tally.findings)} findings,"
            f" peak {tally.peak_rss_mb} MB, slowest {tally.slowest_seconds} s"
        )
        for finding in tally.findings:
            print(f"  {finding}")
        total = sum(row["executions"] for row in tallies)
        limits = {"seconds": LIMIT_SECONDS, "megabytes": LIMIT_MEGABYTES, "largest_input_bytes": LARGEST_INPUT}
        write_record(given.json, {"executions": total, "limits": limits, "readers": tallies})


if __name__ == "__main__":
    run(main)
