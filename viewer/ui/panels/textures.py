"""Panel "Textures": table of all textures of the scene, with filter and sorting."""

from imgui_bundle import ImVec2, imgui

from ntc.codec.maps import MAPS
from viewer.inspect.texture_table import (
    COLUMNS,
    TextureColumn,
    TextureRow,
    compressed_rows,
    filtered,
    ordered,
    texture_rows,
    with_error_shares,
)
from viewer.state.pack_files import pack_figures
from viewer.ui.controls import select_texture
from viewer.ui.facts import UiFrame
from viewer.ui.help.texts import FIGURES
from viewer.ui.panels.rate_view import RateView
from viewer.ui.widgets import decibels, em, headings, sort_order, two_lines

THUMBNAIL_LINES = 1.9
"""Side of a thumbnail in lines of text."""
HIDDEN_AT_FIRST = frozenset(COLUMNS) - {"name", "mip 0 dB", "bits", "normals", "error %"}
WIDTHS: dict[TextureColumn, float] = {
    "name": 3.4,
    "size": 5.6,
    "category": 5.5,
    "group": 3.0,
    "mip 0 dB": 4.0,
    "bits": 2.6,
    "kB": 3.0,
    "normals": 3.7,
    "error %": 3.4,
    "on GPU": 4.5,
}
MAP_WIDTH = 4.2
"""Width of a column with the PSNR of a map, in font sizes, as WIDTHS are."""


def _texts(row: TextureRow) -> tuple[str, ...]:
    return (
        row.name,
        f"{row.width} x {row.height}",
        row.category or "-",
        str(row.group) if row.group >= 0 else "-",
        decibels(row.psnr_db),
        f"{row.bits_per_texel:.2f}" if row.bits_per_texel is not None else "-",
        f"{row.file_bytes / 1e3:,.0f}" if row.file_bytes is not None else "-",
        f"{row.normal_degrees:.2f}" if row.normal_degrees is not None else "-",
        f"{100.0 * row.error_share:.1f}" if row.error_share is not None else "-",
        *(decibels(row.map_psnr_db.get(name)) for name in MAPS),
        f"{row.gpu_bytes / 1e3:,.1f} kB" if row.gpu_bytes is not None else "-",
    )


