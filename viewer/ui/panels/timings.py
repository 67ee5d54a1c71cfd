"""Panel "Timings": times of the steps of a frame, and counts of what was drawn and skipped."""

import numpy as np
from imgui_bundle import ImVec2, imgui, implot
from numpy.typing import NDArray

from viewer.inspect.frame_times import axis_top, beyond_text, frame_ticks
from viewer.render.frames import FrameHistory
from viewer.ui.controls import copy_button
from viewer.ui.facts import UiData, UiFrame

PLOT_LINES = 9
"""Height of the plot in lines of text."""
INPUT = "mouse, keyboard or script"
"""Reason of a frame that has no other reason."""


class TimingsPlot:
    """Plot of frame times, stacked by pass."""

    def __init__(self) -> None:
        self._version = -1
        self._edges: list[tuple[str, NDArray[np.float64], NDArray[np.float64]]] = []
        self._frames = np.zeros(0)
        self._wall = np.zeros(0)
        self._top = 1.0
        self._beyond = ""

    def _update(self, history: FrameHistory) -> None:
        if history.version == self._version:
            return
        self._version = history.version
        self._wall = history.wall_ms
        self._frames = np.arange(len(self._wall), dtype=np.float64) - len(self._wall) + 1.0
        low = np.zeros(len(self._wall))
        self._edges = []
        for name, times in history.passes_ms.items():
            self._edges.append((name.replace("_", " "), low, low + times))
            low = low + times
        tops = np.maximum(self._wall, low)
        self._top = axis_top(tops)
        self._beyond = beyond_text(tops, self._top)

    def color(self, name: str) -> imgui.ImVec4 | None:
        """Return the colour of a pass's area; None for a pass that is not drawn."""
        names = [edge[0] for edge in self._edges]
        return implot.get_colormap_color(names.index(name)) if name in names else None

    def draw(self, history: FrameHistory, ui: UiFrame) -> None:
        """Draw the plot, as wide as the panel."""
        self._update(history)
        if len(self._wall) < 2:
            imgui.text_disabled("Times appear while frames are drawn.")
            return
        flags = implot.Flags_.no_menus | implot.Flags_.no_box_select | implot.Flags_.no_mouse_text
        # The table below is the legend.
        flags |= implot.Flags_.no_legend
        height = PLOT_LINES * imgui.get_text_line_height_with_spacing()
        if implot.begin_plot("##times", ImVec2(-1, height), flags):
            implot.setup_axes("frames ago", "ms", implot.AxisFlags_.no_grid_lines, 0)
            implot.setup_axes_limits(float(self._frames[0]), 0.0, 0.0, self._top, implot.Cond_.always)
            ticks = frame_ticks(len(self._frames))
            implot.setup_axis_ticks(implot.ImAxis_.x1, [-float(tick) for tick in ticks], [str(tick) for tick in ticks])
            for number, (name, low, high) in enumerate(self._edges):
                spec = implot.Spec(fill_color=implot.get_colormap_color(number))
                implot.plot_shaded(name, self._frames, low, high, spec)
            line = implot.Spec(line_color=imgui.get_style_color_vec4(imgui.Col_.text), line_weight=1.5)
            implot.plot_line("frame", self._frames, self._wall, line)
            implot.end_plot()
        ui.rects.note("times", "Time of each frame in ms: areas are steps of drawing, the line is the whole frame.")
        if self._beyond:
            imgui.text_disabled(self._beyond)


def timings_text(facts: UiData) -> str:
    """Return all figures of the panel as text for the clipboard."""
    rows = [f"{name}: {figure}" for name, figure in (times(facts) | counts(facts)).items()]
    return "\n".join([facts.renderer, f"medians by {facts.frame.timer}", *rows])


def times(facts: UiData) -> dict[str, str]:
    """Return the times of the passes by name."""
    return {name.replace("_", " "): f"{milliseconds:.2f} ms" for name, milliseconds in facts.timings_ms.items()}


def counts(facts: UiData) -> dict[str, str]:
    """Return counts of the last frame by name, and the reason why it was drawn."""
    rows = {name: f"{count:,}" for name, count in facts.frame.drawn.items()}
    rows |= {f"{name.replace('_', ' ')} (skipped)": f"{count:,}" for name, count in facts.frame.skipped.items()}
    for slot, tiles in facts.frame.tiles.items():
        rows[f"tiles of {slot.label}"] = f"{tiles.resident:,} cached, {tiles.waiting:,} waiting"
        if tiles.starved:
            rows["tiles that do not fit"] = f"{tiles.starved:,}: raise tile_cache_megabytes in settings.json"
    for slot, loads in facts.frame.loads.items():
        rate = f"{loads.texels_per_second / 1e6:,.1f} Mtexel/s, {loads.bytes / 1e6:,.1f} MB"
        rows[f"texels of {slot.label}"] = f"{loads.texels:,} compressed, {loads.waiting:,} waiting: {rate}"
    rows |= {
        "calls that waited for the GPU": f"{facts.frame.blocking_calls:,}",
        "frames drawn": f"{facts.frames_drawn:,}",
    }
    return rows | {"reason of the last frame": ", ".join(facts.drawn_because) or INPUT}


def _mark(color: imgui.ImVec4, side: float) -> None:
    at = imgui.get_cursor_screen_pos()
    below = at.y + 0.2 * side
    draw = imgui.get_window_draw_list()
    draw.add_rect_filled(ImVec2(at.x, below), ImVec2(at.x + side, below + side), imgui.get_color_u32(color), 2.0)


def draw_timings_panel(ui: UiFrame, plot: TimingsPlot) -> None:
    """Draw the content of the panel."""
    imgui.text_wrapped(ui.facts.renderer)
    imgui.text_disabled(f"medians by {ui.facts.frame.timer}")
    imgui.same_line()
    copy_button(
        ui, "copy", "copy timings", "Copy all figures of this panel to the clipboard.", lambda: timings_text(ui.facts)
    )
    if ui.facts.history is not None:
        plot.draw(ui.facts.history, ui)
    if imgui.begin_table("timings", 2, imgui.TableFlags_.sizing_stretch_prop):
        for name, figure in (times(ui.facts) | counts(ui.facts)).items():
            imgui.table_next_row()
            imgui.table_next_column()
            side = 0.7 * imgui.get_font_size()
            color = plot.color(name)
            if color is not None:
                _mark(color, side)
            imgui.dummy(ImVec2(side, side))
            imgui.same_line()
            imgui.text_wrapped(name)
            imgui.table_next_column()
            imgui.text_wrapped(figure)
        imgui.end_table()
