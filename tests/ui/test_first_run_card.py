"""The card of first steps."""

from pathlib import Path

import pytest
from imgui_bundle import imgui

from tests.support.driven_app import DrivenApp
from tests.ui.conftest import run_window
from viewer.state.settings import SETTINGS_FILE, ViewerSettings, parse_settings

CLOSED_AT_ONCE = "wait frames 3; expect label 'Got it'; click 'Got it'; wait frames 2; window.close"


def settings(folder: Path) -> ViewerSettings:
    return parse_settings((folder / "settings" / SETTINGS_FILE).read_text(), SETTINGS_FILE)


def test_the_card_is_closed_for_good_and_comes_back_from_the_menu(app: DrivenApp) -> None:
    assert "Got it" not in app.widgets.labels()
    app.run("help.first-steps")
    app.settle()
    assert {"first step 1", "first step 2", "first step 3"} <= set(app.widgets.labels())
    app.click("Got it")
    assert "Got it" not in app.widgets.labels()
    assert not app.session.settings.first_steps
    app.click("menu: Help")
    app.click("menu: help.first-steps")
    assert "Got it" in app.widgets.labels()


def test_the_card_lies_within_the_picture(app: DrivenApp) -> None:
    app.resize((1280, 720))
    app.run("help.first-steps")
    app.settle()
    area = app.frontend.interface.picture_area
    assert area is not None
    x, y = app.widgets.centre("first step 2")
    assert area.left < x < area.right
    assert area.top < y < area.bottom


def test_keys_work_while_the_card_is_shown(app: DrivenApp) -> None:
    app.run("help.first-steps")
    app.settle()
    app.press(imgui.Key.o)
    assert app.session.view.overlay.kind == "divergence"


@pytest.mark.process
def test_a_new_window_shows_the_card_until_it_is_closed(display: str, scene_path: Path, tmp_path: Path) -> None:
    command = ("-m", "viewer", "view", str(scene_path), "--exec")
    result = run_window(display, tmp_path, *command, CLOSED_AT_ONCE)
    assert result.returncode == 0, result.stderr
    assert not settings(tmp_path).first_steps
    # What is expected ends the script where it is not so: panels stay.
    script, ends = "wait frames 3; expect label 'Got it'; window.panels", {"NTC_VIEWER_EXIT_AFTER_FRAMES": "12"}
    run_window(display, tmp_path, *command, script, variables=ends)
    assert settings(tmp_path).show_panels
