"""Panel "Compare": sources of slots A and B, the mode of the comparison, and figures side by side."""

from imgui_bundle import ImVec2, imgui

from ntc.metrics.divergence import cut_percent
from viewer.inspect.costs import absent_formats, cost_bars
from viewer.inspect.measured_figures import figure_rows
from viewer.state.pack_files import source_label
from viewer.state.view_state import Side, Slot, is_image_source
from viewer.ui.controls import command_button, control, radio_buttons
from viewer.ui.facts import UiFrame
from viewer.ui.help.texts import FIGURES
from viewer.ui.widgets import (
    beside,
    box_width,
    decibels,
    disabled_beside,
    em,
    headings,
    list_width,
    named_cells,
    text_width,
    wrapped_disabled,
)

FIGURES_IN_A_ROW = 3
COPY_FIGURES = "Copy the figures to the clipboard, as a table in Markdown."
SAVE_FIGURES = "Save the figures as JSON, with the picture and a chart of the costs as PNGs."


def figures_state(ui: UiFrame) -> str:
    """Return a text about the figures: the view that they belong to, or the reason why there are none."""
    live = ui.facts.live
    if ui.session.view.slot_a == ui.session.view.slot_b:
        return "A and B are the same"
    if not ui.session.settings.live_figures:
        return "off"
    if live.computing:
        return "measuring"
    if ui.facts.is_training:
        return "not during training"
    if live.comparison is None:
        return live.problem or "waiting for the picture to rest"
    return "in this view" if live.is_current else "in an earlier view"


def draw_difference(ui: UiFrame) -> None:
    """Draw the kind of the difference and its gain."""
    difference = ui.session.view.difference
    control(ui, "compare.difference")
    beside(em(7.0))
    if difference.kind == "amplified":
        control(ui, "compare.gain")
        return
    texts = {"raw": "|A - B|, sRGB", "relative": "|A - B| / A, linear", "flip": "dark 0, bright 1"}
    imgui.text_disabled(texts[difference.kind])


def draw_live_figures(ui: UiFrame) -> None:
    """Draw PSNR, SSIM, FLIP, and the perceptual measures that are installed, of A against B."""
    control(ui, "compare.live", label="live figures", title="A against B")
    disabled_beside(figures_state(ui))
    ui.rects.note("figures state", "Which picture the figures below belong to, or why there are none.")
    live = ui.facts.live
    comparison = live.comparison
    texts = (
        ("PSNR", f"{decibels(comparison.psnr_db)} dB" if comparison and comparison.psnr_db is not None else "-"),
        ("SSIM", f"{comparison.ssim:.4f}" if comparison and comparison.ssim is not None else "-"),
        ("FLIP", f"{comparison.flip:.4f}" if comparison and comparison.flip is not None else "-"),
        *(
            (("SSIMULACRA2", f"{comparison.ssimulacra2:.1f}"),)
            if comparison and comparison.ssimulacra2 is not None
            else ()
        ),
        *((("JOD", f"{comparison.jod:.2f}"),) if comparison and comparison.jod is not None else ()),
    )
    if imgui.begin_table("live figures", 2 * FIGURES_IN_A_ROW, imgui.TableFlags_.sizing_stretch_prop):
        for name, text in texts:
            imgui.table_next_column()
            imgui.text_disabled(name)
            ui.rects.note(name, FIGURES[name])
            imgui.table_next_column()
            if live.is_current:
                imgui.text(text)
            else:
                imgui.text_disabled(text)
        imgui.end_table()
    ui.rects.note("live table", "A against B over the pixels that show the scene, in 8-bit sRGB.")
    if comparison is not None and comparison.problem:
        imgui.text_wrapped(comparison.problem)


def _slot(side: Side, slot: Slot, ui: UiFrame) -> None:
    letter = side.upper()
    imgui.align_text_to_frame_padding()
    imgui.text(letter)
    imgui.same_line()
    shown = "auto" if side in ui.session.precision_searches else slot.precision
    paths = list_width(slot.path), list_width(shown)
    left = imgui.get_cursor_pos_x()
    # All three lists share a row where they fit; otherwise the first one has a row alone.
    room = imgui.get_content_region_avail().x - sum(paths) - 2.0 * imgui.get_style().item_spacing.x
    fits = room >= list_width(slot.source) or is_image_source(slot.source)
    width = room if fits else -1.0
    control(ui, "slot.source", side, width=width, shown=lambda source: source_label(source, ui.session.packs))
    waits = ui.session.awaited_formats.get(side)
    if waits is not None:
        disabled_beside(f"{waits}: encoding {ui.facts.encoding.get(waits, 0.0):.0%}")
        ui.rects.note(
            f"{letter} encoding",
            "The textures are being encoded in this format. The slot shows it when all are done.",
        )
    elif not is_image_source(slot.source):
        if fits:
            imgui.same_line()
        else:
            imgui.set_cursor_pos_x(left)
        control(ui, "slot.path", side, width=paths[0])
        imgui.same_line()
        control(ui, "slot.precision", side, width=paths[1])


