"""The window goes on in a new one when its OpenGL context is lost, with the same picture and all that was open."""

import json
import re
import shlex
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ntc.errors import InputError
from ntc.pack.file import write_pack
from tests.ui.conftest import run_window
from viewer.app.imgui_window import RECOVERED, LossHistory, context_lost_error, open_again
from viewer.cli.arguments import parse_arguments
from viewer.cli.options import ViewOptions
from viewer.gl.context_loss import LOSE_VARIABLE, ContextLostError
from viewer.scene.images import read_image
from viewer.scene.model import Scene
from viewer.state.open_files import InitialView, new_session
from viewer.state.pack_files import open_packs, packs_beside
from viewer.state.settings import ViewerSettings

pytestmark = pytest.mark.process

ROOT = Path(__file__).resolve().parents[2]


def lose(display: str, folder: Path, deed: str, scene_path: Path) -> dict[str, Any]:
    """What a deed of lost_windows.py finds."""
    command = ("-m", "tests.ui.lost_windows", deed, str(scene_path), str(folder / "out"))
    ran = run_window(display, folder, *command, cwd=ROOT, timeout=280, variables={LOSE_VARIABLE: ""})
    assert ran.returncode == 0, ran.stderr
    assert "Traceback" not in ran.stderr
    found: dict[str, Any] = json.loads(ran.stdout)
    assert found["imgui_contexts_left"] == 0
    assert found["threads"] == 1
    alive = found["alive_at_the_end"]
    # The window's own framebuffer has nothing to be freed.
    assert alive.pop("Framebuffer") <= 1
    assert set(alive.values()) == {0}
    return found


def play(display: str, folder: Path, at: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    return run_window(display, folder, "-m", "viewer", "view", *arguments, timeout=200, variables={LOSE_VARIABLE: at})


def test_a_new_window_shows_the_same(display: str, scene_path: Path, tmp_path: Path) -> None:
    found = lose(display, tmp_path, "same_picture", scene_path)
    assert (found["same_window"], found["same_place"], found["same_session"]) == (False, True, True)
    assert RECOVERED in found["told"]
    assert "another program" in found["details"][found["told"].index(RECOVERED)]
    assert found["views"][0] == found["views"][1]
    before, after = (read_image(tmp_path / "out" / f"{name}.png") for name in ("before", "after"))
    assert before.std() > 10
    np.testing.assert_array_equal(before, after)
    windows = [read_image(tmp_path / "out" / f"{name}-window.png") for name in ("before", "after")]
    assert windows[0].shape == windows[1].shape == (470, 760, 3)
    # But for times and counts in the panels.
    assert (windows[0] != windows[1]).any(axis=-1).mean() < 0.02


def test_a_loss_in_the_midst_of_a_panel(display: str, scene_path: Path, tmp_path: Path) -> None:
    found = lose(display, tmp_path, "in_a_panel", scene_path)
    assert found["raised"]
    assert found["told"] == [RECOVERED]


def test_lost_again_and_again_is_one_line_and_a_view_to_go_on_with(
    display: str, scene_path: Path, tmp_path: Path
) -> None:
    wanted = "compare.mode wipe; compare.divider 0.25; wait frames 300"
    ran = play(
        display, tmp_path, "60,90,120", str(scene_path), "--exec", wanted, "--out", "it's out", "--size", "400x300"
    )
    assert ran.returncode == 2, ran.stderr
    (line,) = ran.stderr.splitlines()
    assert line.startswith("error: the graphics driver was reset")
    assert "3 times within a minute" in line
    (kept,) = (tmp_path / "it's out").iterdir()
    assert kept.suffix == ".json"
    command = shlex.split(line[line.index("ntc-viewer view") :])
    # What the line says to type, after which the same view is saved again.
    again = play(display, tmp_path, "", *command[2:], "--exec", f"view.save {tmp_path / 'again.json'}; file.quit")
    assert again.returncode == 0, again.stderr
    assert json.loads((tmp_path / "again.json").read_text()) == json.loads(kept.read_text())
    assert json.loads(kept.read_text())["divider"] == 0.25


def test_where_no_window_opens_again_it_is_tried_and_then_told() -> None:
    tries = []

    def open_window() -> str:
        tries.append(1)
        if len(tries) < 3:
            raise InputError("no window could be opened")
        return "window"

    assert open_again(open_window, (0.0, 0.0, 0.0)) == "window"
    tries.clear()
    with pytest.raises(InputError, match="no window"):
        open_again(open_window, (0.0, 0.0))


def test_three_losses_within_a_minute_are_too_many() -> None:
    times = iter([0.0, 40.0, 61.0, 80.0, 200.0, 259.0, 261.0, 262.0])
    history = LossHistory(lambda: next(times))
    assert [history.add() for _ in range(8)] == [False, False, False, True, False, False, False, True]


def test_the_context_lost_error_names_all_that_was_open(scene: Scene, scene_path: Path, tmp_path: Path) -> None:
    elsewhere = tmp_path / "a pack.ntc"
    pack = next(iter(open_packs(packs_beside(scene_path)).values()))
    write_pack(elsewhere, pack)
    session = new_session(scene, open_packs([*packs_beside(scene_path), elsewhere]), ViewerSettings(), InitialView())
    session.pictures_folder = tmp_path / "pictures"
    line = str(context_lost_error(session, ContextLostError("guilty"), "no window could be opened"))
    assert "\n" not in line
    _, options = parse_arguments(shlex.split(line[line.index("ntc-viewer view") :])[1:])
    assert isinstance(options, ViewOptions)
    assert (options.scene, options.pack) == (scene_path.resolve(), (elsewhere,))
    (kept,) = session.pictures_folder.iterdir()
    assert re.search(re.escape(str(kept)), options.exec[0])


def test_a_view_that_cannot_be_kept_is_told_too(scene: Scene, tmp_path: Path) -> None:
    session = new_session(scene, {}, ViewerSettings(), InitialView())
    session.pictures_folder = tmp_path / "file"
    session.pictures_folder.write_text("")
    line = str(context_lost_error(session, ContextLostError("unknown"), "no window could be opened"))
    assert "could not be saved" in line
    assert list(tmp_path.iterdir()) == [session.pictures_folder]
