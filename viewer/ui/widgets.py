"""What several panels share: rectangles, colours, a drop-down list, and where labelled widgets are."""

from dataclasses import dataclass

import numpy as np
from imgui_bundle import imgui

from viewer.state.palettes import PaletteName, palette_colors, share_of_most

SLOT_COLORS = {"a": (0.35, 0.65, 1.0, 1.0), "b": (1.0, 0.6, 0.25, 1.0)}
"""Blue for A and orange for B: told apart by every kind of colour vision."""


def packed(rgba: tuple[float, float, float, float]) -> int:
    """A colour as ImGui's draw lists take it."""
    return imgui.color_convert_float4_to_u32(imgui.ImVec4(*rgba))


def heat(palette: PaletteName, decoders: float, most: int) -> tuple[float, float, float, float]:
    """sRGB and opacity 1: the map's colour of a number of decoders."""
    red, green, blue = palette_colors(palette, np.array(share_of_most(decoders, most))).tolist()
    return red, green, blue, 1.0


@dataclass(frozen=True)
class Area:
    """A rectangle in window units."""

    left: float
    top: float
    right: float
    bottom: float

    @property
    def width(self) -> float:
        """Along x."""
        return self.right - self.left

    @property
    def height(self) -> float:
        """Along y."""
        return self.bottom - self.top

    def share_of(self, x: float, y: float) -> tuple[float, float]:
        """A place of the window as shares of this rectangle, from its upper left corner."""
        return (x - self.left) / self.width, (y - self.top) / self.height

    def at(self, x: float, y: float) -> tuple[float, float]:
        """The place of the window that is (x, y) as shares of this rectangle."""
        return self.left + x * self.width, self.top + y * self.height

    def pixels(self, window: tuple[float, float], framebuffer: tuple[int, int]) -> tuple[int, int]:
        """(width, height) in pixels, at least 1.

        The window is `window` (width, height) large in its own units, and `framebuffer` in pixels.
        """
        width, height = (
            max(1, round(side * pixels / max(units, 1.0)))
            for side, units, pixels in zip((self.width, self.height), window, framebuffer, strict=True)
        )
        return width, height


class WidgetRects:
    """Rectangles of the last frame's labelled widgets, in window pixels."""

    def __init__(self) -> None:
        self._rects: dict[str, tuple[float, float, float, float]] = {}

    def clear(self) -> None:
        """Remove those of the last frame."""
        self._rects.clear()

    def note(self, label: str) -> None:
        """Record the last widget's rectangle."""
        low, high = imgui.get_item_rect_min(), imgui.get_item_rect_max()
        self._rects[label] = (low.x, low.y, high.x, high.y)

    def note_rectangle(self, label: str, left: float, top: float, right: float, bottom: float) -> None:
        """Record a rectangle that is no widget."""
        self._rects[label] = (left, top, right, bottom)

    def centre(self, label: str) -> tuple[float, float]:
        """Middle of a widget. Raises KeyError when the last frame had none of that label."""
        left, top, right, bottom = self._rects[label]
        return (left + right) / 2.0, (top + bottom) / 2.0

    def labels(self) -> tuple[str, ...]:
        """Labels of all widgets of the last frame."""
        return tuple(self._rects)


def combo(label: str, current: str, choices: tuple[str, ...], items: WidgetRects) -> str:
    """A drop-down list; the chosen text."""
    chosen = current
    opened = imgui.begin_combo(f"##{label}", current)
    items.note(label)
    if opened:
        for choice in choices:
            if imgui.selectable(choice, choice == current)[0]:
                chosen = choice
            items.note(f"{label}: {choice}")
        if imgui.is_key_pressed(imgui.Key.escape, repeat=False):
            imgui.close_current_popup()
        imgui.end_combo()
    return chosen


def cells(*texts: str) -> None:
    """Texts in the next columns of a table's row."""
    for text in texts:
        imgui.table_next_column()
        imgui.text(text)


def counted(number: int, noun: str) -> str:
    """`1 texture`, `2 textures`."""
    return f"{number:,} {noun}" if number == 1 else f"{number:,} {noun}s"
