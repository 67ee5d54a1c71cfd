"""Kill a writer of packs at random moments, and count what is damaged afterwards.

A child process writes one file over and over, each time with other content. The parent kills it (SIGKILL) and reads the file: it
must be one whole version. At the end one more write must leave no temporary file.
"""

import random
import subprocess
import sys
import time
from pathlib import Path

import numpy as np

from lab.bench.random_pack import random_pack
from ntc.codec.grid.model import GridConfig, grid_parts
from ntc.codec.model import Pack
from ntc.errors import InputError
from ntc.io import is_partial
from ntc.pack.file import read_pack, write_pack

LONGEST_WAIT = 0.05
"""Seconds from the first whole write to the kill, at most; one write takes a few milliseconds."""
SIDE = 512
"""Texels a side of the pack's texture: large enough for kills to hit the middle of a write."""


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


def _is_whole(path: Path, versions: list[Pack]) -> bool:
    try:
        pack = read_pack(path)
    except InputError:
        return False
    latents = [grid_parts(one).textures[0].latents for one in (pack, *versions)]
    return any(np.array_equal(latents[0], version) for version in latents[1:])


def kill_writers(path: Path, kills: int, seed: int) -> tuple[int, int]:
    """Write to `path` and kill the writer, `kills` times. Returns (damaged files, temporary files left after a last write)."""
    chooser, versions, damaged = random.Random(seed), _versions(), 0
    for _ in range(kills):
        command = [sys.executable, "-m", "tests.support.killed_writes", str(path)]
        with subprocess.Popen(command, stdout=subprocess.PIPE) as child:
            assert child.stdout is not None
            assert child.stdout.read(1) == b"w"
            time.sleep(chooser.uniform(0.0, LONGEST_WAIT))
            child.kill()
        damaged += not _is_whole(path, versions)
    write_pack(path, versions[0])
    return damaged, sum(is_partial(entry) for entry in path.parent.iterdir())


if __name__ == "__main__":
    _write_for_ever(Path(sys.argv[1]))
