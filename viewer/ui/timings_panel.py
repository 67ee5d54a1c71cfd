"""Panel "Timings": where the time of a frame goes, and what was left out."""

from imgui_bundle import ImVec2, imgui

from viewer.ui.facts import FrameFacts
from viewer.ui.timings_plot import TimingsPlot
from viewer.ui.widgets import WidgetRects


def timings_text(facts: FrameFacts) -> str:
    """All figures of the panel as text, to be copied."""
    lines = [facts.renderer, f"medians, {facts.timer}"]
    lines += [f"{name.replace('_', ' '):24} {milliseconds:9.2f} ms" for name, milliseconds in facts.timings_ms.items()]
    lines += [f"{count:>9,} {name.replace('_', ' ')}" for name, count in facts.drawn.items()]
    lines += [f"{count:>9,} {name.replace('_', ' ')} (skipped)" for name, count in facts.skipped.items()]
    return "\n".join([*lines, f"{facts.frames_drawn:>9,} frames drawn"])


def _mark(color: imgui.ImVec4, side: float) -> None:
    at = imgui.get_cursor_screen_pos()
    below = at.y + 0.2 * side
    draw = imgui.get_window_draw_list()
    draw.add_rect_filled(ImVec2(at.x, below), ImVec2(at.x + side, below + side), imgui.get_color_u32(color), 2.0)


def draw_timings_panel(facts: FrameFacts, plot: TimingsPlot, items: WidgetRects) -> None:
    """The content of the panel."""
    imgui.text_wrapped(facts.renderer)
    imgui.text_disabled(f"medians, {facts.timer}")
    imgui.same_line()
    if imgui.small_button("copy"):
        imgui.set_clipboard_text(timings_text(facts))
    items.note("copy timings")
    if facts.history is not None:
        plot.draw(facts.history, items)
    if imgui.begin_table("timings", 2, imgui.TableFlags_.sizing_stretch_prop):
        for name, milliseconds in facts.timings_ms.items():
            imgui.table_next_row()
            imgui.table_next_column()
            side = 0.7 * imgui.get_font_size()
            color = plot.color(name)
            if color is not None:
                _mark(color, side)
            imgui.dummy(ImVec2(side, side))
            imgui.same_line()
            imgui.text(name.replace("_", " "))
            imgui.table_next_column()
            imgui.text(f"{milliseconds:9.2f} ms")
        imgui.end_table()
    imgui.separator()
    for name, count in (*facts.drawn.items(), *facts.skipped.items()):
        imgui.text(f"{count:>9,} {name.replace('_', ' ')}" + ("" if name in facts.drawn else " (skipped)"))
    for slot, tiles in facts.tiles.items():
        imgui.text(f"{tiles.resident:>9,} tiles of {slot.source} kept, {tiles.waiting:,} to come")
        if tiles.starved:
            imgui.text_wrapped(f"{tiles.starved:,} tiles find no room: raise tile_cache_megabytes in settings.json")
    imgui.text(f"{facts.frames_drawn:>9,} frames drawn")
