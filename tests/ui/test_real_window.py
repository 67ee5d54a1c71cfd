"""A real window on a virtual screen."""

import json
from pathlib import Path

import pytest

from tests.drivers.messages import error_line
from tests.ui.conftest import run_window
from viewer.scene.images import read_image

pytestmark = pytest.mark.process

ROOT = Path(__file__).resolve().parents[2]


def test_the_window_opens_draws_and_remembers(display: str, scene_path: Path, tmp_path: Path) -> None:
    result = run_window(
        display,
        tmp_path,
        "-m",
        "viewer",
        str(scene_path),
        variables={"NTC_VIEWER_EXIT_AFTER_FRAMES": "4"},
        timeout=100.0,
    )
    assert result.returncode == 0, result.stderr
    assert "Traceback" not in result.stderr
    assert (tmp_path / "settings" / "settings.json").is_file()


def test_no_window_system_is_one_line(scene_path: Path, tmp_path: Path) -> None:
    result = run_window(":98765", tmp_path, "-m", "viewer", str(scene_path))
    assert result.returncode == 2
    assert "DISPLAY" in error_line(result.stderr)


def test_a_settings_folder_that_cannot_be_made_is_no_obstacle(display: str, scene_path: Path, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    result = run_window(
        display,
        tmp_path,
        *("-m", "viewer", str(scene_path)),
        variables={
            "NTC_VIEWER_CONFIG_DIR": str(tmp_path / "file" / "settings"),
            "NTC_VIEWER_EXIT_AFTER_FRAMES": "2",
        },
    )
    assert result.returncode == 0, result.stderr
    assert "Traceback" not in result.stderr


def test_a_script_plays_in_the_window_and_closes_it(display: str, scene_path: Path, tmp_path: Path) -> None:
    measured = "compare.measure; wait settled; compare.save-figures f.json"
    lines = (
        f"wait settled; {measured}; key H; expect panels off; size 320x240; wait frames 5; screenshot a.png; file.quit"
    )
    command = ("-m", "viewer", "view", str(scene_path), "--exec", lines, "--size", "400x300", "--out", "out")
    result = run_window(display, tmp_path, *command)
    assert result.returncode == 0, result.stderr
    assert "Traceback" not in result.stderr
    assert read_image(tmp_path / "out" / "a.png").shape == (240, 320, 3)
    # Both slots were drawn before anybody looked at times.
    times = [own["decode_ms"] for own in json.loads((tmp_path / "out" / "f.json").read_text()).values()]
    assert len(times) == 2
    assert all(times)


def test_a_mistake_in_a_panel_ends_with_its_traceback(display: str, scene_path: Path, tmp_path: Path) -> None:
    command = ("-m", "tests.ui.lost_windows", "fail_in_a_panel", str(scene_path), str(tmp_path / "out"))
    result = run_window(display, tmp_path, *command, cwd=ROOT)
    assert result.returncode == 1, result.stderr
    assert result.stderr.splitlines()[-1] == "RuntimeError: a mistake of this program"
    assert (tmp_path / "settings" / "settings.json").is_file()
