"""`ntc-viewer view --headless` as a program."""

from pathlib import Path

import pytest

from tests.ui.conftest import write_scene
from viewer.cli import main
from viewer.scene.images import read_image


@pytest.fixture(scope="module")
def scene_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_scene(tmp_path_factory.mktemp("headless"))


def run(scene: Path, out: Path, *arguments: str) -> int:
    return main(["view", str(scene), "--headless", "--out", str(out), "--size", "160x120", *arguments])


def test_a_script_and_lines_after_it(scene_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    script = tmp_path / "a.script"
    script.write_text("# a picture\nwait settled\nscreenshot window.png\nslot.source a single\n")
    lines = ("--exec", "expect source single; screenshot one.png", "--exec", "size 200x100; screenshot two.png")
    assert run(scene_file, tmp_path / "out", "--script", str(script), *lines) == 0
    shapes = {file.name: read_image(file).shape for file in (tmp_path / "out").iterdir()}
    assert shapes == {"window.png": (120, 160, 3), "one.png": (120, 160, 3), "two.png": (100, 200, 3)}
    assert capsys.readouterr().err == ""
