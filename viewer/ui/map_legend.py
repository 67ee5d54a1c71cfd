"""The legend of a map over the picture: what it shows, and which colour stands for how much."""

from dataclasses import replace

import numpy as np
from imgui_bundle import ImVec2, imgui

from viewer.render.compositor import largest_error
from viewer.state.palettes import PaletteName
from viewer.state.view_state import BLOCKS, Overlay, Slot, ViewState, is_image_source
from viewer.ui.facts import FrameFacts, UiFrame
from viewer.ui.widgets import Area, counted, heat, packed

WHITE = (1.0, 1.0, 1.0, 0.95)
SHADE = (0.0, 0.0, 0.0, 0.75)
MARGIN = 12.0
LINES_BELOW = 2.2
"""Between the legend and the lower edge of the picture, in lines of text: room for the line of hints."""
FIELD = 2.6
"""Width of the field of one number of decoders, in font sizes."""
ERROR_FIELDS = 16
"""Of the bar of an error map, which has no steps of its own."""


def slot_note(slot: Slot, view: ViewState, facts: FrameFacts) -> str:
    """What is to be known of the part of the picture that shows a slot; "" for nothing."""
    if view.overlay.kind == "divergence" and is_image_source(slot.source):
        return "images are not decoded: no map here"
    tiles = facts.tiles.get(replace(slot, path=facts.paths.get(slot, slot.path)))
    if tiles is not None and tiles.waiting:
        return f"decoding {counted(tiles.waiting, 'tile')}"
    return ""


def decoder_fields(overlay: Overlay, maximum: int) -> tuple[str, ...]:
    """Numbers below the fields of the bar, where a block of the picture has at most `maximum` decoders."""
    most = overlay.most(maximum)
    # Blocks with more look like those with the most.
    last = f"{most}+" if overlay.scale == "block" else str(most)
    return (*(str(decoders) for decoders in range(1, most)), last)


def _largest(ui: UiFrame) -> float | None:
    """The largest error of a texture or decoder, in steps of 8-bit sRGB; None where there is no comparison."""
    found = ui.facts.live.comparison
    if found is None:
        return None
    rows = found.textures if ui.session.view.overlay.kind == "error-texture" else found.decoders
    return largest_error(np.array([row.rmse for row in rows], np.float32))


def _bar(at: ImVec2, colors: list[tuple[float, float, float, float]], size: tuple[float, float]) -> None:
    draw = imgui.get_background_draw_list()
    field = size[0] / len(colors)
    for number, color in enumerate(colors):
        left = at.x + number * field
        draw.add_rect_filled(ImVec2(left, at.y), ImVec2(left + field, at.y + size[1]), packed(color))


def _legend(
    ui: UiFrame, area: Area, lines: list[str], texts: list[str], shades: list[float], name: PaletteName
) -> None:
    """`texts` stand below as many equal parts of the bar, `shades` are places on the palette, 0 to 1."""
    draw = imgui.get_background_draw_list()
    line, font = imgui.get_text_line_height(), imgui.get_font_size()
    room = area.width - 4.0 * MARGIN
    bar = min(max(FIELD * font * max(len(texts), 4), *(imgui.calc_text_size(text).x for text in lines)), room)
    height = (len(lines) + (2.0 if texts else 0.0)) * line + 6.0
    if room < FIELD * font * 2 or height > 0.5 * area.height:
        return
    left, top = area.left + MARGIN, area.bottom - LINES_BELOW * line - height - MARGIN
    low, high = ImVec2(left, top), ImVec2(left + bar + 16.0, top + height + 8.0)
    draw.add_rect_filled(low, high, packed(SHADE), 4.0)
    draw.push_clip_rect(low, high)
    y = top + 4.0
    for text in lines:
        draw.add_text(ImVec2(left + 8.0, y), packed(WHITE), text)
        y += line
    if texts:
        _bar(ImVec2(left + 8.0, y + 2.0), [heat(name, 1.0 + shade, 2) for shade in shades], (bar, line))
    part = bar / max(len(texts), 1)
    for number, text in enumerate(texts):
        x = left + 8.0 + number * part + (part - imgui.calc_text_size(text).x) / 2.0
        draw.add_text(ImVec2(x, y + line + 4.0), packed(WHITE), text)
    draw.pop_clip_rect()
    ui.rects.note_rectangle("map legend", low.x, low.y, high.x, high.y)


def draw_map_legend(ui: UiFrame, area: Area) -> None:
    """The legend, at the lower left of the picture in `area`, while a map lies over it."""
    overlay = ui.session.view.overlay
    if overlay.kind == "none":
        return
    if overlay.kind == "divergence":
        counts = ui.facts.divergence
        fields = decoder_fields(overlay, max((figures.maximum for figures in counts.values()), default=0))
        width, height = BLOCKS[overlay.block]
        lines = [f"decoders in each block of {width} x {height} pixels"]
        if ui.facts.is_preview:
            lines.append("preview while the camera moves: fewer pixels")
        last = max(1, len(fields) - 1)
        _legend(ui, area, lines, list(fields), [place / last for place in range(len(fields))], overlay.palette)
        return
    largest = _largest(ui)
    what = "texture" if overlay.kind == "error-texture" else "decoder"
    title = f"RMS error of each {what}, A against B, in steps of 8-bit sRGB"
    if largest is None:
        _legend(ui, area, ["errors follow once A and B have been compared"], [], [], overlay.palette)
        return
    texts = ["0", "", f"{largest:.2f}"]
    shades = [place / (ERROR_FIELDS - 1) for place in range(ERROR_FIELDS)]
    _legend(ui, area, [title], texts, shades, overlay.palette)
