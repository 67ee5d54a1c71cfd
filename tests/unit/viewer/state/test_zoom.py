"""The magnifying glass."""

import pytest

from viewer.state.view_state import LARGEST_ZOOM, WHOLE, Zoom


def test_the_whole_picture_is_where_it_is() -> None:
    assert WHOLE.is_whole
    assert WHOLE.window_to_image(0.3, 0.8) == pytest.approx((0.3, 0.8))


@pytest.mark.parametrize("at", [(0.0, 0.0), (0.2, 0.9), (1.0, 1.0), (0.5, 0.5)])
def test_what_is_under_the_mouse_stays_there(at: tuple[float, float]) -> None:
    zoom = WHOLE
    for _ in range(6):
        larger = zoom.towards(*at, 1.0)
        assert larger.factor > zoom.factor
        assert larger.window_to_image(*at) == pytest.approx(zoom.window_to_image(*at))
        zoom = larger
    for _ in range(9):
        zoom = zoom.towards(*at, -1.0)
    assert zoom.is_whole
    assert zoom.corner == pytest.approx((0.0, 0.0))


@pytest.mark.parametrize("centre", [(-1.0, 0.5), (0.0, 0.0), (1.0, 2.0), (0.4, 0.6)])
def test_what_is_shown_never_leaves_the_picture(centre: tuple[float, float]) -> None:
    zoom = Zoom(5.0, centre)
    for corner in ((0.0, 0.0), (1.0, 1.0)):
        assert all(-1e-9 <= value <= 1.0 + 1e-9 for value in zoom.window_to_image(*corner))


def test_image_to_window_is_the_inverse_of_window_to_image() -> None:
    zoom = Zoom(3.0, (0.3, 0.7))
    assert zoom.image_to_window(*zoom.window_to_image(0.1, 0.9)) == pytest.approx((0.1, 0.9))


def test_dragging_moves_the_picture_along() -> None:
    zoom = Zoom(4.0, (0.5, 0.5))
    before = zoom.window_to_image(0.5, 0.5)
    assert zoom.moved(0.1, -0.2).window_to_image(0.6, 0.3) == pytest.approx(before)


def test_there_is_a_largest_magnification() -> None:
    assert WHOLE.towards(0.5, 0.5, 1000.0).factor == LARGEST_ZOOM
