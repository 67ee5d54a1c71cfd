"""The built-in scene from a fresh process: quick, and without the heavy libraries."""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from tests.drivers.messages import SHADERS_VARIABLE
from tests.end_to_end.conftest import two_squares
from viewer import cli, locations

PROGRAM = """
import sys
from viewer.cli import main
status = main(sys.argv[1:])
heavy = sorted({"torch", "ray", "sklearn", "trimesh", "imgui_bundle", "glfw"} & set(sys.modules))
print("HEAVY", heavy)
sys.exit(status)
"""


def test_viewing_a_pack_imports_no_training_libraries(tmp_path: Path) -> None:
    arguments = ["render", "--grouping", "clustered", "--size", "160x90", "--out", "o"]
    result = subprocess.run(
        [sys.executable, "-c", PROGRAM, *arguments], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert result.returncode == 0, result.stderr
    assert "HEAVY []" in result.stdout
    stats = json.loads((tmp_path / "o" / "stats.json").read_text())
    assert stats["camera"] == "entrance"
    assert stats["grouping"] == "clustered"
    assert stats["pixels"]["decoded"] > 0
    # Several decoders meet inside blocks from the first viewpoint on.
    assert np.load(tmp_path / "o" / "divergence.npy").max() >= 3


def test_without_a_display_pictures_are_drawn_and_their_place_is_said(encoded_scene: Path, tmp_path: Path) -> None:
    environment = {"PATH": "/usr/bin:/bin", "HOME": str(tmp_path), SHADERS_VARIABLE: os.environ[SHADERS_VARIABLE]}
    result = subprocess.run(
        [sys.executable, "-m", "viewer", str(encoded_scene)],
        cwd=tmp_path,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert result.returncode == 0, result.stderr
    assert f"the pictures are in {tmp_path}" in result.stdout.replace("/private", "")
    assert (tmp_path / "ntc-viewer-pictures" / "decoded" / "color.png").is_file()
    assert (tmp_path / "ntc-viewer-pictures" / "original" / "color.png").is_file()


def test_a_grouping_that_does_not_ship_is_encoded_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    installed, data = tmp_path / "installed", tmp_path / "data"
    installed.mkdir()
    two_squares().write(installed / "courtyard.glb")
    monkeypatch.setattr(locations, "assets_folder", lambda: installed)
    monkeypatch.setenv(locations.DATA_FOLDER_VARIABLE, str(data))
    arguments = ["render", "--grouping", "random", "--size", "48x32", "--out", str(tmp_path / "picture")]
    pack = data / "packs" / "courtyard.random.ntc"
    assert cli.main(arguments) == 0
    printed = capsys.readouterr()
    assert f"grouping random of courtyard is encoded once and kept in {pack}" in printed.err
    assert "100%" in printed.err
    assert "random" in printed.out
    made = pack.stat()
    assert cli.main(arguments) == 0
    assert "encoded" not in capsys.readouterr().err
    assert pack.stat() == made
    assert [path.name for path in installed.iterdir()] == ["courtyard.glb"]
