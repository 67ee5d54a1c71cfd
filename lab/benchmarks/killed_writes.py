"""Kill writers of packs and files at random moments, and count what is damaged afterwards.

A child process writes one file over and over, each time with other content; the parent kills it (SIGKILL) and looks:
the file must be one whole version. Every pack is read back. At the end one more write must leave no leftovers.

    python -m lab.benchmarks.killed_writes --kills 200 --json lab/benchmarks/results/killed_writes.json
"""

import argparse
import random
import subprocess
import sys
import tempfile
import time
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from lab.bench.random_pack import random_pack
from lab.runner import options, run, write_record
from ntc.codec.grid.model import GridConfig, grid_parts
from ntc.codec.model import Pack
from ntc.errors import InputError
from ntc.io import is_partial
from ntc.pack.file import read_pack, write_pack

LONGEST_WAIT = 0.05
"""Seconds from the first whole write to the kill, at most; one write takes a few milliseconds."""
SIDE = 512
"""Texels a side of the pack's texture: large enough for kills to hit the middle of a write."""


@dataclass
class Result:
    """What the kills did."""

    kills: int = 0
    damaged: int = 0
    """Files that were not one whole version afterwards."""
    hit_a_write: int = 0
    """Kills that left a temporary file: they fell between its making and its renaming."""
    most_leftovers: int = 0
    """Temporary files that lay there at one time."""
    leftovers_at_the_end: int = 0
    """After one more write that was not killed."""


def _versions() -> list[Pack]:
    config = GridConfig(hidden_width=4)
    return [random_pack(((SIDE, SIDE),), (0,), config, seed=seed) for seed in (1, 2)]


def _write_for_ever(path: Path) -> None:
    packs = _versions()
    while True:
        for pack in packs:
            write_pack(path, pack)
            sys.stdout.write("w")
            sys.stdout.flush()


def _whole(path: Path, versions: list[Pack]) -> bool:
    try:
        pack = read_pack(path)
    except InputError:
        return False
    latents = [grid_parts(one).textures[0].latents for one in (pack, *versions)]
    return any(np.array_equal(latents[0], version) for version in latents[1:])


def kill_writers(path: Path, kills: int, seed: int) -> Result:
    """Write to `path` and kill the writer, `kills` times."""
    chooser = random.Random(seed)
    result = Result()
    versions = _versions()
    for _ in range(kills):
        with subprocess.Popen(
            [sys.executable, "-m", "lab.benchmarks.killed_writes", "--write", str(path)], stdout=subprocess.PIPE
        ) as child:
            assert child.stdout is not None
            child.stdout.read(1)
            time.sleep(chooser.uniform(0.0, LONGEST_WAIT))
            child.kill()
        result.kills += 1
        result.damaged += not _whole(path, versions)
        partial = sum(is_partial(entry) for entry in path.parent.iterdir())
        result.hit_a_write += partial > 0
        result.most_leftovers = max(result.most_leftovers, partial)
    write_pack(path, versions[0])
    result.leftovers_at_the_end = sum(is_partial(entry) for entry in path.parent.iterdir())
    return result


def main() -> None:
    """Run and report."""
    parser = options(__doc__)
    parser.add_argument("--kills", type=int, default=200)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--write", type=Path, help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.write is not None:
        _write_for_ever(given.write)
    with tempfile.TemporaryDirectory() as folder:
        result = kill_writers(Path(folder) / "pack.ntc", given.kills, given.seed)
    print(", ".join(f"{name.replace('_', ' ')} {value}" for name, value in asdict(result).items()))
    write_record(given.json, asdict(result))


if __name__ == "__main__":
    run(main)
