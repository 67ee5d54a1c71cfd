"""Commands without a window end with one line when the OpenGL context is lost, and write nothing of what it drew."""

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.drivers.messages import error_line
from tests.ui.conftest import write_scene
from viewer import cli
from viewer.gl.context_loss import LOSE_VARIABLE


@pytest.fixture(scope="module")
def scene_path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_scene(tmp_path_factory.mktemp("lost"))


Run = Callable[..., tuple[int, str]]


@pytest.fixture
def run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Run:
    """Runs a command in the test's folder, with losses simulated `at` these checks: exit status and what it wrote on stderr."""
    monkeypatch.chdir(tmp_path)

    def ran(at: str, *arguments: str) -> tuple[int, str]:
        monkeypatch.setenv(LOSE_VARIABLE, at)
        status = cli.main(list(arguments))
        return status, capsys.readouterr().err

    return ran


def require_one_line(status: int, errors: str) -> None:
    assert status == 2, errors
    line = error_line(errors)
    for part in ("the graphics driver was reset", "has not been written", "LIBGL_ALWAYS_SOFTWARE=1"):
        assert part in line


def test_the_program_ends_with_one_line(scene_path: Path, tmp_path: Path) -> None:
    ran = subprocess.run(
        [sys.executable, "-m", "viewer", "render", str(scene_path), "--out", "out", "--size", "64x48"],
        cwd=tmp_path,
        env={**os.environ, LOSE_VARIABLE: "2"},
        capture_output=True,
        text=True,
        timeout=200,
        check=False,
    )
    require_one_line(ran.returncode, ran.stderr)
    assert list(tmp_path.iterdir()) == []


# The last check of `render` comes after all that is read back, so that nothing is drawn and not checked.
@pytest.mark.parametrize("at", ["1", "7"])
def test_render(at: str, run: Run, scene_path: Path, tmp_path: Path) -> None:
    require_one_line(*run(at, "render", str(scene_path), "--out", "out", "--size", "64x48"))
    assert list(tmp_path.iterdir()) == []


def test_render_is_done_once_all_is_read_back(run: Run, scene_path: Path, tmp_path: Path) -> None:
    status, errors = run("8", "render", str(scene_path), "--out", "out", "--size", "64x48")
    assert status == 0, errors
    assert (tmp_path / "out" / "stats.json").is_file()


def test_view_headless_keeps_the_pictures_before_it(run: Run, scene_path: Path, tmp_path: Path) -> None:
    lines = "wait settled; screenshot a.png; wait frames 600; screenshot b.png"
    ran = run("400", "view", str(scene_path), "--headless", "--out", "out", "--exec", lines)
    require_one_line(*ran)
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["a.png"]


def test_bench(run: Run, scene_path: Path, tmp_path: Path) -> None:
    small = ("--what", "worst-case", "--worst-sizes", "64x64", "--repeats", "2", "--decoders", "1")
    require_one_line(*run("2", "bench", str(scene_path), *small, "--json", "b.json"))
    assert list(tmp_path.iterdir()) == []


def test_study(run: Run, scene_path: Path, tmp_path: Path) -> None:
    ran = run("5", "study", "stability", str(scene_path), "--size", "64x48", "--texels", "20", "--out", "f")
    require_one_line(*ran)
    assert not any(path.is_file() for path in tmp_path.rglob("*"))


def test_decode(run: Run, scene_path: Path, tmp_path: Path) -> None:
    pack = scene_path.with_name("scene.single.ntc")
    require_one_line(*run("1", "decode", str(pack), "--out", "out", "--backend", "gl"))
    assert not any(path.is_file() for path in tmp_path.rglob("*"))


def test_numbers_that_are_none_are_one_line(run: Run, scene_path: Path, tmp_path: Path) -> None:
    status, errors = run("soon", "render", str(scene_path), "--out", "out")
    assert status == 2
    assert LOSE_VARIABLE in errors