def _modes(ui: UiFrame) -> None:
    radio_buttons(ui, "compare.mode")
    disabled_beside("hold Space to swap")
    control(ui, "compare.toggle-flicker", label="flicker")
    imgui.same_line()
    control(ui, "compare.flicker", label="flicker rate")
    if ui.session.view.compare == "difference":
        draw_difference(ui)


DETAILS = ("Pixel", "Errors", "Histogram")
"""Panels that a check box of this panel opens."""


def _panels(ui: UiFrame) -> None:
    """Draw check boxes of the panels with details."""
    for number, title in enumerate(DETAILS):
        name = title.lower()
        if number:
            beside(box_width(name))
        control(ui, f"{name}.panel", label=f"show {name}", title=name)


def _filters(ui: UiFrame) -> None:
    width = em(5.0)
    control(ui, "filter.anisotropy", width=width)
    beside(text_width("anisotropic filter"))
    imgui.text("anisotropic filter")
    control(ui, "view.resolution", width=width, names=lambda share: f"{share:.0%}")
    imgui.same_line()
    imgui.text("resolution")
    beside(box_width("coarser while moving"))
    control(ui, "view.coarse-while-moving", label="coarser while moving")


def _overlay(ui: UiFrame) -> None:
    control(ui, "overlay.toggle", label="divergence")
    excess = [
        ui.facts.divergence[s.source].excess
        for s in (ui.session.view.slot_a, ui.session.view.slot_b)
        if s.source in ui.facts.divergence
    ]
    if len(excess) == 2:
        cut = cut_percent(*excess)
        disabled_beside("no excess in B" if cut is None else f"excess of A: {cut:.1f} % less than B")


def _figures(ui: UiFrame) -> None:
    command_button(ui, "Measure", "compare.measure")
    inspection = ui.session.inspection
    if not inspection.measurements:
        disabled_beside("PSNR, size, memory, time")
        return
    imgui.same_line()
    command_button(ui, "Copy", "compare.copy-figures", small=True, label="copy figures", tip=COPY_FIGURES)
    imgui.same_line()
    command_button(ui, "Save", "compare.save-figures", small=True, label="save figures", tip=SAVE_FIGURES)
    disabled_beside("in this view" if inspection.measured_view == ui.session.view else "in an earlier view")
    if not imgui.begin_table("figures", 3, imgui.TableFlags_.borders_inner_v | imgui.TableFlags_.sizing_stretch_prop):
        return
    for heading in ("", "A", "B"):
        imgui.table_setup_column(heading)
    headings({name: FIGURES[f"column {name}"] for name in ("figure", "A", "B")}, ui.rects)
    for name, values in figure_rows(inspection.measurements).items():
        imgui.table_next_row()
        named_cells(ui.rects, name, FIGURES[name], *values)
    imgui.end_table()
    imgui.begin_group()
    for kind, bars in cost_bars(inspection.measurements, ui.session.compressed).items():
        imgui.text_disabled(kind)
        for bar in bars:
            imgui.progress_bar(bar.share, ImVec2(-1, 0), f"{bar.source}  {bar.value:.2f}")
    for line in absent_formats():
        wrapped_disabled(line)
    imgui.end_group()
    ui.rects.note(
        "costs",
        "Costs of each source; the longest bar is the largest. PSNR is of the picture for A and B, of textures for other formats.",
    )


class ComparePanel:
    """Panel Compare. It scrolls to new measurements."""

    def __init__(self) -> None:
        self._seen: object = None

    def draw(self, ui: UiFrame) -> None:
        """Draw the content of the panel."""
        _draw_upper_part(ui)
        measured = ui.session.inspection.measured_view
        if measured is not self._seen:
            self._seen = measured
            imgui.set_scroll_here_y(0.0)
        _figures(ui)


def _draw_upper_part(ui: UiFrame) -> None:
    _slot("a", ui.session.view.slot_a, ui)
    _slot("b", ui.session.view.slot_b, ui)
    _modes(ui)
    imgui.separator()
    draw_live_figures(ui)
    _panels(ui)
    imgui.separator()
    _filters(ui)
    imgui.separator()
    _overlay(ui)
    imgui.separator()
