"""Annotations over the picture: divider and labels, warnings, frames, the legend of a map, messages, hints."""

from dataclasses import replace

import numpy as np
from imgui_bundle import ImVec2, imgui

from viewer.commands import bindings
from viewer.commands.keys import HOLD_KEY
from viewer.inspect.picture_warnings import PictureWarning, picture_warnings
from viewer.render.compositor import largest_error
from viewer.state.compare_layout import WIPES, image_to_window, layout_of, shown_sides
from viewer.state.palettes import PaletteName
from viewer.state.session import Session, Toast
from viewer.state.view_state import BLOCKS, Slot, ViewState, is_image_source
from viewer.ui.facts import UiData, UiFrame
from viewer.ui.theme import ERROR_ICON, WARNING_ICON, with_icon
from viewer.ui.widgets import SHADE, WHITE, Area, counted, draw_plate, draw_tooltip, em, grid, heat, packed

WARNING = (0.38, 0.26, 0.02, 0.92)
WARNING_WIDTH = 26.0
"""Largest width of a warning, in font sizes."""
WARNINGS_TOP = 3.5
"""Distance of the first warning from the upper edge, in font sizes; labels of two lines fit above it."""
ERROR = (0.55, 0.08, 0.06, 0.92)
MESSAGE = (0.10, 0.14, 0.18, 0.92)


def _line(start: ImVec2, end: ImVec2) -> None:
    draw = imgui.get_background_draw_list()
    draw.add_line(start, end, packed(SHADE), grid(1))
    draw.add_line(start, end, packed(WHITE), grid(0.4))


def _difference_label(view: ViewState) -> str:
    texts = {
        "raw": "difference",
        "amplified": f"difference x {view.difference.gain:g}",
        "relative": "relative difference",
        "flip": "FLIP",
    }
    return texts[view.difference.kind]


def draw_labels(ui: UiFrame, area: Area) -> None:
    """Draw the names of the shown slots: on both sides of the divider, or in the middle of `area` without one."""
    draw = imgui.get_background_draw_list()
    view = ui.session.shown_view
    top, middle, gap = area.top + grid(2), ImVec2(*area.at(0.5, 0.5)), grid(3)

    def plate(left: float, top: float, text: str) -> None:
        draw_plate(draw, ImVec2(left, top), text)

    sides = shown_sides(view)
    names = [f"{side.upper()}: {view.slots[side].label}" for side in sides]
    noted = [
        f"{name}\n{note}" if (note := slot_note(view.slots[side], view, ui.facts)) else name
        for side, name in zip(sides, names, strict=True)
    ]
    split = layout_of(view)
    if split is None:
        text = noted[0] if view.compare in ("a", "b") else f"{_difference_label(view)}: {names[0]} - {names[1]}"
        plate(middle.x - imgui.calc_text_size(text).x / 2, top, text)
    elif not split.vertical:
        y = area.at(0.0, split.position)[1]
        _line(ImVec2(area.left, y), ImVec2(area.right, y))
        draw.add_circle_filled(ImVec2(middle.x, y), grid(2), packed(WHITE))
        for text, text_top in ((noted[0], y - gap - imgui.calc_text_size(noted[0]).y), (noted[1], y + gap)):
            plate(middle.x - imgui.calc_text_size(text).x / 2, text_top, text)
        ui.rects.note_rectangle("divider", middle.x - 1, y - 1, middle.x + 1, y + 1)
    else:
        x = area.at(split.position, 0.0)[0]
        _line(ImVec2(x, area.top), ImVec2(x, area.bottom))
        plate(x - gap - imgui.calc_text_size(noted[0]).x, top, noted[0])
        plate(x + gap, top, noted[1])
        if view.compare in WIPES:
            draw.add_circle_filled(ImVec2(x, middle.y), grid(2), packed(WHITE))
            ui.rects.note_rectangle("divider", x - 1, middle.y - 1, x + 1, middle.y + 1)


