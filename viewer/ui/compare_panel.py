"""Panel "Compare": what slots A and B show, how they are shown, and their figures side by side."""

from typing import get_args

from imgui_bundle import imgui

from ntc.codec.precision import PrecisionChoice
from ntc.metrics.divergence import cut_percent
from viewer.commands.window import OPENED_ON_REQUEST
from viewer.state.session import Session
from viewer.state.settings import ANISOTROPIES
from viewer.state.view_state import REFERENCE, CompareMode, PathChoice, Side, Slot
from viewer.ui.facts import Emit, FrameFacts
from viewer.ui.live_figures_section import draw_difference, draw_flicker, draw_live_figures
from viewer.ui.widgets import WidgetRects, combo

MODES: tuple[tuple[CompareMode, str], ...] = (
    ("a", "A"),
    ("b", "B"),
    ("wipe", "Wipe"),
    ("wipe-horizontal", "Wipe across"),
    ("side-by-side", "Side by side"),
    ("difference", "Difference"),
)
MODES_A_ROW = 4
RESOLUTIONS = (1.0, 0.5, 0.25)


def _slot(side: Side, slot: Slot, session: Session, emit: Emit, items: WidgetRects) -> None:
    letter = side.upper()
    imgui.align_text_to_frame_padding()
    imgui.text(letter)
    imgui.same_line()
    # Three lists in one row, in a narrow panel narrower.
    room = imgui.get_content_region_avail().x - 2.0 * imgui.get_style().item_spacing.x
    imgui.set_next_item_width(0.46 * room)
    source = combo(f"{letter} source", slot.source, session.sources, items)
    if source != slot.source:
        emit("slot.source", side, source)
    if slot.source != REFERENCE:
        imgui.same_line()
        imgui.set_next_item_width(0.3 * room)
        path = combo(f"{letter} path", slot.path, get_args(PathChoice), items)
        imgui.same_line()
        imgui.set_next_item_width(0.24 * room)
        shown = "auto" if side in session.requests.precision else slot.precision
        precision = combo(f"{letter} precision", shown, get_args(PrecisionChoice), items)
        if precision != shown:
            emit("slot.precision", side, precision)
        if path != slot.path:
            emit("slot.path", side, path)


def _modes(session: Session, emit: Emit, items: WidgetRects) -> None:
    for number, (mode, label) in enumerate(MODES):
        if number % MODES_A_ROW:
            imgui.same_line()
        if imgui.radio_button(label, session.view.compare == mode):
            emit("compare.mode", mode)
        items.note(label)
    imgui.same_line()
    imgui.text_disabled("Space: the other")
    draw_flicker(session, emit, items)
    if session.view.compare == "difference":
        draw_difference(session, emit, items)


def _panels(session: Session, emit: Emit, items: WidgetRects) -> None:
    """Which panels say more."""
    for number, title in enumerate(OPENED_ON_REQUEST):
        name = title.lower()
        if number:
            imgui.same_line()
        if imgui.checkbox(name, title in session.window.open_panels)[0]:
            emit(f"{name}.panel")
        items.note(f"show {name}")


def _filters(session: Session, emit: Emit, items: WidgetRects) -> None:
    imgui.set_next_item_width(5.0 * imgui.get_font_size())
    chosen = combo("anisotropy", str(session.view.anisotropy), tuple(str(value) for value in ANISOTROPIES), items)
    if int(chosen) != session.view.anisotropy:
        emit("filter.anisotropy", int(chosen))
    imgui.same_line()
    imgui.text("anisotropy: reference, cached")
    imgui.set_next_item_width(5.0 * imgui.get_font_size())
    share = combo("resolution", f"{session.resolution:.0%}", tuple(f"{value:.0%}" for value in RESOLUTIONS), items)
    if share != f"{session.resolution:.0%}":
        emit("view.resolution", float(share.rstrip("%")) / 100.0)
    imgui.same_line()
    imgui.text("resolution")
    imgui.same_line()
    changed, coarse = imgui.checkbox("coarser while moving", session.settings.coarse_while_moving)
    items.note("coarser while moving")
    if changed:
        emit("view.coarse-while-moving", coarse)


def _overlay(session: Session, facts: FrameFacts, emit: Emit, items: WidgetRects) -> None:
    if imgui.checkbox("divergence", session.view.overlay.kind == "divergence")[0]:
        emit("overlay.toggle")
    items.note("divergence")
    excess = [
        facts.divergence[s.source].excess
        for s in (session.view.slot_a, session.view.slot_b)
        if s.source in facts.divergence
    ]
    if len(excess) == 2:
        cut = cut_percent(*excess)
        imgui.same_line()
        imgui.text_disabled("nothing to cut" if cut is None else f"A cuts B's excess by {cut:.1f} %")


def _figures(session: Session, facts: FrameFacts, emit: Emit, items: WidgetRects) -> None:
    if imgui.button("Measure"):
        emit("compare.measure")
    items.note("Measure")
    imgui.same_line()
    if not session.inspection.measurements:
        imgui.text_disabled("PSNR, divergence, memory of this view")
        return
    imgui.text_disabled(
        "this view" if session.inspection.measured_view == session.view else "an earlier view: measure again"
    )
    if not imgui.begin_table("figures", 3, imgui.TableFlags_.borders_inner_v | imgui.TableFlags_.sizing_stretch_prop):
        return
    for heading in ("", "A", "B"):
        imgui.table_setup_column(heading)
    imgui.table_headers_row()
    rows: dict[str, list[str]] = {
        name: [] for name in ("shows", "PSNR dB", "divergence score", "excess", "path", "GPU MB", "decode ms")
    }
    for side, slot in session.view.slots.items():
        figure = session.inspection.measurements.get(side)
        rows["shows"].append(figure.source if figure else "-")
        rows["PSNR dB"].append(f"{figure.psnr_db:.2f}" if figure and figure.psnr_db is not None else "-")
        divergence = figure.divergence if figure else None
        rows["divergence score"].append(f"{divergence.score:.4f}" if divergence else "-")
        rows["excess"].append(str(divergence.excess) if divergence else "-")
        rows["path"].append("-" if slot.source == REFERENCE else facts.paths.get(slot, slot.path))
        rows["GPU MB"].append(f"{figure.gpu_bytes / 1e6:.2f}" if figure and figure.gpu_bytes else "-")
        rows["decode ms"].append(f"{facts.slot_ms[slot]:.2f}" if slot in facts.slot_ms else "-")
    for name, values in rows.items():
        imgui.table_next_row()
        for text in (name, *values):
            imgui.table_next_column()
            imgui.text(text)
    imgui.end_table()


def draw_compare_panel(session: Session, facts: FrameFacts, emit: Emit, items: WidgetRects) -> None:
    """The content of the panel."""
    _slot("a", session.view.slot_a, session, emit, items)
    _slot("b", session.view.slot_b, session, emit, items)
    _modes(session, emit, items)
    imgui.separator()
    draw_live_figures(session, facts, emit, items)
    _panels(session, emit, items)
    imgui.separator()
    _filters(session, emit, items)
    imgui.separator()
    _overlay(session, facts, emit, items)
    imgui.separator()
    _figures(session, facts, emit, items)
