"""Ways to spoil a file, a scene of several files to spoil, and a session on it whose commands are carried out at once."""

import os
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from lab.bench.random_pack import random_pack
from ntc.codec.model import Pack
from ntc.pack.file import write_pack
from tests.support.gltf_builder import GltfBuilder, png
from viewer.app.effects import Effects, Opening
from viewer.commands import run_or_notify
from viewer.commands.command import Context
from viewer.commands.effects import Effect
from viewer.scene.load import load_scene
from viewer.state.open_files import InitialView, new_session
from viewer.state.pack_files import open_packs, packs_beside
from viewer.state.settings import ViewerSettings
from viewer.training.run_log import Run

Spoil = Callable[[Path], None]


SECONDS = 120.0


def deleted(path: Path) -> None:
    path.unlink()


def emptied(path: Path) -> None:
    path.write_bytes(b"")


def garbage(path: Path) -> None:
    path.write_bytes(np.random.default_rng(1).bytes(path.stat().st_size))


def truncated(path: Path) -> None:
    path.write_bytes(path.read_bytes()[: path.stat().st_size * 2 // 3])


def folder_instead(path: Path) -> None:
    path.unlink()
    path.mkdir()


def pipe_instead(path: Path) -> None:
    path.unlink()
    os.mkfifo(path)


def ring_of_links(path: Path) -> None:
    path.unlink()
    path.symlink_to(path)


def unreadable(path: Path) -> None:
    if os.geteuid() == 0:
        pytest.skip("root may read anything")
    path.chmod(0)


every_way = pytest.mark.parametrize(
    "spoil",
    [deleted, emptied, garbage, truncated, folder_instead, pipe_instead, ring_of_links, unreadable],
    ids=lambda spoil: spoil.__name__,
)


def write_scene(folder: Path, seed: int = 0) -> Path:
    """scene.gltf with scene.bin and two images beside it, and a pack."""
    builder, random = GltfBuilder(), np.random.default_rng(seed)
    primitives = []
    for number in range(2):
        (folder / f"picture{number}.png").write_bytes(png(random.integers(0, 256, (16, 16, 3), np.uint8)))
        image = builder.add("images", uri=f"picture{number}.png")
        primitives.append(builder.triangle(builder.material(image)))
    path = builder.drawn(*primitives).write(folder / "scene.gltf", uri="scene.bin")
    write_pack(folder / "scene.single.ntc", pack_of(path))
    return path


def pack_of(path: Path, seed: int = 0) -> Pack:
    hashes = [texture.pixel_hash for texture in load_scene(path).textures]
    return random_pack(((16, 16), (16, 16)), (0, 1), hashes=hashes, seed=seed)


def finish_opening(opening: Opening) -> None:
    """Open all that waits, as if frames had shown it."""
    began = time.monotonic()
    while opening.is_under_way:
        opening.note_shown()
        opening.advance()
        assert time.monotonic() - began < SECONDS
        time.sleep(0.001)


class PromptEffects(Effects):
    """Effects that finish within the command: a file that it opens is open when it returns."""

    def perform(self, effect: Effect) -> None:
        super().perform(effect)
        finish_opening(self.opening)


def open_context(path: Path) -> Context:
    """A session on the scene at `path` with the packs beside it; pictures go beside the scene."""
    scene, packs, pictures = load_scene(path), open_packs(packs_beside(path)), path.parent / "pictures"
    context = Context(new_session(scene, packs, ViewerSettings(), InitialView(), pictures))
    PromptEffects(context)
    return context


def errors(context: Context) -> list[str]:
    lines = [entry.text for entry in context.session.window.log if entry.kind == "error"]
    assert all("\n" not in line and "Traceback" not in line for line in lines)
    return lines


def finished(context: Context, seed: int = 7) -> Pack:
    """A training has ended, and is not saved."""
    assert context.session.scene.path is not None
    hashes = [texture.pixel_hash for texture in context.session.scene.textures]
    pack = random_pack(((16, 16), (16, 16)), (0, 1), hashes=hashes, seed=seed)
    run = Run(context.training.log.next_number, "retrain 1 group (0)", "quick", 2, "done", 1.0, None, pack=pack)
    context.training.enter(context.session.scene)
    context.training.log.add(run)
    context.session.packs = {**context.session.packs, run.name: pack}
    return pack


def settle(context: Context) -> None:
    began = time.monotonic()
    while context.training.saving:
        context.training.tick(context.session.scene, frozenset(), context.session.packs)
        assert time.monotonic() - began < SECONDS
        time.sleep(0.005)


def keep(context: Context, *path: Path) -> None:
    """Keep the last run."""
    run_or_notify(context, "training.keep", *path)
    settle(context)
