"""Textures, groups, nodes, memory and messages in the window; the layout of the panels and their theme."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from imgui_bundle import imgui

from tests.support.driven_app import DrivenApp
from tests.support.picture_scenes import Part, scene_of, texture
from tests.ui.conftest import SIZE, Opener
from viewer.commands import find_command
from viewer.scene.model import Material, Scene
from viewer.state.event_handlers import notify
from viewer.state.settings import load_settings, save_settings
from viewer.ui.annotations import slot_note
from viewer.ui.panels.timings import counts
from viewer.ui.widgets import text_width, two_lines


@pytest.fixture
def opener(open_window: Opener) -> Opener:
    """Opens a window's content at some size, of some scene, and lets its layout rest."""

    def opened(size: tuple[int, int] = SIZE, shown: Scene | None = None) -> DrivenApp:
        made = open_window(size, shown)
        made.settle()
        return made

    return opened


def labels(app: DrivenApp) -> tuple[str, ...]:
    return app.widgets.labels()


def run(app: DrivenApp, command: str, *arguments: str) -> None:
    app.run(command, *find_command(command).parse(arguments))
    app.settle()


def shown_textures(app: DrivenApp) -> list[str]:
    """Rows of the table from top to bottom."""
    found = [label for label in labels(app) if label.startswith("texture ") and label.split()[1].isdecimal()]
    return sorted(found, key=lambda label: app.widgets.centre(label)[1])


def place_of_tab(title: str) -> tuple[float, float]:
    """Middle of a docked panel's tab."""
    window = imgui.internal.find_window_by_name(title)
    bar = window.dock_node.tab_bar
    (tab,) = (bar.tabs[index] for index in range(bar.tabs.size()) if bar.tabs[index].id_ == window.tab_id)
    return bar.bar_rect.min.x + tab.offset + tab.width / 2.0, (bar.bar_rect.min.y + bar.bar_rect.max.y) / 2.0


def wait_for_background(app: DrivenApp) -> None:
    app.frame()
    app.until(lambda: not app.frontend.interface.background.is_busy)
    app.settle()


def many_textures(count: int) -> Scene:
    textures = [replace(texture(8, 8, seed), name=f"picture {seed:04d}") for seed in range(count)]
    parts = [Part(material=0)]
    return scene_of(parts, [Material(f"m{number}", number, (1.0, 1.0, 1.0, 1.0)) for number in range(count)], textures)


def thumbnails_made(app: DrivenApp) -> int:
    assert app.frontend.picture.thumbnails is not None
    return len(app.frontend.picture.thumbnails)


def test_thumbnails_are_made_for_rows_in_sight_only(opener: Opener) -> None:
    app = opener(shown=many_textures(2000))
    # Before they are docked, in the first frame, panels are windows of their own.
    assert thumbnails_made(app) < 50
    app.show_panel("Textures")
    seen = len(shown_textures(app))
    assert 5 < seen < 40
    assert seen <= thumbnails_made(app) < 60
    run(app, "texture.select", "1500")
    assert "texture 1500" in shown_textures(app)
    made = thumbnails_made(app)
    assert made < 120
    widgets = len(labels(app))
    few = opener(shown=many_textures(100))
    few.show_panel("Textures")
    run(few, "texture.select", "60")
    assert len(labels(few)) == pytest.approx(widgets, abs=3), "a frame costs what is in sight"


def test_a_double_click_shows_a_texture_flat(app: DrivenApp) -> None:
    app.show_panel("Textures")
    app.double_click("texture 1")
    assert app.session.inspection.flat_texture == 1
    wait_for_background(app)
    assert {"flat picture", "flat caption a", "flat caption b"} <= set(labels(app))
    side_by_side = app.screenshot()
    app.click("flat wipe")
    assert (app.screenshot() != side_by_side).any()
    camera = app.session.view.camera
    before = app.screenshot()
    app.move(*app.widgets.centre("flat picture"))
    imgui.get_io().add_mouse_wheel_event(0.0, 3.0)
    app.settle()
    assert (app.screenshot() != before).any()
    assert app.session.view.camera == camera
    run(app, "texture.close-flat")
    assert "flat picture" not in labels(app)


def test_messages_stay_in_the_log_with_details(app: DrivenApp) -> None:
    notify(app.session, "all is well")
    notify(app.session, "it broke", "error", "line one\nline two")
    app.session.window.toasts = ()
    app.show_panel("Log")
    app.click("errors only")
    assert "log 0" not in labels(app)
    app.click("log 1")
    app.click("copy log 1")
    copied = imgui.get_clipboard_text()
    assert "it broke" in copied
    assert "line two" in copied
    app.click("copy log")
    assert "all is well" in imgui.get_clipboard_text()


