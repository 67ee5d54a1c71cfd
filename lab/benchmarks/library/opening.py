"""`python -m lab.benchmarks.library.opening FOLDER --json F`: how long a scene takes to be opened against a large library.

The library in FOLDER, which is made where it is not there yet, holds a pack of the built-in scene among made-up textures of 16x16
texels, 500 to a shard. Told are seconds to read the index, and to open the scene's packs from it and from the pack alone, medians of
several runs.
"""

import json
import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from lab.bench.random_pack import random_block_pack
from ntc.codec.block.config import BlockConfig
from ntc.io import write_text
from ntc.library.index import is_library, read_index
from ntc.library.writer import LibraryWriter
from ntc.pack.file import read_pack
from viewer.locations import builtin_scene_path
from viewer.scene.load import load_scene
from viewer.state.pack_files import open_packs, wanted_textures

A_SHARD = 500
RUNS = 5
CODEC = BlockConfig(block_words=(4,), coefficients=16, modes=2)


@dataclass(frozen=True)
class Options:
    """Measure opening a scene against a library."""

    folder: Annotated[Path, tyro.conf.Positional]
    """The library."""
    textures: int = 20_000
    """Made-up textures in it."""
    json: Path | None = None
    """Where to write the figures."""


def _fill(folder: Path, textures: int, pack: Path) -> None:
    with LibraryWriter(folder) as writer:
        for first in range(0, textures, A_SHARD):
            count = min(A_SHARD, textures - first)
            hashes = [f"{first + number:032x}" for number in range(count)]
            writer.add_pack(random_block_pack([(16, 16)] * count, [0] * count, CODEC, hashes, seed=first))
            if first == textures // 2 // A_SHARD * A_SHARD:
                writer.add_pack(read_pack(pack))


def _seconds(work: Callable[[], object]) -> float:
    """Median over RUNS."""
    found = []
    for _ in range(RUNS):
        began = time.perf_counter()
        work()
        found.append(time.perf_counter() - began)
    return statistics.median(found)


def main(options: Options) -> None:
    """Run the benchmark."""
    scene_path = builtin_scene_path()
    pack = scene_path.with_suffix(".clustered.ntc")
    if not is_library(options.folder):
        _fill(options.folder, options.textures, pack)
    scene = load_scene(scene_path)
    wanted = wanted_textures(scene)
    index = read_index(options.folder)
    from_library = open_packs([options.folder], wanted)
    (found,) = from_library.values()
    figures = {
        "textures": len(index.places),
        "shards": len(index.shards),
        "library_mb": sum(shard.bytes for shard in index.shards.values()) / 1e6,
        "index_mb": (options.folder / "index.ntc-library").stat().st_size / 1e6,
        "textures_of_the_scene": len(found.textures),
        "index_seconds": _seconds(lambda: read_index(options.folder)),
        "library_seconds": _seconds(lambda: open_packs([options.folder], wanted)),
        "pack_seconds": _seconds(lambda: open_packs([pack])),
    }
    text = json.dumps(figures, indent=2) + "\n"
    print(text, end="")
    if options.json is not None:
        write_text(options.json, text)


if __name__ == "__main__":
    main(tyro.cli(Options))
