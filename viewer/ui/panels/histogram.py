"""Panel "Histogram": number of covered pixels by the difference between A and B."""

import numpy as np
from imgui_bundle import ImVec2, imgui, implot
from numpy.typing import NDArray

from viewer.inspect.comparison import Comparison
from viewer.ui.facts import UiFrame
from viewer.ui.theme import InkName, ink
from viewer.ui.widgets import wrapped_disabled

CHANNELS: tuple[InkName, ...] = ("red", "green", "blue")


class HistogramPanel:
    """Panel Histogram, with the curves of the last comparison."""

    def __init__(self) -> None:
        self._of: Comparison | None = None
        self._curves: tuple[NDArray[np.float64], ...] = ()
        self._last = 8

    def _update(self, comparison: Comparison) -> None:
        if comparison is self._of:
            return
        # Counts of zero are left out, because the axis is logarithmic.
        self._curves = tuple(np.where(counts > 0, counts, np.nan).astype(np.float64) for counts in comparison.histogram)
        occurring = np.nonzero(comparison.histogram.sum(axis=0))[0]
        self._last = max(8, int(occurring[-1]) + 1) if len(occurring) else 8
        self._of = comparison

    def draw(self, ui: UiFrame) -> None:
        """Draw the content of the panel."""
        comparison = ui.facts.live.comparison
        if comparison is None or comparison.pixels == 0:
            imgui.text_disabled("The histogram appears when the picture rests and A and B differ.")
            return
        self._update(comparison)
        wrapped_disabled("pixels by |A - B| in steps of 8-bit sRGB")
        flags = implot.Flags_.no_menus | implot.Flags_.no_box_select | implot.Flags_.no_mouse_text
        if implot.begin_plot("##histogram", ImVec2(-1, max(60.0, imgui.get_content_region_avail().y)), flags):
            implot.setup_axes("", "pixels")
            implot.setup_legend(implot.Location_.north_east, implot.LegendFlags_.horizontal)
            implot.setup_axis_scale(implot.ImAxis_.y1, implot.Scale_.log10)
            implot.setup_axes_limits(-0.5, self._last + 0.5, 0.5, 2.0 * comparison.pixels, implot.Cond_.always)
            steps = np.arange(len(self._curves[0]), dtype=np.float64)
            for name, counts in zip(CHANNELS, self._curves, strict=True):
                spec = implot.Spec(line_color=ink(name), line_weight=1.5)
                implot.plot_stairs(name, steps - 0.5, counts, spec)
            implot.end_plot()
        ui.rects.note(
            "histogram",
            "Number of pixels by the difference between A and B, in red, green and blue. Across: steps of 8-bit sRGB. Up: pixels, "
            "logarithmic.",
        )
