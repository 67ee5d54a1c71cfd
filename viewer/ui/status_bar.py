"""The bar at the lower edge of the window: the last message."""

from imgui_bundle import ImVec2, imgui

from viewer.ui.facts import UiFrame

SIDE = 4.0
"""Window units, at normal scale, above and below the text."""


def status_bar_height() -> float:
    """In window units: one line of text, whatever it says."""
    style = imgui.get_style()
    return float(imgui.get_text_line_height() + 2.0 * SIDE * style.font_scale_main * style.font_scale_dpi)


def draw_status_bar(ui: UiFrame) -> float:
    """The bar, which takes its height from the viewport's work area from the next frame on; its height in window units."""
    height = status_bar_height()
    flags = (
        imgui.WindowFlags_.no_scrollbar
        | imgui.WindowFlags_.no_saved_settings
        | imgui.WindowFlags_.no_nav
        | imgui.WindowFlags_.no_focus_on_appearing
        | imgui.WindowFlags_.no_decoration
    )
    style = imgui.get_style()
    inset = (height - imgui.get_text_line_height()) / 2.0
    imgui.push_style_var(imgui.StyleVar_.window_padding, ImVec2(style.window_padding.x, inset))
    imgui.push_style_var(imgui.StyleVar_.window_min_size, ImVec2(1.0, 1.0))
    imgui.push_style_var(imgui.StyleVar_.window_rounding, 0.0)
    imgui.push_style_color(imgui.Col_.window_bg, style.color_(imgui.Col_.menu_bar_bg))
    # Known to ImGui as a side bar: panels are docked in what it leaves.
    opened = imgui.internal.begin_viewport_side_bar(
        "##status", imgui.get_main_viewport(), imgui.Dir.down, height, flags
    )
    imgui.pop_style_color()
    imgui.pop_style_var(3)
    if opened:
        log = ui.session.window.log
        imgui.text_disabled(log[-1].text if len(log) else "")
        ui.rects.note("status")
    imgui.end()
    return height
