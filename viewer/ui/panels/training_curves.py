"""Curves of a training: loss by group, PSNR of the mean and of one texture."""

from collections.abc import Sequence

import numpy as np
from imgui_bundle import ImVec2, imgui, implot
from numpy.typing import NDArray

from ntc.codec.registry import codec_named
from viewer.training.run_log import Curves
from viewer.ui.facts import UiFrame
from viewer.ui.style.inks import ink
from viewer.ui.widgets import combo

PLOT_LINES = 8.5
"""Height of a plot, in lines of text."""
FIT = implot.AxisFlags_.auto_fit
MOST_NAMED = 6
"""Groups up to which the plot names them."""
WORST = "worst texture"


class TrainingCurves:
    """Two plots; remembers which texture is looked at."""

    def __init__(self) -> None:
        self._texture: int | None = None
        """None: the one that is worst now."""

    def draw(self, curves: Curves, names: Sequence[str], kind: str | None, ui: UiFrame) -> None:
        """The plots, each as wide as the panel; `names` of all textures of the pack, `kind` its codec, None if not known."""
        if len(curves.seconds) < 2:
            imgui.text_disabled("curves follow with the first steps")
            return
        seconds = curves.array(curves.seconds)
        flags = implot.Flags_.no_menus | implot.Flags_.no_box_select | implot.Flags_.no_mouse_text
        size = ImVec2(imgui.get_content_region_avail().x, PLOT_LINES * imgui.get_text_line_height_with_spacing())
        codec = codec_named(kind) if kind is not None else None
        # Where textures are encoded one after the other, no loss falls.
        if codec is None or codec.trains:
            self._losses(curves, seconds, size, flags, ui)
        texture = self._chosen(curves)
        if implot.begin_plot(
            f"{codec.psnr_title if codec is not None else 'PSNR'}##psnr", size, flags | implot.Flags_.no_legend
        ):
            implot.setup_axes("seconds", "dB", FIT, FIT)
            # Read on either theme's ground.
            mean = implot.Spec(line_color=imgui.get_style_color_vec4(imgui.Col_.text), line_weight=3.0)
            implot.plot_line("mean", seconds, curves.array(curves.mean_db), mean)
            if texture is not None:
                spec = implot.Spec(line_color=ink("a"), line_weight=1.5)
                implot.plot_line(_name(texture, names), seconds, curves.array(curves.psnr_db[texture]), spec)
            implot.end_plot()
        ui.rects.note("PSNR curve")
        imgui.text_wrapped("thick: the mean" + (f", blue: {_name(texture, names)}" if texture is not None else ""))
        self._choose(curves, names, ui)

    @staticmethod
    def _losses(curves: Curves, seconds: NDArray[np.float64], size: ImVec2, flags: int, ui: UiFrame) -> None:
        unnamed = implot.Flags_.no_legend if len(curves.losses) > MOST_NAMED else 0
        if implot.begin_plot("loss by group##loss", size, flags | unnamed):
            implot.setup_axes("seconds", "loss", FIT, FIT)
            # Beside the plot: the curves stay in sight.
            implot.setup_legend(implot.Location_.east, implot.LegendFlags_.outside)
            implot.setup_axis_scale(implot.ImAxis_.y1, implot.Scale_.log10)
            ticks = _ticks(curves)
            implot.setup_axis_ticks(implot.ImAxis_.y1, ticks, [f"{tick:.1g}" for tick in ticks])
            for group, curve in sorted(curves.losses.items()):
                implot.plot_line(f"{group}", seconds, curves.array(curve), implot.Spec(line_weight=1.5))
            implot.end_plot()
        ui.rects.note("loss by group")

    def _chosen(self, curves: Curves) -> int | None:
        if self._texture in curves.psnr_db:
            return self._texture
        now = {texture: curve[-1] for texture, curve in curves.psnr_db.items() if curve[-1] == curve[-1]}
        return min(now, key=lambda texture: now[texture]) if now else None

    def _choose(self, curves: Curves, names: Sequence[str], ui: UiFrame) -> None:
        choices = {WORST: None, **{_name(texture, names): texture for texture in sorted(curves.psnr_db)}}
        current = next((label for label, texture in choices.items() if texture == self._texture), WORST)
        imgui.set_next_item_width(-1)
        self._texture = choices[combo("curve of", current, tuple(choices), ui.rects)]


def _ticks(curves: Curves) -> list[float]:
    """1, 2 and 5 of each decade that losses fall into: on its own the plot labels whole decades only."""
    values = np.concatenate([curves.array(curve) for curve in curves.losses.values()])
    values = values[np.isfinite(values) & (values > 0.0)]
    if not len(values):
        return [1.0]
    decades = range(int(np.floor(np.log10(values.min()))), int(np.ceil(np.log10(values.max()))) + 1)
    ticks = [digit * 10.0**decade for decade in decades for digit in ((1, 2, 5) if len(decades) < 3 else (1,))]
    return [tick for tick in ticks if 0.5 * values.min() <= tick <= 2.0 * values.max()] or [float(values.max())]


def _name(texture: int, names: Sequence[str]) -> str:
    return f"{texture} {names[texture]}" if texture < len(names) else str(texture)
