"""Times of the last frames as areas on top of each other, one for each pass, under the line of the whole frame."""

import numpy as np
from imgui_bundle import ImVec2, imgui, implot
from numpy.typing import NDArray

from viewer.render.frame_history import FrameHistory
from viewer.ui.widgets import WidgetRects

PLOT_LINES = 9
"""Height, in lines of text."""


class TimingsPlot:
    """Remembers the sums that it draws until there is another frame."""

    def __init__(self) -> None:
        self._version = -1
        self._edges: list[tuple[str, NDArray[np.float64], NDArray[np.float64]]] = []
        self._frames = np.zeros(0)
        self._wall = np.zeros(0)
        self._top = 1.0

    def _update(self, history: FrameHistory) -> None:
        if history.version == self._version:
            return
        self._version = history.version
        self._wall = history.wall_ms
        self._frames = np.arange(len(self._wall), dtype=np.float64) - len(self._wall) + 1.0
        low = np.zeros(len(self._wall))
        self._edges = []
        for name, times in history.passes_ms.items():
            self._edges.append((name, low, low + times))
            low = low + times
        # The first frames compile shaders and take seconds: they must not flatten all the others.
        tops = np.maximum(self._wall, low)
        usual = float(np.percentile(tops, 95)) if len(tops) else 1.0
        self._top = max(1.15 * min(usual, 3.0 * float(np.median(tops)) if len(tops) else 1.0), 1.0)

    def color(self, name: str) -> imgui.ImVec4 | None:
        """Of the area of a pass; None for one that is not drawn."""
        names = [edge[0] for edge in self._edges]
        return implot.get_colormap_color(names.index(name)) if name in names else None

    def draw(self, history: FrameHistory, items: WidgetRects) -> None:
        """The plot, as wide as the panel."""
        self._update(history)
        if len(self._wall) < 2:
            imgui.text_disabled("times appear here while frames are drawn")
            return
        flags = implot.Flags_.no_menus | implot.Flags_.no_box_select | implot.Flags_.no_mouse_text
        # The table below tells which colour is which pass.
        flags |= implot.Flags_.no_legend
        height = PLOT_LINES * imgui.get_text_line_height_with_spacing()
        if implot.begin_plot("##times", ImVec2(-1, height), flags):
            implot.setup_axes("frames ago", "ms", implot.AxisFlags_.no_grid_lines, 0)
            implot.setup_axes_limits(float(self._frames[0]), 0.0, 0.0, self._top, implot.Cond_.always)
            for number, (name, low, high) in enumerate(self._edges):
                spec = implot.Spec(fill_color=implot.get_colormap_color(number))
                implot.plot_shaded(name, self._frames, low, high, spec)
            line = implot.Spec(line_color=imgui.get_style_color_vec4(imgui.Col_.text), line_weight=1.5)
            implot.plot_line("frame", self._frames, self._wall, line)
            implot.end_plot()
        items.note("times")
