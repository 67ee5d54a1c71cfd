"""`python -m lab.benchmarks.library.grouping --json F`: groups of 10^4 to 10^6 textures by made-up features, read in blocks.

Told are seconds, the most memory beyond what the process had before, and the sizes of groups; 16 textures to a group.
"""

import json
import multiprocessing
import resource
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import tyro
from numpy.typing import NDArray

from ntc.grouping.clustered import minibatch_labels
from ntc.io import write_text

FEATURES = 17
BLOCK = 4096
A_GROUP = 16


@dataclass(frozen=True)
class Options:
    """Measure grouping at scale."""

    textures: tuple[int, ...] = (10_000, 100_000, 1_000_000)
    """Numbers of textures."""
    json: Path | None = None
    """Where to write the figures."""


def _write(path: Path, count: int) -> None:
    random = np.random.default_rng(0)
    places = random.normal(0.0, 3.0, (200, FEATURES))
    with path.open("wb") as file:
        for first in range(0, count, BLOCK):
            own = min(BLOCK, count - first)
            file.write((places[random.integers(0, 200, own)] + random.normal(size=(own, FEATURES))).tobytes())


def _blocks(path: Path) -> Iterator[NDArray[np.float64]]:
    with path.open("rb") as file:
        while data := file.read(BLOCK * FEATURES * 8):
            yield np.frombuffer(data).reshape(-1, FEATURES)


def _peak_mb() -> float:
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak / 1e6 if sys.platform == "darwin" else peak / 1e3


def _measured(count: int) -> dict[str, Any]:
    """Figures for so many textures; in a process of its own, as a peak never falls."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "features"
        _write(path, count)
        before, began = _peak_mb(), time.perf_counter()
        labels = minibatch_labels(lambda: _blocks(path), count, count // A_GROUP, 0)
        seconds, after = time.perf_counter() - began, _peak_mb()
    sizes = np.bincount(labels)
    return {
        "textures": count,
        "groups": int((sizes > 0).sum()),
        "largest_group": int(sizes.max()),
        "seconds": seconds,
        "microseconds_a_texture": seconds / count * 1e6,
        "memory_mb": after - before,
        "memory_of_all_features_mb": count * FEATURES * 8 / 1e6,
    }


def main(options: Options) -> None:
    """Run the benchmark."""
    rows = []
    for count in options.textures:
        with multiprocessing.get_context("spawn").Pool(1) as pool:
            rows.append(pool.apply(_measured, (count,)))
        print(rows[-1])
    if options.json is not None:
        write_text(options.json, json.dumps(rows, indent=2) + "\n")


if __name__ == "__main__":
    main(tyro.cli(Options))
