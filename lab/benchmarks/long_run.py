"""Many frames of a small scene: whether memory, handles or pictures drift.

    python -m lab.benchmarks.long_run [--frames 100000] [--scene FILE] [--json FILE]

Each frame takes one of many views at random: cameras, paths, precisions, compare modes, overlay, sizes; now and then a pack is
replaced by another version of itself. Memory and handles are taken after a tenth of the frames, when all programs and sizes have
been met, and at the end; a picture of each path is taken first and last, and must be the same to the bit.
"""

import argparse
import gc
import hashlib
import json
import os
import random
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import get_args

import moderngl
import numpy as np

from lab.bench.random_pack import random_pack
from ntc.codec.grid.model import GridConfig
from ntc.codec.model import Pack
from ntc.io import write_text
from tests.gl.small_scenes import FRONT, objects
from viewer.gl.context import create_headless_context
from viewer.render.frames import read_picture
from viewer.render.renderer import Renderer
from viewer.render.tile_cache.budget import TileCacheConfig
from viewer.scene.load import load_scene
from viewer.scene.model import Scene
from viewer.state.camera import frame_all
from viewer.state.navigation import turned
from viewer.state.view_state import REFERENCE, DecodePath, Overlay, Slot, ViewState

SIZES = ((64, 48), (40, 40), (96, 32))
CODEC = GridConfig(hidden_width=8, positional_octaves=1)
SWAP_EVERY = 50
"""Frames between two versions of a pack."""
WARM_UP_SHARE = 0.1


@dataclass(frozen=True)
class Usage:
    """Resources of the process."""

    memory_mb: float
    """Resident memory without shared pages."""
    handles: int
    """Open files."""
    shared_memory: int
    """Entries of /dev/shm."""
    gl_objects: int
    """Objects of moderngl that are alive."""


def usage() -> Usage:
    """The resources of this process now."""
    gc.collect()
    pages = Path("/proc/self/statm").read_text().split()
    memory = (int(pages[1]) - int(pages[2])) * os.sysconf("SC_PAGESIZE") / 1e6
    kinds = (moderngl.Buffer, moderngl.Texture, moderngl.Framebuffer, moderngl.VertexArray, moderngl.Program)
    alive = sum(1 for entry in gc.get_objects() if isinstance(entry, kinds))
    shared = Path("/dev/shm")
    return Usage(
        memory,
        sum(1 for _ in Path("/proc/self/fd").iterdir()),
        len(list(shared.iterdir())) if shared.is_dir() else 0,
        alive,
    )


def packs_of(scene: Scene) -> tuple[Pack, Pack]:
    """Two versions of a pack that differ in every second texture."""
    sizes = [(32, 32)] * len(scene.textures)
    groups = tuple(index % 3 for index in range(len(sizes)))
    hashes = [texture.pixel_hash for texture in scene.textures]
    first, second = (random_pack(sizes, groups, CODEC, hashes=hashes, seed=seed) for seed in (0, 1))
    mixed = tuple(pair[index % 2] for index, pair in enumerate(zip(first.textures, second.textures, strict=True)))
    return first, replace(first, textures=mixed)


def digest(renderer: Renderer, views: Sequence[ViewState]) -> str:
    """Hash of the pictures of these views."""
    found = hashlib.sha256()
    for view in views:
        found.update(np.ascontiguousarray(read_picture(renderer.render(view, whole=True).image)).tobytes())
    return found.hexdigest()


def main() -> None:
    """Draw, and report what has grown."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--frames", type=int, default=100_000)
    parser.add_argument("--scene", type=Path, help="None: cubes and spheres")
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    scene = objects() if options.scene is None else load_scene(options.scene)
    context = create_headless_context()
    renderer = Renderer(context, scene, tile_cache=TileCacheConfig(budget_bytes=1 << 20, milliseconds=1.0))
    versions = packs_of(scene)
    renderer.set_packs({"p": versions[0]})
    camera = FRONT if options.scene is None else frame_all(scene.bounds)
    cameras = [turned(camera, 7.0 * number) for number in range(12)]
    slots = [
        Slot(REFERENCE),
        *(Slot("p", path, precision) for path in get_args(DecodePath) for precision in ("fp32", "fp16")),
    ]
    fixed = [ViewState(camera, SIZES[0], slot) for slot in slots]
    first = digest(renderer, fixed)
    chance = random.Random(0)
    warm, start = max(1, int(options.frames * WARM_UP_SHARE)), time.monotonic()
    before = usage()
    for frame in range(options.frames):
        if frame == warm:
            before = usage()
        if frame % SWAP_EVERY == 0:
            renderer.set_packs({"p": versions[frame // SWAP_EVERY % 2]})
        renderer.render(
            ViewState(
                chance.choice(cameras),
                SIZES[frame // 200 % len(SIZES)],
                chance.choice(slots),
                chance.choice(slots),
                chance.choice(("a", "b", "wipe")),
                chance.random(),
                overlay=Overlay(chance.choice(("none", "divergence"))),
            )
        )
    seconds = time.monotonic() - start
    after = usage()
    renderer.set_packs({"p": versions[0]})
    same = digest(renderer, fixed) == first
    growth = 100.0 * (after.memory_mb / before.memory_mb - 1.0)
    record = {
        "renderer": renderer.name,
        "frames": options.frames,
        "seconds": seconds,
        "after warm-up": asdict(before),
        "at the end": asdict(after),
        "memory growth %": growth,
        "pictures identical": same,
    }
    print(json.dumps(record, indent=1))
    if options.json is not None:
        write_text(options.json, json.dumps(record, indent=1) + "\n")


if __name__ == "__main__":
    main()
