"""How panels and picture share the window: two thirds for the picture, and panels that fold."""

import re

import pytest
from imgui_bundle import imgui

from tests.support.driven_app import DrivenApp
from tests.ui.conftest import Opener


@pytest.fixture
def opener(open_window: Opener) -> Opener:
    """Opens a window's content at some size; its picture has few pixels, for nobody looks at it."""

    def opened(size: tuple[int, int]) -> DrivenApp:
        made = open_window(size, live_figures=False)
        made.session.resolution = 0.25
        made.settle()
        return made

    return opened


def share_of_picture(app: DrivenApp) -> float:
    area = app.frontend.interface.picture_area
    assert area is not None
    return area.width * area.height / (app.size[0] * app.size[1])


def labels(app: DrivenApp) -> tuple[str, ...]:
    return app.widgets.labels()


def test_the_column_folds_to_a_strip_and_comes_back_as_it_was(opener: Opener) -> None:
    app = opener((1280, 720))
    app.show_panel("Textures")
    app.show_panel("Memory")
    app.click("fold panels")
    assert "texture filter" not in labels(app)
    assert share_of_picture(app) > 0.9
    assert "menu: View" in labels(app)
    app.click("fold panels")
    assert {"texture filter", "copy memory"} <= set(labels(app))
    assert share_of_picture(app) >= 2 / 3
    app.run("window.column")
    app.show_panel("Groups")
    assert "Train group" in labels(app), "a panel that is asked for unfolds the column"


def test_a_narrow_window_opens_with_its_column_folded(opener: Opener) -> None:
    app = opener((780, 500))
    assert "A source" not in labels(app)
    assert share_of_picture(app) > 0.85
    assert app.session.present_settings.column_folded is None, "a wide window unfolds it"
    app.resize((1000, 600))
    app.settle()
    assert "A source" in labels(app)
    app.click("fold panels")
    app.resize((1280, 720))
    app.settle()
    assert "A source" not in labels(app), "what a person chose stays"
    assert app.session.present_settings.column_folded is True


def test_a_stack_folds_to_its_tabs_and_a_chosen_panel_unfolds_it(opener: Opener) -> None:
    app = opener((1280, 720))
    app.show_panel("Compare")
    before = app.widgets.centre("fold lower panels")
    app.click("fold lower panels")
    assert "tone map" not in labels(app)
    low = app.widgets.centre("fold lower panels")
    assert low[1] > 675, "only the tabs are left, above the status bar"
    assert app.session.present_settings.folded_panels
    app.click("fold lower panels")
    assert app.widgets.centre("fold lower panels") == pytest.approx(before, abs=2)
    app.click("fold lower panels")
    app.show_panel("Timings")
    assert "copy timings" in labels(app)
    assert app.widgets.centre("fold lower panels") == pytest.approx(before, abs=2)
    app.click("fold upper panels")
    assert "A source" not in labels(app)
    assert app.widgets.centre("fold lower panels")[1] < 80


def test_a_saved_layout_keeps_its_tabs_and_no_width_of_another_scale(
    opener: Opener, monkeypatch: pytest.MonkeyPatch
) -> None:
    app = opener((1280, 720))
    usual = app.frontend.interface.picture_area
    saved = imgui.save_ini_settings_to_memory()
    widened = re.sub(r"(ID=0x00000001 .*SizeRef=)\d+", r"\g<1>700", saved)
    assert widened != saved
    make = imgui.create_context

    def with_layout() -> object:
        context = make()
        imgui.load_ini_settings_from_memory(widened)
        return context

    monkeypatch.setattr(imgui, "create_context", with_layout)
    later = opener((1280, 720))
    later.frame(6)
    area = later.frontend.interface.picture_area
    assert {"A source", "sun height"} <= set(labels(later)), "Compare and Light are on top, as they were"
    assert usual is not None
    assert area is not None
    assert area.left == pytest.approx(usual.left, abs=30)