class PictureWarnings:
    """Warnings about the picture, computed again only when their inputs change."""

    def __init__(self) -> None:
        self._key: object = None
        self._warnings: tuple[PictureWarning, ...] = ()

    def draw(self, ui: UiFrame, area: Area) -> None:
        """Draw a plate for each warning at the upper left of `area`. Its tooltip says what to do."""
        session = ui.session
        sides = shown_sides(session.shown_view)
        slots = {side.upper(): session.view.slots[side] for side in sides}
        sources = {slot.source for slot in slots.values()}
        packs = {source: session.packs[source] for source in sources if source in session.packs}
        matches = {source: ui.facts.matches[source] for source in sources if source in ui.facts.matches}
        key = (session.scene, slots, packs, matches, session.resolution)
        if key != self._key:
            self._key = key
            self._warnings = picture_warnings(session.scene, slots, packs, matches, session.resolution)
        draw = imgui.get_background_draw_list()
        at = ImVec2(area.left + grid(3), area.top + em(WARNINGS_TOP))
        wrap = max(em(6.0), min(em(WARNING_WIDTH), area.width - grid(9)))
        for number, warning in enumerate(self._warnings):
            low, high = draw_plate(draw, at, with_icon(WARNING_ICON, warning.text), WARNING, wrap)
            ui.rects.note_rectangle(f"warning {number + 1}", low.x, low.y, high.x, high.y)
            if not imgui.get_io().want_capture_mouse and imgui.is_mouse_hovering_rect(low, high, False):
                draw_tooltip(warning.remedy)
            at = ImVec2(at.x, high.y + grid(2))


def _frames(ui: UiFrame, part: tuple[float, float, float, float], area: Area) -> None:
    """Draw a frame around a part of the picture, in each side that shows it."""
    view, draw = ui.session.shown_view, imgui.get_background_draw_list()
    left, top, right, bottom = part
    extent = ((right - left) * view.zoom.factor * area.width, (bottom - top) * view.zoom.factor * area.height)
    draw.push_clip_rect(ImVec2(area.left, area.top), ImVec2(area.right, area.bottom))
    for shown in image_to_window(view, (left + right) / 2.0, (top + bottom) / 2.0):
        x, y = area.at(*shown)
        low = ImVec2(x - extent[0] / 2.0, y - extent[1] / 2.0)
        high = ImVec2(low.x + extent[0], low.y + extent[1])
        draw.add_rect(ImVec2(low.x - 1.5, low.y - 1.5), ImVec2(high.x + 1.5, high.y + 1.5), packed(SHADE), 0.0, 3.0)
        draw.add_rect(ImVec2(low.x - 1.0, low.y - 1.0), ImVec2(high.x + 1.0, high.y + 1.0), packed(WHITE), 0.0, 1.0)
    draw.pop_clip_rect()


def draw_pixel(ui: UiFrame, area: Area) -> None:
    """Draw a frame around the pixels that the panel Pixel enlarges."""
    if ui.facts.pixel is not None:
        _frames(ui, ui.facts.pixel.place.rectangle, area)


def draw_block(ui: UiFrame, area: Area) -> None:
    """Draw a frame around the block of the panel Divergence, and its number of decoders beside the mouse."""
    block = ui.facts.block
    if block is None:
        return
    left, top, right, bottom = block.place.rectangle
    _frames(ui, (left, top, right, bottom), area)
    if ui.session.inspection.hovered is not None and ui.session.inspection.block is None and block.textures:
        slots = (("A", ui.session.view.slot_a), ("B", ui.session.view.slot_b))
        texts = [
            f"{side}: {counted(block.decoder_count(slot.source), 'decoder')}"
            for side, slot in slots
            if not is_image_source(slot.source)
        ]
        draw_tooltip(", ".join([*texts, counted(len(block.textures), "texture")]))


