"""Colours and sizes of the panels: dark or light theme, at the scales of the monitor and the user."""

from collections.abc import Mapping
from pathlib import Path
from typing import Literal

import imgui_bundle
from imgui_bundle import ImVec2, icons_fontawesome_6, imgui

from viewer.state.settings import Theme

InkName = Literal["a", "b", "scene", "error", "good", "red", "green", "blue"]
Rgba = tuple[float, float, float, float]
INKS: Mapping[Theme, Mapping[InkName, Rgba]] = {
    "dark": {
        "a": (0.35, 0.65, 1.0, 1.0),
        "b": (1.0, 0.6, 0.25, 1.0),
        "scene": (0.62, 0.64, 0.67, 1.0),
        "error": (1.0, 0.5, 0.45, 1.0),
        "good": (0.3, 0.75, 0.4, 1.0),
        "red": (0.95, 0.42, 0.37, 1.0),
        "green": (0.4, 0.85, 0.4, 1.0),
        "blue": (0.45, 0.65, 1.0, 1.0),
    },
    "light": {
        "a": (0.06, 0.36, 0.72, 1.0),
        "b": (0.6, 0.27, 0.0, 1.0),
        "scene": (0.36, 0.38, 0.41, 1.0),
        "error": (0.7, 0.08, 0.04, 1.0),
        "good": (0.03, 0.42, 0.14, 1.0),
        "red": (0.72, 0.1, 0.08, 1.0),
        "green": (0.03, 0.42, 0.14, 1.0),
        "blue": (0.1, 0.3, 0.8, 1.0),
    },
}
"""Colours of texts and curves, in sRGB and opacity. Blue for A and orange for B differ for every kind of colour vision."""


def ink(name: InkName) -> imgui.ImVec4:
    """Return a colour of the current theme."""
    ground = imgui.get_style().color_(imgui.Col_.window_bg)
    theme: Theme = "light" if ground.x + ground.y + ground.z > 1.5 else "dark"
    return imgui.ImVec4(*INKS[theme][name])


def side_ink(side: str) -> imgui.ImVec4:
    """Return the colour of slot A ("a") or B."""
    return ink("a" if side == "a" else "b")


DARK_ACCENT = (0.26, 0.52, 0.86)
LIGHT_ACCENT = (0.16, 0.42, 0.78)
MARKED = {"dark": 0.6, "light": 0.52}
"""Opacity of the accent on the chosen tab."""


def _color(red: float, green: float, blue: float, alpha: float = 1.0) -> imgui.ImVec4:
    return imgui.ImVec4(red, green, blue, alpha)


def _blend(over: tuple[float, float, float], under: tuple[float, float, float], opacity: float) -> imgui.ImVec4:
    return _color(*(opacity * a + (1.0 - opacity) * b for a, b in zip(over, under, strict=True)))


def theme_colors(theme: Theme) -> dict[imgui.Col_, imgui.ImVec4]:
    """Return the colours of a theme that differ from ImGui's dark and light styles."""
    accent = DARK_ACCENT if theme == "dark" else LIGHT_ACCENT
    if theme == "dark":
        window, title, frame, tab = (0.085, 0.09, 0.1), (0.06, 0.065, 0.07), (0.17, 0.18, 0.2), (0.11, 0.12, 0.14)
    else:
        window, title, frame, tab = (0.95, 0.95, 0.96), (0.86, 0.87, 0.89), (1.0, 1.0, 1.0), (0.87, 0.88, 0.9)
    faint = (0.58, 0.6, 0.63) if theme == "dark" else (0.34, 0.36, 0.39)
    col = imgui.Col_
    return {
        col.window_bg: _color(*window),
        col.popup_bg: _color(*window),
        col.menu_bar_bg: _color(*title),
        col.title_bg: _color(*title),
        col.title_bg_active: _color(*title),
        col.title_bg_collapsed: _color(*title, 0.8),
        col.frame_bg: _color(*frame),
        col.frame_bg_hovered: _color(*accent, 0.35),
        col.frame_bg_active: _color(*accent, 0.5),
        col.check_mark: _color(*accent),
        col.plot_histogram: _color(*accent, 0.6),
        col.text_disabled: _color(*faint),
        col.slider_grab: _color(*accent, 0.8),
        col.slider_grab_active: _color(*accent, 0.85),
        col.button: _color(*accent, 0.3),
        col.button_hovered: _color(*accent, 0.55),
        col.button_active: _color(*accent, 0.75),
        col.header: _color(*accent, 0.35),
        col.header_hovered: _color(*accent, 0.5),
        col.header_active: _color(*accent, 0.65),
        col.tab: _color(*tab),
        col.tab_hovered: _color(*accent, 0.6),
        col.tab_selected: _blend(accent, window, MARKED[theme]),
        col.tab_selected_overline: _color(*accent),
        col.tab_dimmed: _color(*tab),
        col.tab_dimmed_selected: _blend(accent, window, 0.9 * MARKED[theme]),
        col.tab_dimmed_selected_overline: _color(*accent),
        col.text_link: imgui.ImVec4(*INKS[theme]["a"]),
        col.docking_preview: _color(*accent, 0.5),
        col.docking_empty_bg: _color(0.0, 0.0, 0.0, 0.0),
        col.modal_window_dim_bg: _color(0.0, 0.0, 0.0, 0.45),
    }


