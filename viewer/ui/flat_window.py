"""Window that shows one texture flat: its original and its version in other sources, side by side or with a divider."""

import math
from collections.abc import Callable, Hashable
from functools import partial
from typing import Literal

from imgui_bundle import ImVec2, imgui

from viewer.inspect.flat_texture import (
    FlatTexture,
    VisiblePart,
    compressed_flat,
    decode_flat,
    original_flat,
    visible_part,
)
from viewer.jobs.job import Background, Job, JobReport
from viewer.state.view_state import REFERENCE
from viewer.ui.facts import UiFrame
from viewer.ui.help.texts import value_text
from viewer.ui.theme import INKS, side_ink
from viewer.ui.widgets import combo, grid, packed

Arrangement = Literal["side by side", "wipe"]
ARRANGEMENTS: dict[Arrangement, str] = {
    "side by side": "Both sides in full, one beside the other.",
    "wipe": "One picture with a divider: A left of it, B right of it.",
}
"""Arrangements with their tooltips."""
LARGEST_ZOOM = 64.0
ZOOM_STEP = 1.25
GRAB = 8.0
"""Distance from the divider within which it can be grabbed, in units of normal scale."""
LINE = (1.0, 1.0, 1.0, 0.9)


_Side = tuple[FlatTexture | None, str]
"""Texture and caption of one side."""


