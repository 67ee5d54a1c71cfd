"""Keys and the mouse over the picture: the very next frame shows what they change."""

import pytest
from imgui_bundle import imgui

from tests.support.driven_app import DrivenApp


@pytest.fixture
def resting(app: DrivenApp) -> DrivenApp:
    app.run("compare.mode", "a")
    app.rest()
    return app


def shows_at_once(app: DrivenApp) -> bool:
    """True where the next frame shows another view, which is that of the session."""
    picture, before = app.frontend.picture, app.session.shown_view
    app.frame()
    return app.session.shown_view != before and not picture.due(app.session.window.picture_size)


@pytest.mark.parametrize("key", ["tab", "x", "o", "space", "d"])
def test_the_very_next_frame_shows_what_a_key_changes(resting: DrivenApp, key: str) -> None:
    imgui.get_io().add_key_event(getattr(imgui.Key, key), True)
    assert shows_at_once(resting)


def test_the_very_next_frame_shows_what_a_drag_changes(resting: DrivenApp) -> None:
    area = resting.frontend.interface.picture_area
    assert area is not None
    resting.move(*area.at(0.5, 0.5))
    resting.button(True)
    imgui.get_io().add_mouse_pos_event(*area.at(0.6, 0.5))
    assert shows_at_once(resting)
