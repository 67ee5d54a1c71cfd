"""Commands without a window end with one line when the OpenGL context is lost, and write nothing of what it drew."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.drivers.messages import error_line
from tests.ui.conftest import write_scene
from viewer.gl.context_loss import LOSE_VARIABLE


@pytest.fixture(scope="module")
def scene_path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_scene(tmp_path_factory.mktemp("lost"))


def run(at: str, folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "viewer", *arguments],
        cwd=folder,
        env={**os.environ, LOSE_VARIABLE: at},
        capture_output=True,
        text=True,
        timeout=200,
        check=False,
    )


def require_one_line(ran: subprocess.CompletedProcess[str]) -> None:
    assert ran.returncode == 2, ran.stderr
    line = error_line(ran.stderr)
    for part in ("the graphics driver was reset", "has not been written", "LIBGL_ALWAYS_SOFTWARE=1"):
        assert part in line


# The last check of `render` comes after all that is read back, so that nothing is drawn and not checked.
@pytest.mark.parametrize("at", ["1", "2", "7"])
def test_render(at: str, scene_path: Path, tmp_path: Path) -> None:
    require_one_line(run(at, tmp_path, "render", str(scene_path), "--out", "out", "--size", "64x48"))
    assert list(tmp_path.iterdir()) == []


def test_render_is_done_once_all_is_read_back(scene_path: Path, tmp_path: Path) -> None:
    ran = run("8", tmp_path, "render", str(scene_path), "--out", "out", "--size", "64x48")
    assert ran.returncode == 0, ran.stderr
    assert (tmp_path / "out" / "stats.json").is_file()


def test_view_headless_keeps_the_pictures_before_it(scene_path: Path, tmp_path: Path) -> None:
    lines = "wait settled; screenshot a.png; wait frames 200; screenshot b.png"
    ran = run("120", tmp_path, "view", str(scene_path), "--headless", "--out", "out", "--exec", lines)
    require_one_line(ran)
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["a.png"]


def test_bench(scene_path: Path, tmp_path: Path) -> None:
    small = ("--what", "worst-case", "--worst-sizes", "64x64", "--repeats", "2", "--decoders", "1")
    require_one_line(run("2", tmp_path, "bench", str(scene_path), *small, "--json", "b.json"))
    assert list(tmp_path.iterdir()) == []


def test_study(scene_path: Path, tmp_path: Path) -> None:
    ran = run("5", tmp_path, "study", "filtering", str(scene_path), "--size", "64x48", "--frames", "2", "--out", "f")
    require_one_line(ran)
    assert not any(path.is_file() for path in tmp_path.rglob("*"))


def test_decode(scene_path: Path, tmp_path: Path) -> None:
    pack = scene_path.with_name("scene.single.ntc")
    require_one_line(run("1", tmp_path, "decode", str(pack), "--out", "out", "--backend", "gl"))
    assert not any(path.is_file() for path in tmp_path.rglob("*"))


def test_numbers_that_are_none_are_one_line(scene_path: Path, tmp_path: Path) -> None:
    ran = run("soon", tmp_path, "render", str(scene_path), "--out", "out")
    assert ran.returncode == 2
    assert LOSE_VARIABLE in ran.stderr
