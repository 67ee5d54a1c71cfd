"""Panel "Memory": bytes of the original textures, of block compression, and of the textures of each slot."""

from imgui_bundle import ImVec2, imgui

from viewer.inspect.memory_table import (
    MemoryRow,
    compressed_memory,
    megabytes,
    pack_memory,
    scene_memory,
    size_pairs,
    smaller_note,
)
from viewer.state.view_state import Slot, is_image_source
from viewer.ui.controls import copy_button
from viewer.ui.facts import UiFrame
from viewer.ui.theme import InkName, ink
from viewer.ui.widgets import disabled_beside

SCENE: InkName = "scene"
BAR_OPACITY = 0.4
"""Opacity of the bars, which text covers."""


def ratio(row: MemoryRow) -> str:
    """Return the ratio of a row's bytes to those of the originals as text: `1 : 12.3`."""
    return "-" if not row.share else f"1 : {1.0 / row.share:,.1f}"


class MemoryPanel:
    """Panel Memory. Its rows are computed again only when their inputs change."""

    def __init__(self) -> None:
        self._key: object = None
        self._notes: list[str] = []
        self._parts: list[tuple[str, InkName, tuple[MemoryRow, ...]]] = []

    def _update(self, ui: UiFrame) -> None:
        slots = {"a": ui.session.view.slot_a, "b": ui.session.view.slot_b}
        packs = [ui.session.packs.get(slot.source) for slot in slots.values()]
        on_gpu = {slot: (memory.parts, memory.idle) for slot, memory in ui.facts.memory.items()}
        key = (ui.session.scene, slots, packs, ui.session.compressed, on_gpu)
        if key == self._key:
            return
        self._key = key
        self._notes = []
        self._parts = [("scene", "scene", scene_memory(ui.session.scene))]
        for side, slot in slots.items():
            rows, note = _slot_rows(ui, slot), _size_note(ui, slot)
            if note:
                self._notes.append(f"{side.upper()}: {note}; ratios compare with originals of that size")
            if rows:
                precision = "" if is_image_source(slot.source) else f", {slot.precision}"
                self._parts.append((f"{side.upper()}: {slot.source}{precision}", "a" if side == "a" else "b", rows))

    def text(self) -> str:
        """Return the table as text for the clipboard."""
        lines = list(self._notes)
        for title, _, rows in self._parts:
            lines.append(title)
            lines += [f"  {row.name:36} {row.bytes:>15,} bytes  {ratio(row)}" for row in rows]
        return "\n".join(lines)

    def draw(self, ui: UiFrame) -> None:
        """Draw the content of the panel."""
        self._update(ui)
        copy_button(ui, "copy", "copy memory", "Copy the table to the clipboard.", self.text)
        disabled_beside("ratio to RGBA8 of equal size")
        for note in self._notes:
            imgui.text_wrapped(note)
            ui.rects.note(
                "encoded smaller",
                "A pack of smaller textures is compared with originals of that size: fewer texels do not count as compression.",
            )
        self._bars(ui)
        if not imgui.begin_table("memory", 3, imgui.TableFlags_.row_bg):
            return
        imgui.table_setup_column("what", imgui.TableColumnFlags_.width_stretch)
        for name in ("bytes", "ratio"):
            imgui.table_setup_column(name, imgui.TableColumnFlags_.width_fixed)
        for title, color, rows in self._parts:
            imgui.table_next_row()
            imgui.table_next_column()
            imgui.text_colored(ink(color), title)
            for row in rows:
                imgui.table_next_row()
                imgui.table_next_column()
                write = imgui.text if row.is_total else imgui.text_disabled
                write(row.name)
                if row.explanation:
                    ui.rects.tip(row.explanation)
                for text in (megabytes(row.bytes), ratio(row)):
                    imgui.table_next_column()
                    write(text)
        imgui.end_table()

    def _bars(self, ui: UiFrame) -> None:
        """Draw the totals as bars, relative to the largest."""
        totals = [(title, color, row) for title, color, rows in self._parts for row in rows if row.is_total]
        scene = [(row.name, SCENE, row) for row in self._parts[0][2]]
        most = max((row.bytes for _, _, row in (*scene, *totals)), default=1) or 1
        draw = imgui.get_window_draw_list()
        width, line = imgui.get_content_region_avail().x, imgui.get_text_line_height()
        for title, color, row in (*scene, *totals):
            at = imgui.get_cursor_screen_pos()
            end = ImVec2(at.x + max(width * row.bytes / most, 2.0), at.y + line)
            solid = ink(color)
            faded = imgui.ImVec4(solid.x, solid.y, solid.z, BAR_OPACITY)
            draw.add_rect_filled(at, end, imgui.get_color_u32(faded), 2.0)
            name = row.name if title == row.name else f"{title.split(':')[0]} {row.name}"
            imgui.text(f"{name}  {megabytes(row.bytes)}")
        ui.rects.note("memory bars", "Bytes of the original textures, of BC7, and of what A and B show.")
        imgui.separator()


def _slot_rows(ui: UiFrame, slot: Slot) -> tuple[MemoryRow, ...]:
    blocks = ui.session.compressed_as(slot.source)
    if blocks is not None:
        return compressed_memory(blocks)
    pack, match = ui.session.packs.get(slot.source), ui.facts.matches.get(slot.source)
    if pack is None or match is None:
        return ()
    on_gpu = ui.facts.memory.get(slot)
    parts, idle = (None, 0) if on_gpu is None else (on_gpu.parts, on_gpu.idle)
    return pack_memory(ui.session.scene, pack, match, parts, idle)


def _size_note(ui: UiFrame, slot: Slot) -> str:
    pack, match = ui.session.packs.get(slot.source), ui.facts.matches.get(slot.source)
    return smaller_note(size_pairs(ui.session.scene, pack, match)) if pack is not None and match is not None else ""