def draw_toasts(toasts: tuple[Toast, ...], area: Area) -> None:
    """Draw messages above the lower edge of `area`, the newest lowest."""
    y = area.bottom - 2.0 * imgui.get_text_line_height_with_spacing()
    wrap = max(em(15.0), min(em(46.0), area.width - grid(10)))
    draw = imgui.get_foreground_draw_list()
    for toast in reversed(toasts):
        fill, sign = (ERROR, ERROR_ICON) if toast.kind == "error" else (MESSAGE, "")
        text = with_icon(sign, toast.text)
        extent = imgui.calc_text_size(text, wrap_width=wrap)
        y -= extent.y + grid(3)
        draw_plate(draw, ImVec2(_centred(area, extent.x), y), text, fill, wrap)


def _centred(area: Area, width: float) -> float:
    """Return the left edge of an item of `width`, centred in `area` but inside the window."""
    right = imgui.get_io().display_size.x - grid(3)
    return max(grid(3), min((area.left + area.right - width) / 2.0, right - width))


def _draw_low_line(ui: UiFrame, area: Area, text: str, label: str) -> None:
    """Draw a line of text called `label` at the lower edge of `area`, below all windows."""
    extent = imgui.calc_text_size(text)
    at = ImVec2(_centred(area, extent.x), area.bottom - extent.y - grid(2))
    low, high = draw_plate(imgui.get_background_draw_list(), at, text)
    ui.rects.note_rectangle(label, low.x, low.y, high.x, high.y)


HINTS = {"help.palette": "commands", "help.keys": "help", "compare.measure": "measure", "file.screenshot": "screenshot"}
"""One word for the effect of a key, by command; the most useful ones first."""


def hint_lines(session: Session) -> tuple[str, ...]:
    """Return lines of hints about keys, from the longest to the shortest."""
    keys = bindings(session.settings.keys)
    parts = [f"{key.split(', ')[0]} {word}" for command, word in HINTS.items() if (key := keys.text(command))]
    more = (f"{session.settings.camera_mode} camera", f"{keys.text('compare.next')} mode", f"{HOLD_KEY} other slot")
    return ("   ".join((*parts, *more)), *("  ".join(parts[:end]) for end in range(len(parts), 0, -1)))


def draw_hints(ui: UiFrame, area: Area) -> None:
    """Draw the longest line of hints that fits at the lower edge of `area`."""
    room = area.width - grid(6)
    if fitting := [line for line in hint_lines(ui.session) if imgui.calc_text_size(line).x <= room]:
        _draw_low_line(ui, area, fitting[0], "hints")


def draw_way_back(ui: UiFrame, area: Area) -> None:
    """Draw a hint about the key that shows hidden panels again, while the mouse is over the window."""
    mouse = imgui.get_io().mouse_pos
    inside = all(0.0 <= share < 1.0 for share in area.share_of(mouse.x, mouse.y))
    keys = bindings(ui.session.settings.keys).text("window.panels")
    if inside and keys:
        _draw_low_line(ui, area, f"press {keys} to show the panels", "way back")


LEGEND_TEXT = (1.0, 1.0, 1.0, 0.95)
LEGEND_SHADE = (0.0, 0.0, 0.0, 0.75)
LINES_BELOW = 2.2
"""Space below the legend that the hints take, in lines of text."""
FIELD = 2.6
"""Width of the field of one number of decoders, in font sizes."""
ERROR_FIELDS = 16
"""Number of fields in the legend of an error map, whose scale is continuous."""


def slot_note(slot: Slot, view: ViewState, facts: UiData) -> str:
    """Return a note below a slot's name about its part of the picture, such as `decoding 3 tiles`; "" for none."""
    if view.overlay.kind == "divergence" and is_image_source(slot.source):
        return "images have no decoders: no map here"
    tiles = facts.frame.tiles.get(replace(slot, path=facts.frame.paths.get(slot, slot.path)))
    if tiles is not None and tiles.waiting:
        return f"decoding {counted(tiles.waiting, 'tile')}"
    loads = facts.frame.loads.get(slot)
    if loads is not None and loads.waiting:
        return f"compressing {loads.waiting / 1e6:,.1f} Mtexel"
    return ""


