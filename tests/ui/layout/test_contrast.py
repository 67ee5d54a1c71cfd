"""Text can be read in both themes: contrast of at least 4.5 to 1 (WCAG 2 AA) to every ground that it stands on."""

from collections.abc import Iterator
from typing import get_args

import pytest
from imgui_bundle import imgui

from viewer.state.settings import Theme
from viewer.ui.theme import INKS, Appearance

LEAST = 4.5
Rgb = tuple[float, float, float]
GROUNDS = [
    "window_bg",
    "popup_bg",
    "menu_bar_bg",
    "title_bg",
    "title_bg_active",
    "frame_bg",
    "frame_bg_hovered",
    "frame_bg_active",
    "button",
    "button_hovered",
    "button_active",
    "header",
    "header_hovered",
    "header_active",
    "tab",
    "tab_hovered",
    "tab_selected",
    "tab_dimmed",
    "tab_dimmed_selected",
    "table_header_bg",
    "table_row_bg",
    "table_row_bg_alt",
    "plot_histogram",
    "slider_grab",
    "slider_grab_active",
]
"""What labels stand on; texts of sliders stand on their grabs."""
QUIET_GROUNDS = ("window_bg", "popup_bg", "menu_bar_bg", "frame_bg", "table_row_bg", "table_row_bg_alt")
INK_GROUNDS = ("window_bg", "popup_bg", "table_row_bg", "table_row_bg_alt")


def luminance(color: Rgb) -> float:
    """Relative, 0 to 1, of sRGB values."""
    red, green, blue = (value / 12.92 if value <= 0.04045 else ((value + 0.055) / 1.055) ** 2.4 for value in color)
    return 0.2126 * red + 0.7152 * green + 0.0722 * blue


def contrast(first: Rgb, second: Rgb) -> float:
    high, low = sorted((luminance(first), luminance(second)), reverse=True)
    return (high + 0.05) / (low + 0.05)


def over(color: imgui.ImVec4, ground: Rgb, opacity: float = 1.0) -> Rgb:
    """A colour that may let its ground through."""
    share = color.w * opacity
    red, green, blue = (share * a + (1.0 - share) * b for a, b in zip((color.x, color.y, color.z), ground, strict=True))
    return red, green, blue


@pytest.fixture(params=get_args(Theme))
def theme(request: pytest.FixtureRequest) -> Iterator[Theme]:
    context = imgui.create_context()
    imgui.set_current_context(context)
    Appearance().apply(request.param, 1.0, 1.0)
    yield request.param
    imgui.destroy_context(context)


def style_color(name: str) -> imgui.ImVec4:
    return imgui.get_style().color_(getattr(imgui.Col_, name))


def ground(name: str) -> Rgb:
    """On an opaque panel."""
    panel = over(style_color("window_bg"), (0.0, 0.0, 0.0))
    return over(style_color(name), panel)


def test_labels_can_be_read(theme: Theme) -> None:
    found = {name: contrast(over(style_color("text"), ground(name)), ground(name)) for name in GROUNDS}
    assert {name: round(value, 2) for name, value in found.items() if value < LEAST} == {}


def test_faint_text_and_links_can_be_read(theme: Theme) -> None:
    found = {
        f"{text} on {name}": contrast(over(style_color(text), ground(name)), ground(name))
        for text in ("text_disabled", "text_link")
        for name in QUIET_GROUNDS
    }
    assert {name: round(value, 2) for name, value in found.items() if value < LEAST} == {}


def test_what_is_switched_off_can_be_read(theme: Theme) -> None:
    faded = imgui.get_style().disabled_alpha
    found = {}
    for name in ("window_bg", "popup_bg", "frame_bg", "button"):
        below = over(style_color(name), ground("window_bg"), 1.0 if name.endswith("_bg") else faded)
        found[name] = contrast(over(style_color("text"), below, faded), below)
    assert {name: round(value, 2) for name, value in found.items() if value < LEAST} == {}


def test_coloured_texts_and_curves_can_be_read(theme: Theme) -> None:
    found = {
        f"{name} on {below}": contrast(color[:3], ground(below))
        for name, color in INKS[theme].items()
        for below in INK_GROUNDS
    }
    assert {name: round(value, 2) for name, value in found.items() if value < LEAST} == {}


@pytest.mark.parametrize(("chosen", "other"), [("tab_selected", "tab"), ("tab_dimmed_selected", "tab_dimmed")])
def test_the_chosen_tab_is_marked(theme: Theme, chosen: str, other: str) -> None:
    assert contrast(ground(chosen), ground(other)) >= 1.5
    assert imgui.get_style().tab_bar_overline_size >= 2.0
