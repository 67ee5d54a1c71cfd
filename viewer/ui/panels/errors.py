"""Panel "Errors": textures or decoders by the difference between A and B, worst first. A click shows where they are."""

from imgui_bundle import imgui

from viewer.commands.inspection import LARGEST_IS_WORST
from viewer.inspect.comparison import ErrorRow
from viewer.inspect.error_table import sorted_rows
from viewer.state.session import ErrorColumn, ErrorsBy
from viewer.state.view_state import OverlayKind
from viewer.ui.controls import command_button
from viewer.ui.facts import UiFrame
from viewer.ui.panels.compare import figures_state
from viewer.ui.widgets import beside, box_width, cells, decibels, text_width

ROWS_SHOWN = 200
HEADINGS: tuple[tuple[ErrorColumn, str, str], ...] = (
    ("name", "texture", "Name of the texture, or number of the decoder."),
    ("decoder", "dec.", "Number of the decoder of the texture."),
    ("pixels", "pixels", "Number of pixels that show the texture or decoder."),
    ("psnr", "PSNR", "PSNR in dB of A against B over the pixels of the texture or decoder: higher is better."),
    ("mean", "mean", "Mean of |A - B| over the pixels of the texture or decoder, in steps of 8-bit sRGB."),
    ("max", "max", "Largest |A - B| of the pixels of the texture or decoder, in steps of 8-bit sRGB."),
)
"""Columns with their headings and tooltips."""
BY: dict[ErrorsBy, str] = {
    "texture": "One row for each visible texture.",
    "decoder": "One row for each visible decoder, with all its textures.",
}
"""Subjects of rows with their tooltips."""
HIGHLIGHT: dict[ErrorsBy, str] = {
    "texture": "Click: dim everything except this texture. Click again: show everything.",
    "decoder": "Click: dim everything except this decoder's textures. Click again: show everything.",
}
WIDEST: dict[ErrorColumn, str] = {"decoder": "-", "pixels": "999,999", "psnr": "99.99", "mean": "99.99", "max": "255"}
"""Widest usual texts, which set the widths of columns."""


def _choices(ui: UiFrame) -> None:
    for by, tip in BY.items():
        if imgui.radio_button(f"by {by}", ui.session.inspection.errors.by == by):
            ui.emit("errors.by", by)
        ui.rects.note(f"errors by {by}", tip)
        beside(box_width("in the picture") if by == "decoder" else box_width("by decoder"))
    overlay = ui.session.view.overlay
    kind: OverlayKind = "error-texture" if ui.session.inspection.errors.by == "texture" else "error-decoder"
    changed, shown = imgui.checkbox("in the picture", overlay.kind in ("error-texture", "error-decoder"))
    ui.rects.note("errors in the picture", "Colour every pixel by the error of its texture or decoder.")
    if changed:
        ui.emit("overlay.kind", kind if shown else "none")
    elif overlay.kind in ("error-texture", "error-decoder") and overlay.kind != kind:
        ui.emit("overlay.kind", kind)


def _headings(ui: UiFrame) -> None:
    table = ui.session.inspection.errors
    imgui.table_next_row(imgui.TableRowFlags_.headers)
    for column, text, tip in HEADINGS:
        imgui.table_next_column()
        is_key = column == table.column
        arrow = (" v" if table.descending else " ^") if is_key else ""
        title = "decoder" if column == "name" and table.by == "decoder" else text
        if imgui.selectable(f"{title}{arrow}##{column}", False)[0]:
            worst_first = table.descending == (column in LARGEST_IS_WORST)
            ui.emit("errors.sort", column, "best" if is_key and worst_first else "worst")
        ui.rects.note(f"sort by {column}", f"{tip} Click to sort.")


def _row(name: str, row: ErrorRow, ui: UiFrame) -> None:
    by = ui.session.inspection.errors.by
    decoder = ui.session.inspection.errors.highlighted_decoder
    lit = decoder == row.number if by == "decoder" else decoder is None and ui.session.view.highlight == (row.number,)
    imgui.table_next_row()
    imgui.table_next_column()
    flags = imgui.SelectableFlags_.span_all_columns
    if imgui.selectable(f"{name}##{row.number}", lit, flags)[0]:
        ui.emit("errors.highlight", by, row.number)
    ui.rects.note(f"error {by} {row.number}", f"{name}\n{HIGHLIGHT[by]}")
    cells(
        str(row.decoder) if row.decoder >= 0 else "-",
        f"{row.pixels:,}",
        decibels(row.psnr_db),
        f"{row.mean:.2f}",
        str(row.largest),
    )


def draw_errors_panel(ui: UiFrame) -> None:
    """Draw the content of the panel."""
    _choices(ui)
    imgui.text_disabled(figures_state(ui))
    if ui.session.view.highlight:
        imgui.same_line()
        command_button(ui, "end highlight", "errors.clear", tip="Show everything undimmed again.", small=True)
    rows = sorted_rows(ui.session, ui.facts.live.comparison)
    if not rows:
        return
    flags = imgui.TableFlags_.row_bg | imgui.TableFlags_.scroll_y | imgui.TableFlags_.borders_inner_v
    if imgui.begin_table("errors", len(HEADINGS), flags):
        imgui.table_setup_scroll_freeze(0, 1)
        for column, text, _ in HEADINGS:
            if column == "name":
                imgui.table_setup_column(text, imgui.TableColumnFlags_.width_stretch)
                continue
            sorts = column == ui.session.inspection.errors.column
            width = max(text_width(f"{text}{' v' * sorts}"), text_width(WIDEST[column]))
            imgui.table_setup_column(text, imgui.TableColumnFlags_.width_fixed, width)
        _headings(ui)
        for name, row in rows[:ROWS_SHOWN]:
            _row(name, row, ui)
        if len(rows) > ROWS_SHOWN:
            imgui.table_next_row()
            imgui.table_next_column()
            imgui.text_disabled(f"and {len(rows) - ROWS_SHOWN} more")
        imgui.end_table()
    ui.rects.note("errors table", "Visible textures or decoders, by the difference between A and B.")
