"""Rate curve of one texture: PSNR by bits per texel. A drag over the curve encodes the texture again with other bits."""

import math

import numpy as np
from imgui_bundle import ImVec2, imgui, implot

from ntc.codec.model import EncodedTexture, Pack
from ntc.codec.registry import codec_of
from viewer.inspect.texture_table import TextureRow
from viewer.training.rates import RateCurve, point_text, size_text
from viewer.ui.facts import UiFrame
from viewer.ui.panels.encode_form import Field
from viewer.ui.theme import ink
from viewer.ui.widgets import wrapped_disabled

PLOT_LINES = 7.0
"""Height of the plot in lines of text."""
OTHER_LINES = 4.0
LARGEST_SHARE = 0.66
"""Largest height of the view, as a share of the panel's."""
DRAWN_POINTS = 60
ENOUGH_POINTS = 3
"""Number of measured points below which an answer is called `about`."""
AXIS_ENDS = (0.5, 24.0)
"""Range of bits per texel of the axis."""
TICKS = (0.5, 1.0, 2.0, 4.0, 8.0, 16.0)


class RateView:
    """Rate curve of the selected texture."""

    def __init__(self) -> None:
        self._quality = Field("asked quality")
        self._asked_db = "40"
        self._dragged: float | None = None
        """Bits per texel under the mouse during a drag over the curve; None without a drag."""

    @staticmethod
    def height(room: float) -> float:
        """Return the height of the view in a panel of height `room`, in window units."""
        lines = (PLOT_LINES + OTHER_LINES) * imgui.get_text_line_height_with_spacing()
        return float(min(lines, LARGEST_SHARE * room))

    def draw(self, row: TextureRow, ui: UiFrame) -> None:
        """Draw the curve of a texture of the scene."""
        rates, source = ui.training.rates, ui.session.view.slot_a.source
        pack, match = ui.session.packs.get(source), ui.facts.matches.get(source)
        index = match.texture_index[row.texture_id] if pack is not None and match is not None else -1
        encoded = pack.textures[index] if pack is not None and index >= 0 else None
        curve = rates.curve(row.texture_id)
        if curve is None:
            self._missing(row, ui)
            return
        curve = curve.of_latents()
        is_whole = encoded is not None and (encoded.width, encoded.height) == (row.width, row.height)
        if is_whole and row.bits_per_texel and row.psnr_db is not None and math.isfinite(row.psnr_db):
            curve = curve.through(row.bits_per_texel, row.psnr_db)
        self._draw_question(curve, ui)
        reach = _reach(pack, encoded) if is_whole else None
        self._draw_plot(curve, row, reach, index if is_whole else -1, ui)
        reason = _why_not(pack, encoded, ui)
        if encoded is not None and not is_whole:
            reason = (
                f"The pack holds {encoded.width} x {encoded.height} texels; the curve is of {row.width} x {row.height}."
            )
        if self._dragged is not None:
            imgui.text(point_text(curve, self._dragged))
        elif rates.is_busy:
            imgui.text_disabled("measuring further points ...")
        else:
            wrapped_disabled(reason or "Drag to a bitrate to encode the texture again with it.")
        ui.rects.note("rate text", "What the bitrate under the mouse gives.")

    @staticmethod
    def _missing(row: TextureRow, ui: UiFrame) -> None:
        rates = ui.training.rates
        if problem := rates.problem(row.texture_id):
            imgui.text_wrapped(problem)
        elif ui.training.active is not None:
            wrapped_disabled("The curve is measured when the training has ended.")
        elif rates.is_busy:
            wrapped_disabled("measuring PSNR at several bitrates ...")
        elif imgui.small_button("Measure PSNR at several bitrates"):
            ui.emit("training.measure-rates", str(row.texture_id))
        ui.rects.note("rate text", "What the bitrate under the mouse gives.")

    def _draw_question(self, curve: RateCurve, ui: UiFrame) -> None:
        """Draw a field for a quality in dB, and the bits that it needs."""
        imgui.align_text_to_frame_padding()
        imgui.text("for")
        imgui.same_line()
        typed = self._quality.draw(self._asked_db, ui)
        self._asked_db = typed if typed is not None else self._asked_db
        imgui.same_line()
        try:
            bits = curve.bits_at(min(max(float(self._asked_db), 1.0), 80.0))
            # A curve through few points is inexact.
            about = "about " if len(curve.points) < ENOUGH_POINTS else ""
            answer = f"dB: {about}{bits:.1f} bits, {size_text(curve.megabytes(bits))}"
        except ValueError:
            answer = "dB: type a number"
        imgui.text(answer)
        ui.rects.note("rate answer", answer)

    def _draw_plot(
        self, curve: RateCurve, row: TextureRow, reach: tuple[float, float] | None, index: int, ui: UiFrame
    ) -> None:
        flags = implot.Flags_.no_menus | implot.Flags_.no_box_select | implot.Flags_.no_mouse_text
        flags |= implot.Flags_.no_legend
        size = ImVec2(imgui.get_content_region_avail().x, PLOT_LINES * imgui.get_text_line_height_with_spacing())
        if not implot.begin_plot("##rate", size, flags):
            return
        bits = np.geomspace(*AXIS_ENDS, DRAWN_POINTS)
        decibels = np.array([curve.psnr_at(each) for each in bits])
        implot.setup_axes("bits per texel", "dB", implot.AxisFlags_.lock, implot.AxisFlags_.lock)
        implot.setup_axis_scale(implot.ImAxis_.x1, implot.Scale_.log10)
        implot.setup_axis_ticks(implot.ImAxis_.x1, list(TICKS), [f"{tick:g}" for tick in TICKS])
        ends = (float(decibels.min()) - 1.0, float(decibels.max()) + 1.0)
        implot.setup_axes_limits(*AXIS_ENDS, *ends, implot.Cond_.always)
        text = imgui.get_style_color_vec4(imgui.Col_.text)
        faint = imgui.get_style_color_vec4(imgui.Col_.text_disabled)
        implot.plot_line("curve", bits, decibels, implot.Spec(line_color=faint, line_weight=1.5))
        if reach is not None:
            within = (bits >= reach[0]) & (bits <= reach[1])
            if within.any():
                spec = implot.Spec(line_color=text, line_weight=3.0)
                implot.plot_line("reach", bits[within], decibels[within], spec)
        if index >= 0 and row.bits_per_texel and row.psnr_db is not None:
            here = np.array([row.bits_per_texel]), np.array([row.psnr_db])
            implot.plot_scatter(
                "now", *here, implot.Spec(marker=implot.Marker_.circle, marker_size=5.0, marker_fill_color=ink("a"))
            )
        self._follow_mouse(reach, index, ui)
        if self._dragged is not None:
            spec = implot.Spec(line_color=ink("a"), line_weight=1.5)
            implot.plot_inf_lines("dragged", np.array([self._dragged]), spec)
        implot.end_plot()
        ui.rects.note(
            "rate curve",
            "PSNR of mip 0 in dB by bits per texel, measured on parts of the texture. The dot is the pack in slot A; "
            "its codes can hold the bitrates of the thick part. Drag to a bitrate to encode the texture again.",
        )

    def _follow_mouse(self, reach: tuple[float, float] | None, index: int, ui: UiFrame) -> None:
        """Follow a drag over the plot. At its end the texture is encoded again with the bits under the mouse."""
        hovered, down = implot.is_plot_hovered(), imgui.is_mouse_down(imgui.MouseButton_.left)
        if (hovered and imgui.is_mouse_clicked(imgui.MouseButton_.left)) or (self._dragged is not None and down):
            low, high = reach or AXIS_ENDS
            self._dragged = min(max(float(implot.get_plot_mouse_pos().x), low), high)
        elif self._dragged is not None:
            bits, self._dragged = self._dragged, None
            if reach is not None and not ui.why_not("training.anew"):
                ui.emit("training.anew", str(index), round(bits, 2))


def _reach(pack: Pack | None, encoded: EncodedTexture | None) -> tuple[float, float] | None:
    """Return the range of bits per texel that a texture's codes can have in its pack; None where it cannot be encoded alone."""
    if pack is None or encoded is None:
        return None
    return codec_of(pack.config).texture_bits(pack.config, (encoded.width, encoded.height))


def _why_not(pack: Pack | None, encoded: EncodedTexture | None, ui: UiFrame) -> str:
    """Return the reason why the texture cannot be encoded again; "" where it can."""
    if pack is None:
        return "Show a pack in slot A to encode this texture again."
    if encoded is None:
        return "The pack in slot A does not hold this texture."
    reason = ui.why_not("training.anew")
    return f"It cannot be encoded again: {reason}." if reason else ""
