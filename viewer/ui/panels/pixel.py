"""Panel "Pixel": 15 x 15 pixels of both slots, enlarged, and the values of the middle pixel."""

from imgui_bundle import ImVec2, imgui

from viewer.inspect.picking import REACH, PixelContent, PixelPatch
from viewer.state.view_state import Slot, is_image_source
from viewer.ui.controls import command_button
from viewer.ui.facts import UiFrame
from viewer.ui.help.texts import FIGURES
from viewer.ui.theme import side_ink
from viewer.ui.widgets import cells, em, grid

SIDE = 2 * REACH + 1
LARGEST_CELL = 0.9
"""Largest side of an enlarged pixel in font sizes."""
FRAME_COLORS = (0xFF000000, 0xFFFFFFFF)


def _patch(patch: PixelPatch | None, inside: tuple[int, int, int, int], cell: float) -> None:
    draw = imgui.get_window_draw_list()
    at = imgui.get_cursor_screen_pos()
    imgui.dummy(ImVec2(SIDE * cell, SIDE * cell))
    if patch is None:
        draw.add_text(at, imgui.get_color_u32(imgui.Col_.text_disabled), "not drawn yet")
        return
    colors = patch.srgb8.tolist()
    left, top, right, bottom = inside
    for row in range(top, bottom):
        y = at.y + row * cell
        for column in range(left, right):
            red, green, blue = colors[row][column]
            x = at.x + column * cell
            packed = 0xFF000000 | blue << 16 | green << 8 | red
            draw.add_rect_filled(ImVec2(x, y), ImVec2(x + cell, y + cell), packed)
    low = ImVec2(at.x + REACH * cell, at.y + REACH * cell)
    for distance, color in zip((1.0, 0.0), FRAME_COLORS, strict=True):
        draw.add_rect(
            ImVec2(low.x - distance, low.y - distance), ImVec2(low.x + cell + distance, low.y + cell + distance), color
        )


def _values(pixel: PixelContent, ui: UiFrame) -> None:
    if not imgui.begin_table("values", 3, imgui.TableFlags_.sizing_stretch_prop):
        return
    for side, patch in (("a", pixel.a), ("b", pixel.b)):
        imgui.table_next_row()
        imgui.table_next_column()
        imgui.text_colored(side_ink(side), side.upper())
        if patch is None:
            continue
        linear, srgb = patch.middle
        cells(" ".join(f"{value:3d}" for value in srgb))
        ui.rects.note(
            f"{side.upper()} 8-bit sRGB", "Red, green and blue of the pixel in this slot in 8-bit sRGB, 0 to 255."
        )
        cells("  ".join(f"{value:.4f}" for value in linear))
        ui.rects.note(
            f"{side.upper()} linear", "Red, green and blue of the pixel in this slot in linear light, 0 to 1."
        )
    if pixel.a is not None and pixel.b is not None:
        first, second = pixel.a.middle, pixel.b.middle
        imgui.table_next_row()
        imgui.table_next_column()
        imgui.text_disabled("A - B")
        cells(" ".join(f"{a - b:+3d}" for a, b in zip(first[1], second[1], strict=True)))
        cells(" ".join(f"{a - b:+.4f}" for a, b in zip(first[0], second[0], strict=True)))
    imgui.end_table()


def _sources(slots: tuple[Slot, Slot], numbers: dict[str, int]) -> str:
    """Return a text of the numbers of both slots, such as `A 3, B 1`."""
    texts = [
        f"{side} {numbers[slot.source]}" if numbers[slot.source] >= 0 else f"{side} none"
        for side, slot in zip("AB", slots, strict=True)
        if slot.source in numbers
    ]
    return ", ".join(texts) or "-"


def _facts(pixel: PixelContent, ui: UiFrame) -> None:
    slots = (ui.session.view.slot_a, ui.session.view.slot_b)
    if pixel.material_name is None:
        imgui.text_disabled("background")
        return
    rows = [("material", pixel.material_name)]
    if pixel.texture_id >= 0:
        rows += [
            ("texture", f"{pixel.texture_id}  {pixel.texture_name}"),
            ("uv", f"{pixel.uv[0]:.5f}  {pixel.uv[1]:.5f}"),
            ("lod", f"{pixel.lod:.2f}" if pixel.lod is not None else "-"),
        ]
        if not all(is_image_source(slot.source) for slot in slots):
            rows += [
                ("decoder", _sources(slots, dict(pixel.decoders))),
                (f"D of {ui.session.view.overlay.block}", _sources(slots, dict(pixel.block_decoders))),
            ]
    else:
        rows.append(("texture", "none"))
    if imgui.begin_table("facts", 2, imgui.TableFlags_.sizing_fixed_fit):
        for name, text in rows:
            imgui.table_next_row()
            imgui.table_next_column()
            imgui.text_disabled(name)
            tip = FIGURES[f"pixel {name.partition(' of ')[0]}"]
            ui.rects.note(f"pixel {name}", tip)
            cells(text)
            ui.rects.tip(tip)
        imgui.end_table()


def draw_pixel_panel(ui: UiFrame) -> None:
    """Draw the content of the panel."""
    pixel = ui.facts.pixel
    if pixel is None:
        imgui.text_disabled("Move the mouse over the picture.")
        return
    place = pixel.place
    imgui.text(f"{place.x}, {place.y} of {place.picture[0]} x {place.picture[1]}")
    imgui.same_line()
    if ui.session.inspection.pixel is not None:
        command_button(
            ui, "release", "pixel.let-go", label="let the pixel go", tip="Follow the mouse again.", small=True
        )
    else:
        imgui.text_disabled("click to keep")
    cell = min(em(LARGEST_CELL), (imgui.get_content_region_avail().x - grid(2)) / (2 * SIDE))
    cell = max(2.0, float(int(cell)))
    _patch(pixel.a, place.inside, cell)
    ui.rects.note("pixels of A", "Pixels around the mouse, enlarged, with a frame around the middle one.")
    imgui.same_line()
    _patch(pixel.b, place.inside, cell)
    ui.rects.note("pixels of B", "Pixels around the mouse, enlarged, with a frame around the middle one.")
    _values(pixel, ui)
    _facts(pixel, ui)
    ui.rects.note("pixel", "Values of the middle pixel.")