class FlatWindow:
    """Flat view of one texture, with zoom, divider and the sources of two sides."""

    def __init__(self, background: Background) -> None:
        self._background = background
        self._texture: object = None
        self._parts: dict[str, VisiblePart] = {}
        self._sources: dict[str, str] = {}
        self._asked: dict[str, Hashable] = {}
        """Keys of the jobs of each side."""
        self._arrangement: Arrangement = "side by side"
        self._zoom = 1.0
        """Magnification; 1 fits the texture into its place."""
        self._centre = (0.5, 0.5)
        """Position in the texture at the middle of the view, as shares of its size."""
        self._divider = 0.5
        self._dragging = False

    def draw(self, ui: UiFrame) -> None:
        """Draw the window while a texture is shown flat."""
        number = ui.session.inspection.flat_texture
        if number is None or ui.facts.image is None or number >= len(ui.session.scene.textures):
            self._forget()
            return
        texture = ui.session.scene.textures[number]
        if texture is not self._texture:
            self._begin(ui, number)
        size = imgui.get_main_viewport().work_size
        centre = imgui.get_main_viewport().get_work_center()
        imgui.set_next_window_size(ImVec2(0.7 * size.x, 0.8 * size.y), imgui.Cond_.appearing)
        imgui.set_next_window_pos(centre, imgui.Cond_.appearing, ImVec2(0.5, 0.5))
        imgui.set_next_window_bg_alpha(1.0)
        flags = imgui.WindowFlags_.no_saved_settings | imgui.WindowFlags_.no_scrollbar
        flags |= (
            imgui.WindowFlags_.no_scroll_with_mouse | imgui.WindowFlags_.no_docking | imgui.WindowFlags_.no_collapse
        )
        opened, stays = imgui.begin(f"{texture.name}###flat", True, flags)
        ui.rects.note(
            "flat texture", "One texture without the scene: its original, and the result of packs and block formats."
        )
        if opened:
            width, height = texture.size
            self._controls(ui)
            sides = {side: self._side(ui, number, side) for side in self._sources}
            for side, (_, caption) in sides.items():
                imgui.text_colored(side_ink(side), side.upper())
                imgui.same_line()
                imgui.text(caption)
                ui.rects.note(f"flat caption {side}", "Source of this side, and its PSNR in dB against the original.")
            self._picture(sides, (width, height), ui)
        imgui.end()
        if not stays:
            ui.emit("texture.close-flat")

    def _forget(self) -> None:
        if self._texture is not None:
            self._cancel()
            self._texture = None
            self._parts.clear()

    def _cancel(self) -> None:
        for key in self._asked.values():
            self._background.cancel(key)
        self._asked.clear()

    def _begin(self, ui: UiFrame, number: int) -> None:
        self._cancel()
        self._texture = ui.session.scene.textures[number]
        self._parts.clear()
        self._zoom, self._centre, self._divider = 1.0, (0.5, 0.5), 0.5
        first, second = ui.session.view.slot_a.source, ui.session.view.slot_b.source
        self._sources = {"a": first, "b": second if second != first else REFERENCE}

    def _controls(self, ui: UiFrame) -> None:
        width = 9.0 * imgui.get_font_size()
        for side in self._sources:
            # Packs may have been closed since.
            if self._sources[side] not in ui.session.open_sources:
                self._sources[side] = REFERENCE
            imgui.set_next_item_width(width)
            self._sources[side] = combo(
                *(f"flat {side.upper()}", self._sources[side], ui.session.open_sources, ui.rects),
                f"Source of the {'first' if side == 'a' else 'second'} side.",
                about=value_text,
            )
            imgui.same_line()
        for arrangement, tip in ARRANGEMENTS.items():
            if imgui.radio_button(arrangement, self._arrangement == arrangement):
                self._arrangement = arrangement
            ui.rects.note(f"flat {arrangement}", tip)
            imgui.same_line()
        if imgui.small_button("fit"):
            self._zoom, self._centre = 1.0, (0.5, 0.5)
        ui.rects.note("flat fit", "Fit the whole texture into the window again.")
        imgui.same_line()
        imgui.text_disabled(f"{self._zoom:.2f} x; wheel zooms, drag moves")

    def _side(self, ui: UiFrame, number: int, side: str) -> _Side:
        texture, source = ui.session.scene.textures[number], self._sources[side]
        width, height = texture.size
        if source == REFERENCE:
            answer = self._ask(side, (texture, source), partial(original_flat, texture))
            return self._shown(answer, source, f"original, {width} x {height}")
        blocks = ui.session.compressed_as(source)
        if blocks is not None:
            compressed = blocks.textures[number]
            answer = self._ask(side, (texture, source), partial(compressed_flat, compressed))
            return self._shown(
                answer, source, f"{source}, {8.0 * compressed.stored_bytes / compressed.texels:.2f} bits per texel"
            )
        pack, match = ui.session.packs.get(source), ui.facts.matches.get(source)
        index = match.texture_index[number] if match is not None and number < len(match.texture_index) else -1
        if pack is None or index < 0:
            return None, f"{source} does not hold this texture"
        encoded = pack.textures[index]
        # A pack can be read again under the same name, so the key needs the texture itself.
        answer = self._ask(side, (texture, source, encoded), partial(decode_flat, texture, pack, index))
        return self._shown(answer, source, f"{source}, {encoded.width} x {encoded.height}, group {encoded.group}")

    def _ask(self, side: str, key: Hashable, work: Callable[[JobReport], FlatTexture]) -> Job[FlatTexture]:
        before = self._asked.get(side, key)
        self._asked[side] = key
        if before not in self._asked.values():
            self._background.cancel(before)
        return self._background.submit(key, work)

    @staticmethod
    def _shown(job: Job[FlatTexture], source: str, about: str) -> _Side:
        if not job.done:
            first = job.report.partial
            doing = f", decoding {job.report.share:.0%}" if source != REFERENCE else ""
            return (first if isinstance(first, FlatTexture) else None), about + doing
        if job.problem:
            return None, f"{source}: {job.problem}"
        flat = job.result()
        if source == REFERENCE:
            return flat, about
        quality = "PSNR unknown: sizes differ"
        if flat.psnr_db is not None:
            quality = "equal" if math.isinf(flat.psnr_db) else f"PSNR of mip 0 {flat.psnr_db:.2f} dB"
        against = " against the original reduced to this size" if flat.reduced else ""
        return flat, f"{about}, {quality}{against}"

    def _picture(self, sides: dict[str, _Side], size: tuple[int, int], ui: UiFrame) -> None:
        at, room = imgui.get_cursor_screen_pos(), imgui.get_content_region_avail()
        if room.x < 8.0 or room.y < 8.0:
            return
        imgui.invisible_button("flat picture", room)
        ui.rects.note("flat picture", "Wheel: zoom. Drag: move.")
        wipes = self._arrangement == "wipe"
        gap = 0.0 if wipes else grid(1)
        width = room.x if wipes else (room.x - gap) / 2.0
        fits = min(width / size[0], room.y / size[1])
        texel = fits * self._zoom
        self._input(at, room, width + gap if not wipes else 0.0, (size[0] * texel, size[1] * texel))
        draw = imgui.get_window_draw_list()
        split = at.x + self._divider * room.x
        for number, (side, (flat, _)) in enumerate(sides.items()):
            left = at.x if wipes else at.x + number * (width + gap)
            low, high = ImVec2(left, at.y), ImVec2(left + width, at.y + room.y)
            middle = ImVec2(left + width / 2.0, at.y + room.y / 2.0)
            if wipes:
                low = ImVec2(split, at.y) if number else low
                high = high if number else ImVec2(split, high.y)
            draw.push_clip_rect(low, high, True)
            corner = (middle.x - self._centre[0] * size[0] * texel, middle.y - self._centre[1] * size[1] * texel)
            if flat is not None:
                self._image(side, flat, (*corner, size[0] * texel, size[1] * texel), (low, high), ui)
            place, color = ImVec2(low.x + grid(1), low.y + grid(0.5)), INKS["dark"]["a" if side == "a" else "b"]
            draw.add_text(place, packed(color), side.upper())
            draw.pop_clip_rect()
        if wipes:
            draw.add_line(ImVec2(split, at.y), ImVec2(split, at.y + room.y), packed(LINE), 1.5)

    def _image(
        self,
        side: str,
        flat: FlatTexture,
        whole: tuple[float, float, float, float],
        place: tuple[ImVec2, ImVec2],
        ui: UiFrame,
    ) -> None:
        """Draw the visible part of a texture. `whole` is (left, top, width, height) of the whole texture in window units."""
        left, top, width, height = whole
        low, high = place
        seen = ((low.x - left) / width, (low.y - top) / height, (high.x - left) / width, (high.y - top) / height)
        pixels = width * imgui.get_io().display_framebuffer_scale.x
        part = visible_part(flat.mips, seen, pixels, self._parts.get(side))
        if part is None or ui.facts.image is None:
            return
        self._parts[side] = part
        first, above, last, below = part.rectangle
        corner = ImVec2(left + first * width, top + above * height)
        end = ImVec2(left + last * width, top + below * height)
        imgui.get_window_draw_list().add_image(ui.facts.image(f"flat {side}", part.pixels), corner, end)

    def _input(self, at: ImVec2, room: ImVec2, stride: float, extent: tuple[float, float]) -> None:
        """Handle the mouse: zoom, and drags of the texture or the divider. `extent` is the size of the texture in window units."""
        io = imgui.get_io()
        held, hovered = imgui.is_item_active(), imgui.is_item_hovered()
        wipes = self._arrangement == "wipe"
        near = wipes and abs(io.mouse_pos.x - at.x - self._divider * room.x) <= GRAB * imgui.get_style().font_scale_dpi
        if imgui.is_item_activated():
            self._dragging = near
        if (hovered and near) or (held and self._dragging):
            imgui.set_mouse_cursor(imgui.MouseCursor_.resize_ew)
        if held and self._dragging:
            self._divider = min(max((io.mouse_pos.x - at.x) / room.x, 0.0), 1.0)
        elif held:
            self._move(-io.mouse_delta.x / extent[0], -io.mouse_delta.y / extent[1])
        if hovered and io.mouse_wheel:
            x, y = io.mouse_pos.x - at.x, io.mouse_pos.y - at.y
            width = room.x
            if stride:
                x, width = x - stride * (x >= stride), stride
            away = ((x - width / 2.0) / extent[0], (y - room.y / 2.0) / extent[1])
            zoom = min(max(self._zoom * ZOOM_STEP**io.mouse_wheel, 1.0), LARGEST_ZOOM)
            shift = 1.0 - self._zoom / zoom
            self._zoom = zoom
            self._move(away[0] * shift, away[1] * shift)

    def _move(self, x: float, y: float) -> None:
        moved = (self._centre[0] + x, self._centre[1] + y)
        self._centre = (min(max(moved[0], 0.0), 1.0), min(max(moved[1], 0.0), 1.0))