FONTS = Path(imgui_bundle.__file__).parent / "assets" / "fonts"
"""Folder of fonts that come with imgui-bundle."""
FONT = FONTS / "Roboto" / "Roboto-Regular.ttf"
"""Font for screens, with digits of equal width."""
ICONS = FONTS / "Font_Awesome_6_Free-Solid-900.otf"
FONT_SIZE, ICON_SIZE = 14.0, 12.0
"""Heights of text and icons in window units at normal scale."""
GRID = 4.0
"""Unit of paddings and gaps, in window units at normal scale."""
WARNING_ICON, ERROR_ICON = "triangle-exclamation", "circle-exclamation"


def load_font() -> None:
    """Load text and icon fonts into the current ImGui context. Without their files, ImGui's font is used, and there are no icons."""
    fonts, merged = imgui.get_io().fonts, imgui.ImFontConfig()
    if not FONT.is_file():
        return
    fonts.add_font_from_file_ttf(str(FONT), FONT_SIZE)
    # All icons are as wide as the widest, so that the texts behind them align.
    merged.merge_mode, merged.glyph_min_advance_x = True, 1.25 * FONT_SIZE
    if ICONS.is_file():
        fonts.add_font_from_file_ttf(str(ICONS), ICON_SIZE, merged)


def icon(name: str) -> str:
    """Return the character of a Font Awesome icon by its name, such as `folder-open`; "" for no name, or without the font."""
    known = name and FONT.is_file() and ICONS.is_file()
    return str(getattr(icons_fontawesome_6, f"ICON_FA_{name.replace('-', '_').upper()}")) if known else ""


def with_icon(name: str, text: str) -> str:
    """Return a text with an icon before it; without an icon, the text."""
    return f"{icon(name)} {text}".lstrip()


class Appearance:
    """Theme and scale of ImGui's style."""

    def __init__(self) -> None:
        self._applied: tuple[Theme, float, float] | None = None

    def apply(self, theme: Theme, ui_scale: float, monitor_scale: float) -> None:
        """Apply theme and scale, between two frames. `monitor_scale`: pixels of the monitor per window unit, at least 1."""
        wanted = (theme, ui_scale, monitor_scale)
        if wanted == self._applied:
            return
        self._applied = wanted
        style, fresh = imgui.get_style(), imgui.Style()
        fresh.frame_rounding = fresh.grab_rounding = fresh.popup_rounding = 3.0
        fresh.window_rounding, fresh.tab_rounding, fresh.frame_border_size = 4.0, 3.0, float(theme == "light")
        fresh.window_padding, fresh.item_spacing = ImVec2(2.0 * GRID, 2.0 * GRID), ImVec2(2.0 * GRID, GRID)
        fresh.item_inner_spacing, fresh.cell_padding = ImVec2(GRID, GRID), ImVec2(GRID, 0.5 * GRID)
        # A row is five grid units high, six with the gap below it.
        fresh.frame_padding = ImVec2(GRID, 0.5 * (5.0 * GRID - FONT_SIZE))
        fresh.indent_spacing, fresh.scrollbar_size, fresh.grab_min_size = 5.0 * GRID, 3.0 * GRID, 3.0 * GRID
        fresh.window_menu_button_position = imgui.Dir.none
        fresh.docking_node_has_close_button = False
        fresh.tab_bar_overline_size = 2.0
        # A folded stack is as high as its tabs.
        fresh.window_min_size = ImVec2(32.0, 16.0)
        fresh.scale_all_sizes(ui_scale * monitor_scale)
        # Sizes come from a fresh style each time, because scaling back is not exact.
        for name in dir(fresh):
            value = getattr(fresh, name)
            if not name.startswith("_") and (type(value) in (bool, int, float, ImVec2) or isinstance(value, imgui.Dir)):
                setattr(style, name, value)
        style.font_scale_main, style.font_scale_dpi = ui_scale, monitor_scale
        if theme == "light":
            imgui.style_colors_light(style)
        else:
            imgui.style_colors_dark(style)
        for number, color in theme_colors(theme).items():
            style.set_color_(number, color)
