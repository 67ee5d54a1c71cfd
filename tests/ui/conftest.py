"""A window's content without a window, over a small scene with two packs."""

import os
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import pytest
from imgui_bundle import imgui

from lab.bench.random_pack import random_pack
from lab.window_trials.virtual_display import virtual_display
from ntc.codec.grid.model import GridConfig
from ntc.codec.model import Pack
from ntc.errors import InputError
from ntc.pack.file import write_pack
from tests.end_to_end.conftest import two_squares
from tests.support.driven_app import DrivenApp
from viewer.scene.load import load_scene
from viewer.scene.model import Scene
from viewer.state.pack_files import open_packs, packs_beside
from viewer.state.settings import ViewerSettings

SIZE = (720, 400)
Opener = Callable[..., DrivenApp]
NARROW = GridConfig(hidden_width=16)
"""Decoded in a fraction of the time of the usual codec."""


def write_scene(folder: Path, seed: int = 5) -> Path:
    """scene.glb with clustered and single packs of random content beside it."""
    path = two_squares(seed).write(folder / "scene.glb")
    hashes = [texture.pixel_hash for texture in load_scene(path).textures]
    for name, groups in (("clustered", (0, 1)), ("single", (0, 0))):
        pack = random_pack(((32, 32), (32, 32)), groups, NARROW, hashes, seed=len(name))
        grouped = pack.__class__(pack.config, pack.grouping.__class__(name, groups), pack.textures, pack.decoders)
        write_pack(folder / f"scene.{name}.ntc", grouped)
    return path


def run_window(
    display: str,
    folder: Path,
    *arguments: str,
    cwd: Path | None = None,
    timeout: float = 120.0,
    variables: Mapping[str, str] | None = None,
) -> subprocess.CompletedProcess[str]:
    """What `python ARGUMENTS` does with its settings in `folder`; run there, or in `cwd`, with further environment variables."""
    return subprocess.run(
        [sys.executable, *arguments],
        cwd=cwd or folder,
        env={
            **os.environ,
            "DISPLAY": display,
            "NTC_VIEWER_CONFIG_DIR": str(folder / "settings"),
            "NTC_VIEWER_DATA_DIR": str(folder / "data"),
            **(variables or {}),
        },
        capture_output=True,
        text=True,
        timeout=timeout,
        check=False,
    )


def hide_panels(app: DrivenApp) -> None:
    app.press(imgui.Key.h)
    assert not app.session.window.show_panels


@pytest.fixture(scope="module")
def scene_path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_scene(tmp_path_factory.mktemp("ui"))


@pytest.fixture(scope="module")
def scene(scene_path: Path) -> Scene:
    return load_scene(scene_path)


@pytest.fixture
def open_window(scene: Scene, scene_path: Path, tmp_path: Path) -> Iterator[Opener]:
    """Opens a window's content, by default the small scene with its packs; what is open at the end of the test is closed."""
    opened: list[DrivenApp] = []

    def open_one(
        size: tuple[int, int] = SIZE,
        shown: Scene | None = None,
        packs: Mapping[str, Pack] | None = None,
        **settings: Any,
    ) -> DrivenApp:
        """Other scenes have no packs unless they are given."""
        if packs is None:
            packs = open_packs(packs_beside(scene_path)) if shown is None else {}
        made = DrivenApp(shown or scene, packs, size, tmp_path / "pictures", ViewerSettings(**settings))
        opened.append(made)
        return made

    yield open_one
    for made in reversed(opened):
        made.close()


@pytest.fixture
def app(open_window: Opener) -> DrivenApp:
    made = open_window(live_figures=False, column_folded=False)
    made.settle()
    return made


@pytest.fixture
def display() -> Iterator[str]:
    """DISPLAY of a virtual screen for one test."""
    try:
        with virtual_display() as name:
            yield name
    except InputError as error:
        pytest.skip(str(error))