def test_panels_are_closed_and_the_layout_is_reset(opener: Opener) -> None:
    app = opener((1280, 720))
    places = app.frontend.interface.rects
    first = {title: places.centre(title) for title in app.session.window.panel_titles if title in labels(app)}
    assert {"Compare", "Scene", "Timings"} <= set(first)
    assert "Log" not in first, "it opens on request"
    run(app, "window.panel", "Timings", "off")
    assert "Timings" not in labels(app)
    assert app.session.present_settings.hidden_panels == ("Timings",)
    app.drag(place_of_tab("Scene"), (640.0, 300.0))
    assert app.widgets.centre("Scene") != first["Scene"]
    run(app, "window.layout-reset")
    assert app.session.settings.hidden_panels == ()
    again = {title: places.centre(title) for title in first}
    assert again == first


@pytest.mark.parametrize("size", [(640, 360), (320, 200), (1280, 720)])
def test_every_panel_can_be_had_at_every_size(opener: Opener, size: tuple[int, int]) -> None:
    app = opener(size)
    for title in app.session.window.panel_titles:
        run(app, "overlay.kind", "divergence" if title == "Divergence" else "none")
        app.show_panel(title)
        assert not imgui.internal.find_window_by_name(title).hidden
    camera = app.session.view.camera
    area = app.frontend.interface.picture_area
    assert area is not None
    start = area.at(0.8, 0.5)
    app.drag(start, (start[0] + 10, start[1]))
    assert app.session.view.camera != camera


def test_theme_and_scale_are_applied_and_kept(app: DrivenApp, tmp_path: Path) -> None:
    dark, places = app.screenshot(), app.frontend.interface.rects
    lower = places.centre("A source")[1]
    run(app, "window.theme", "light")
    assert app.screenshot()[:, :200].mean() > dark[:, :200].mean() + 80
    run(app, "window.ui-scale", "1.5")
    assert places.centre("A source")[1] == pytest.approx(1.5 * lower, rel=0.05)
    run(app, "window.ui-scale", "9")
    assert app.session.window.toasts[-1].kind == "error"
    run(app, "window.panel", "Memory", "off")
    settings = app.session.present_settings
    save_settings(tmp_path / "kept", settings)
    assert load_settings(tmp_path / "kept") == (settings, None)
    assert (settings.theme, settings.ui_scale, settings.hidden_panels) == ("light", 1.5, ("Memory",))
    run(app, "window.theme", "dark")
    run(app, "window.ui-scale", "1")
    assert np.abs(app.screenshot()[100:].astype(int) - dark[100:].astype(int)).mean() < 5.0


def test_a_group_of_the_list_is_pointed_out_in_the_picture(app: DrivenApp) -> None:
    app.run("slot.source", "a", "clustered")
    app.show_panel("Training")
    app.click("tab Retrain")
    assert app.session.shown_view.highlight == ()
    app.move(*app.widgets.centre("group 1"))
    app.settle()
    assert app.session.shown_view.highlight == (1,)
    assert app.session.view.highlight == ()
    app.move(*app.widgets.centre("tab Retrain"))
    app.settle()
    assert app.session.shown_view.highlight == ()


def test_a_slot_of_path_on_load_tells_what_is_compressed(app: DrivenApp) -> None:
    app.run("slot.path", "a", "on-load")
    app.settle()
    view, facts = app.session.view, app.frontend.facts()
    there = facts.frame.loads[view.slot_a]
    assert slot_note(view.slot_a, view, facts) == ""
    coming = replace(facts, frame=replace(facts.frame, loads={view.slot_a: replace(there, waiting=1_234_567)}))
    assert slot_note(view.slot_a, view, coming) == "compressing 1.2 Mtexel"
    assert "compressed, 0 waiting" in counts(facts)[f"texels of {view.slot_a.label}"]
    assert "compressed textures" in facts.memory[view.slot_a].parts
    app.click("Measure")
    app.settle()
    figures = app.session.inspection.measurements["a"]
    assert figures.compression_db is not None
    assert figures.load_rate is not None
    assert figures.load_rate > 0.0


@pytest.mark.parametrize(
    ("name", "widest", "shown"),
    [
        ("GlassPlasticMat", "PlasticMat", "Glass\nPlasticMat"),
        ("Rubber_WoodMat", "Rubber_W", "Rubber_\nWoodMat"),
        ("outer-normal.map", "normal.map", "outer-\nnormal.map"),
        ("hull normal map", "hull normal ", "hull normal \nmap"),
        ("short", "short", "short"),
        ("unbreakable", "unbr...ble", "unbr...ble"),
        ("Glass_unbreakable", "unbr...ble", "Glass_\nunbr...ble"),
    ],
)
def test_names_are_broken_between_words(app: DrivenApp, name: str, widest: str, shown: str) -> None:
    app.frame()
    assert two_lines(name, text_width(widest) + 0.5) == shown