class TexturesPanel:
    """Panel Textures. Its rows are computed again only when their inputs change."""

    def __init__(self) -> None:
        self._filter = ""
        self._width = 0.0
        """Width of the table in window units."""
        self._note = ""
        """Text of slot A's bits per texel, decoders included, as Measure and the terminal print them."""
        self._key: object = None
        self._order: object = None
        self._all: tuple[TextureRow, ...] = ()
        self._rows: list[tuple[TextureRow, tuple[str, ...]]] = []
        self._scrolled_to: int | None = None
        self._rate = RateView()

    def draw(self, ui: UiFrame) -> None:
        """Draw the content of the panel."""
        source = ui.session.view.slot_a.source
        imgui.set_next_item_width(-1)
        _, self._filter = imgui.input_text_with_hint("##filter", "filter by name, category or group:3", self._filter)
        ui.rects.note(
            "texture filter",
            "Shows textures whose name or category has all these words; group:3 shows those of a group.",
        )
        flags = (
            imgui.TableFlags_.sortable
            | imgui.TableFlags_.hideable
            | imgui.TableFlags_.resizable
            | imgui.TableFlags_.reorderable
            | imgui.TableFlags_.row_bg
            | imgui.TableFlags_.scroll_x
            | imgui.TableFlags_.scroll_y
            | imgui.TableFlags_.borders_inner_v
        )
        selected = ui.session.inspection.selected_texture
        below = imgui.get_text_line_height_with_spacing()
        if selected is not None:
            below += self._rate.height(imgui.get_content_region_avail().y)
        self._width = imgui.get_content_region_avail().x
        if imgui.begin_table("textures", 1 + len(COLUMNS), flags, ImVec2(0, -below)):
            self._headings(ui)
            self._update(ui, source)
            self._body(ui)
            imgui.end_table()
        imgui.text_disabled(f"{len(self._rows):,} of {len(self._all):,}, A: {source}{self._note}")
        if selected is not None and selected < len(self._all):
            self._rate.draw(self._all[selected], ui)

    def _headings(self, ui: UiFrame) -> None:
        fixed, size = imgui.TableColumnFlags_.width_fixed, imgui.get_font_size()
        imgui.table_setup_scroll_freeze(2, 1)
        side, style = THUMBNAIL_LINES * size, imgui.get_style()
        others = sum(WIDTHS[column] * size for column in COLUMNS if column not in (*HIDDEN_AT_FIRST, "name"))
        columns = len(COLUMNS) - len(HIDDEN_AT_FIRST) + 1
        gaps = columns * (2.0 * style.cell_padding.x + 1.0) + style.scrollbar_size
        name = max(WIDTHS["name"] * size, self._width - side - others - gaps)
        imgui.table_setup_column(
            "##picture", fixed | imgui.TableColumnFlags_.no_sort | imgui.TableColumnFlags_.no_hide, side
        )
        for number, column in enumerate(COLUMNS):
            flags = fixed | (imgui.TableColumnFlags_.default_hide if column in HIDDEN_AT_FIRST else 0)
            if column == "name":
                flags |= imgui.TableColumnFlags_.no_hide
            imgui.table_setup_column(
                column, flags, name if column == "name" else em(WIDTHS.get(column, MAP_WIDTH)), number
            )
        headings({name: FIGURES[f"column {name.strip('#')}"] for name in ("##picture", *COLUMNS)}, ui.rects)

    def _update(self, ui: UiFrame, source: str) -> None:
        """Compute the rows again where their inputs have changed."""
        pack, match = ui.session.packs.get(source), ui.facts.matches.get(source)
        # The key holds objects, not their ids, because ids are reused.
        on_gpu = ui.facts.memory.get(ui.session.view.slot_a)
        latents = on_gpu.latents.tobytes() if on_gpu is not None else b""
        blocks = ui.session.compressed_as(source)
        compared = ui.facts.live.comparison
        key = (ui.session.scene, pack, match, latents, blocks, compared)
        fresh = self._key != key
        if fresh:
            sizes = on_gpu.latents.tolist() if on_gpu is not None else None
            scene = ui.session.scene
            self._all = compressed_rows(scene, blocks) if blocks else texture_rows(scene, pack, match, sizes)
            if compared is not None:
                self._all = with_error_shares(self._all, compared.textures)
            bits = blocks.bits_per_texel if blocks else pack_figures(pack).bits if pack is not None else None
            self._note = "" if bits is None else f", {bits:.2f} bits per texel{'' if blocks else ' with tables'}"
            self._key = key
        by = sort_order()
        order = (self._filter, by)
        if fresh or order != self._order:
            rows = filtered(self._all, self._filter)
            rows = ordered(rows, COLUMNS[by[0]], by[1]) if by is not None else rows
            self._rows = [(row, _texts(row)) for row in rows]
            self._order = order

    def _body(self, ui: UiFrame) -> None:
        side = THUMBNAIL_LINES * imgui.get_font_size()
        selected = ui.session.inspection.selected_texture
        height = side + 2.0 * imgui.get_style().cell_padding.y
        if selected != self._scrolled_to:
            # Another panel has selected the texture. A row that is clicked here is visible already.
            self._scrolled_to = selected
            self._scroll_to(selected, height)
        clipper = imgui.ListClipper()
        clipper.begin(len(self._rows), height)
        while clipper.step():
            for index in range(clipper.display_start, clipper.display_end):
                row, texts = self._rows[index]
                self._row(row, texts, side, row.texture_id == selected, ui)

    def _scroll_to(self, selected: int | None, height: float) -> None:
        place = next((n for n, (row, _) in enumerate(self._rows) if row.texture_id == selected), None)
        if place is None:
            return
        top, seen = imgui.get_scroll_y(), imgui.get_window_height() - 3.0 * height
        if not top <= place * height <= top + seen:
            imgui.set_scroll_y(max(0.0, place * height - 0.5 * seen))

    def _row(self, row: TextureRow, texts: tuple[str, ...], side: float, is_selected: bool, ui: UiFrame) -> None:
        imgui.table_next_row()
        imgui.table_next_column()
        flags = imgui.SelectableFlags_.span_all_columns | imgui.SelectableFlags_.allow_double_click
        at = imgui.get_cursor_pos()
        clicked = imgui.selectable(f"##{row.texture_id}", is_selected, flags, ImVec2(0, side))[0]
        label = f"texture {row.texture_id}"
        image = ui.facts.thumbnail(row.texture_id) if ui.facts.thumbnail is not None else None
        about = f"{row.name}, {row.width} x {row.height}\nClick selects the texture in all panels; double-click opens the flat view."
        ui.rects.note(label, about, image=image)
        if clicked:
            select_texture(ui, row.texture_id)
            ui.emit("training.measure-rates", str(row.texture_id))
            self._scrolled_to = row.texture_id
        imgui.set_cursor_pos(at)
        if ui.facts.thumbnail is not None:
            imgui.image(ui.facts.thumbnail(row.texture_id), ImVec2(side, side))
        for number, text in enumerate(texts):
            if imgui.table_next_column():
                imgui.text(text if number else two_lines(text, imgui.get_content_region_avail().x))
