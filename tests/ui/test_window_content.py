"""Clicking through the user interface without a window."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from imgui_bundle import imgui

from lab.bench.random_pack import random_pack
from ntc.errors import InputError
from tests.support.driven_app import DrivenApp
from tests.ui.conftest import SIZE, Opener, hide_panels
from viewer.commands import COMMANDS, run, run_line
from viewer.inspect.costs import cost_bars
from viewer.inspect.measured_figures import figure_rows
from viewer.render.path_choice import unsupported_paths
from viewer.scene.images import read_image
from viewer.scene.model import Scene
from viewer.state.event_handlers import expire_toasts, notify, set_unsupported
from viewer.state.view_state import Overlay, Side
from viewer.ui.panels.timings import timings_text
from viewer.ui.theme import ERROR_ICON, WARNING_ICON, icon

MIDDLE = (SIZE[0] / 2, SIZE[1] / 2)


def test_every_icon_of_a_command_is_in_the_font(app: DrivenApp) -> None:
    icons = {command.icon for command in COMMANDS if command.icon} | {WARNING_ICON, ERROR_ICON}
    assert {"folder-open", "box-archive", "ruler", "play", "stop", "layer-group", "lightbulb", "file-export"} <= icons
    app.run("compare.swap")
    font = imgui.get_io().fonts.fonts[0]
    assert not [name for name in sorted(icons) if not font.is_glyph_in_font(ord(icon(name)))]
    assert not font.is_glyph_in_font(0xE0FF)


def test_paths_that_the_driver_lacks_are_grey_with_the_reason_and_left_out_by_the_key(app: DrivenApp) -> None:
    before, had = app.session.view, app.session.unsupported
    reasons = unsupported_paths(replace(app.graphics, features=replace(app.graphics.features, compute=False)))
    assert set(reasons) == {"deferred", "binned", "cached", "on-load"}
    set_unsupported(app.session, reasons)
    app.run("slot.path", "a", "forward")
    app.click("A path")
    for path in reasons:
        assert "needs compute shaders" in app.widgets.tips[f"A path: {path}"]
        with pytest.raises(InputError, match=rf"{path}: needs compute shaders"):
            run(app.context, "slot.path", "a", path)
    app.click("A path: binned")
    assert app.session.view.slot_a.path == "forward"
    app.press(imgui.Key.escape)
    app.run("slot.next-path")
    assert app.session.view.slot_a.path == "forward"
    set_unsupported(app.session, had)
    app.session.view = before


def test_auto_finds_the_cheapest_precision_beside_the_frames(open_window: Opener, scene: Scene) -> None:
    hashes = [texture.pixel_hash for texture in scene.textures]
    # Of this seed, whose weights lose little as halves.
    wide = random_pack(((32, 32), (32, 32)), (0, 1), hashes=hashes, seed=9)
    app = open_window(packs={"clustered": wide}, live_figures=False, column_folded=False)
    app.settle()
    app.click("A precision")
    app.click("A precision: auto")
    app.frame()
    app.until(lambda: not app.session.precision_searches)
    assert app.session.view.slot_a.precision != "fp32", "weights of the built-in packs are halves"
    assert any("clustered: precision fp16" in toast.text for toast in app.session.window.toasts)


def test_the_picture_is_what_the_mode_says(app: DrivenApp) -> None:
    hide_panels(app)
    shots = {}
    for mode in ("wipe", "a", "b"):
        while app.session.view.compare != mode:
            app.press(imgui.Key.tab)
        shots[mode] = app.screenshot().astype(int)
    rows = slice(60, SIZE[1] - 60)
    left, right = slice(0, SIZE[0] // 2 - 20), slice(SIZE[0] // 2 + 20, SIZE[0])
    np.testing.assert_array_equal(shots["wipe"][rows, left], shots["a"][rows, left])
    np.testing.assert_array_equal(shots["wipe"][rows, right], shots["b"][rows, right])
    assert np.abs(shots["a"] - shots["b"])[rows].max() > 20


def test_beside_the_divider_the_mouse_moves_the_camera(app: DrivenApp) -> None:
    hide_panels(app)
    before = app.session.view
    app.drag((MIDDLE[0] + 60, MIDDLE[1]), (MIDDLE[0] + 100, MIDDLE[1] + 10))
    assert app.session.view.wipe_position == before.wipe_position
    assert app.session.view.camera.eye != before.camera.eye
    assert app.session.view.camera.target == before.camera.target
    panned = app.session.view.camera
    app.drag((MIDDLE[0] + 60, MIDDLE[1]), (MIDDLE[0] + 90, MIDDLE[1]), button=1)
    assert app.session.view.camera.target != panned.target


def test_nothing_is_drawn_when_nothing_changed(app: DrivenApp) -> None:
    drawn = app.frontend.picture.frames_drawn
    app.frame(5)
    assert app.frontend.picture.frames_drawn == drawn
    assert not app.frontend.needs_frame(SIZE)
    app.click("B")
    assert app.frontend.picture.frames_drawn == drawn + 1


def test_the_window_says_why_it_draws(app: DrivenApp) -> None:
    # On a busy machine frames are long, and a camera that has just moved is a reason for the whole picture.
    app.session.settings = replace(app.session.settings, coarse_while_moving=False)
    app.settle()
    assert app.frontend.reasons(SIZE) == ()
    app.frame()
    assert "reason of the last frame: mouse" in timings_text(app.frontend.facts())
    app.run("camera.turntable", 30.0)
    assert "the camera moves" in app.frontend.reasons(SIZE)
    app.frame()
    assert "reason of the last frame: the camera moves" in timings_text(app.frontend.facts())
    app.run("camera.stop")
    app.run("file.screenshot", "a.png")
    assert "a picture is written" in app.frontend.reasons(SIZE)
    app.settle()
    app.session.precision_searches = frozenset[Side](("a",))
    assert app.frontend.reasons(SIZE) == ("searching the fastest precision",)
    assert not app.is_settled
    assert not app.frontend.needs_frame(SIZE), "a frame was drawn just now, and none is due before it has been found"


def test_measuring_fills_the_table(app: DrivenApp) -> None:
    # So that the edge between the two squares falls inside blocks.
    camera = replace(app.session.view.camera, eye=(0.03, 0.0, 1.5), target=(0.03, 0.0, 0.0))
    app.session.view = replace(app.session.view, camera=camera)
    app.settle()
    app.click("Measure")
    app.settle()
    figures = app.session.inspection.measurements
    assert figures["a"].source == "clustered"
    assert figures["a"].psnr_db is not None
    assert figures["a"].divergence is not None
    assert figures["a"].divergence.maximum == 2
    assert figures["b"].psnr_db is None
    assert app.session.inspection.measured_view == app.session.view
    rows = figure_rows(figures)
    for name in ("bits per texel", "file MB"):
        assert (rows[name][0] != "-", rows[name][1]) == (True, "-")
    assert all("-" not in rows[name] for name in ("shows", "GPU MB", "decode ms")), "originals cost something too"


def test_the_key_that_measures_raises_the_table_and_tells_it(app: DrivenApp) -> None:
    app.show_panel("Scene")
    with pytest.raises(InputError, match="nothing is measured"):
        run_line(app.context, "compare.copy-figures")
    app.press(imgui.Key.m)
    app.until(lambda: app.session.inspection.measurements)
    app.settle()
    assert app.frontend.interface.shows("Compare")
    assert any(toast.text.startswith("measured: A ") for toast in app.session.window.toasts)
    app.click("copy figures")
    assert "| GPU MB |" in imgui.get_clipboard_text()
    app.run("compare.save-figures", Path("figures.json"))
    app.frame(2)
    folder = app.session.pictures_folder
    assert json.loads((folder / "figures.json").read_text())["a"]["source"] == "clustered"
    assert (folder / "figures.png").is_file()
    assert read_image(folder / "figures-costs.png").shape[1] == 960
    bars = cost_bars(app.session.inspection.measurements, {})["in memory, MB"]
    assert [bar.source[:2] for bar in bars] == ["A:", "B:"]
    assert max(bar.share for bar in bars) == 1.0


def test_the_divergence_overlay_is_shown_counted_and_skipped(app: DrivenApp) -> None:
    camera = replace(app.session.view.camera, eye=(0.03, 0.0, 1.5), target=(0.03, 0.0, 0.0))
    app.session.settings = replace(app.session.settings, coarse_while_moving=False)
    look = Overlay(palette="green-red", scale="picture")
    app.session.view = replace(app.session.view, camera=camera, compare="a", overlay=look)
    app.settle()
    hide_panels(app)
    plain = app.screenshot().astype(int)
    assert app.frontend.facts().frame.skipped["divergence_passes"] == 1
    app.press(imgui.Key.o)
    assert app.session.view.overlay.kind == "divergence"
    assert "divergence_passes" not in app.frontend.facts().frame.skipped
    covered = app.screenshot().astype(int)
    changed = np.abs(covered - plain).max(axis=2) > 5
    assert 0.1 < changed[60:-60].mean() < 0.9
    red = (covered[..., 0] > covered[..., 1] + 40) & changed
    # Red where the two squares meet, green elsewhere.
    columns = np.nonzero(red[80:-80].any(axis=0))[0]
    assert len(columns) == 8
    app.press(imgui.Key.o)
    np.testing.assert_array_equal(app.screenshot().astype(int), plain)


def test_messages_end_after_they_have_been_seen_for_a_while(app: DrivenApp) -> None:
    notify(app.session, "hello")
    assert app.session.window.toasts[0].until is None
    app.frame()
    until = app.session.window.toasts[0].until
    assert until is not None
    expire_toasts(app.session, until + 0.01)
    assert not app.session.window.toasts


def test_what_panels_hide_is_not_drawn(app: DrivenApp) -> None:
    area = app.frontend.interface.picture_area
    assert area is not None
    assert app.session.window.picture_size == (area.width, area.height)
    assert area.width < SIZE[0] - 300
    shot = app.screenshot()
    hide_panels(app)
    assert app.session.window.picture_size == SIZE
    app.session.window.show_panels = True
    app.settle()
    assert app.session.window.picture_size == (area.width, area.height)
    np.testing.assert_array_equal(app.screenshot(), shot)