def _largest(ui: UiFrame) -> float | None:
    """Return the largest error of a texture or decoder in steps of 8-bit sRGB; None without a comparison."""
    comparison = ui.facts.live.comparison
    if comparison is None:
        return None
    rows = comparison.textures if ui.session.view.overlay.kind == "error-texture" else comparison.decoders
    return largest_error(np.array([row.rmse for row in rows], np.float32))


def _legend(
    ui: UiFrame, area: Area, lines: list[str], texts: list[str], shades: list[float], name: PaletteName
) -> None:
    """Draw the legend: a bar of `shades`, which are positions on the palette, 0 to 1, above evenly spaced `texts`."""
    draw = imgui.get_background_draw_list()
    line, font, pad = imgui.get_text_line_height(), imgui.get_font_size(), grid(2)
    room = area.width - grid(12)
    bar = min(max(FIELD * font * max(len(texts), 4), *(imgui.calc_text_size(text).x for text in lines)), room)
    height = (len(lines) + (2.0 if texts else 0.0)) * line + grid(1)
    if room < FIELD * font * 2 or height > 0.5 * area.height:
        return
    left, top = area.left + grid(3), area.bottom - LINES_BELOW * line - height - grid(3)
    low, high = ImVec2(left, top), ImVec2(left + bar + 2.0 * pad, top + height + pad)
    draw.add_rect_filled(low, high, packed(LEGEND_SHADE), grid(1))
    draw.push_clip_rect(low, high)
    y = top + grid(1)
    for text in lines:
        draw.add_text(ImVec2(left + pad, y), packed(LEGEND_TEXT), text)
        y += line
    field = bar / max(len(shades), 1)
    for number, shade in enumerate(shades):
        at = ImVec2(left + pad + number * field, y + grid(0.5))
        draw.add_rect_filled(at, ImVec2(at.x + field, at.y + line), packed(heat(name, 1.0 + shade, 2)))
    part = bar / max(len(texts), 1)
    for number, text in enumerate(texts):
        x = left + pad + number * part + (part - imgui.calc_text_size(text).x) / 2.0
        draw.add_text(ImVec2(x, y + line + grid(1)), packed(LEGEND_TEXT), text)
    draw.pop_clip_rect()
    ui.rects.note_rectangle("map legend", low.x, low.y, high.x, high.y)


def draw_map_legend(ui: UiFrame, area: Area) -> None:
    """Draw the legend at the lower left of `area`, while a map lies over the picture."""
    overlay = ui.session.view.overlay
    if overlay.kind == "none":
        return
    if overlay.kind == "divergence":
        counts = ui.facts.divergence
        if not counts:
            return
        fields = overlay.legend(max((figures.maximum for figures in counts.values()), default=0))
        width, height = BLOCKS[overlay.block]
        lines = [f"decoders in each block of {width} x {height} pixels"]
        if ui.facts.is_preview:
            lines.append("preview with fewer pixels while the camera moves")
        last = max(1, len(fields) - 1)
        _legend(ui, area, lines, list(fields), [place / last for place in range(len(fields))], overlay.palette)
        return
    largest = _largest(ui)
    what = "texture" if overlay.kind == "error-texture" else "decoder"
    title = f"RMS error of each {what}, A against B, in steps of 8-bit sRGB"
    if largest is None:
        _legend(ui, area, ["errors appear when A and B have been compared"], [], [], overlay.palette)
        return
    texts = ["0", "", f"{largest:.2f}"]
    shades = [place / (ERROR_FIELDS - 1) for place in range(ERROR_FIELDS)]
    _legend(ui, area, [title], texts, shades, overlay.palette)
