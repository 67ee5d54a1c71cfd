"""Record of every text that the window draws, with its extent, and a check for texts that are cut or overlap."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import wraps
from typing import Any

import pytest
from imgui_bundle import imgui

Rectangle = tuple[float, float, float, float]
"""Left, top, right and bottom in window units."""
TOLERANCE = 1.0
"""Window units: positions are rounded."""


@dataclass(frozen=True)
class Drawn:
    """Text of the last frame, with its extent."""

    window: str
    text: str
    needs: Rectangle
    """Rectangle of the whole text."""
    has: Rectangle
    """Rectangle that clips the text."""

    @property
    def is_cut(self) -> bool:
        """Return whether a visible line is clipped at its left or right end. A line that is scrolled away is not cut."""
        in_sight = self.needs[1] < self.has[3] - TOLERANCE and self.needs[3] > self.has[1] + TOLERANCE
        return in_sight and (self.needs[2] > self.has[2] + TOLERANCE or self.needs[0] < self.has[0] - TOLERANCE)

    @property
    def seen(self) -> Rectangle:
        """Return the visible part of the rectangle."""
        first, second = self.needs, self.has
        return (max(first[0], second[0]), max(first[1], second[1]), min(first[2], second[2]), min(first[3], second[3]))

    def overlaps(self, other: "Drawn") -> bool:
        """Return whether two texts overlap."""
        mine, theirs = self.seen, other.seen
        width = min(mine[2], theirs[2]) - max(mine[0], theirs[0])
        height = min(mine[3], theirs[3]) - max(mine[1], theirs[1])
        return self.window == other.window and width > TOLERANCE and height > TOLERANCE


def _name(label: str) -> str:
    return label.partition("##")[0]


def _item() -> Rectangle:
    low, high = imgui.get_item_rect_min(), imgui.get_item_rect_max()
    return low.x, low.y, high.x, high.y


def _clip() -> Rectangle:
    draw = imgui.get_window_draw_list()
    low, high = draw.get_clip_rect_min(), draw.get_clip_rect_max()
    return low.x, low.y, high.x, high.y


class TextExtents:
    """Wrappers of ImGui's functions that draw text. Clear `drawn` before the frame to check."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.drawn: list[Drawn] = []
        framed = imgui.get_style
        plain, boxed = self._plain, self._boxed
        padding = lambda: 2.0 * framed().frame_padding.x  # noqa: E731
        arrow = imgui.get_frame_height
        makers: dict[str, Callable[[Callable[..., Any]], Callable[..., Any]]] = {
            "text": lambda f: plain(f, lambda a: a[0]),
            "text_disabled": lambda f: plain(f, lambda a: a[0]),
            "text_colored": lambda f: plain(f, lambda a: a[1]),
            "button": lambda f: boxed(f, lambda a: _name(a[0]), padding),
            "small_button": lambda f: boxed(f, lambda a: _name(a[0]), padding),
            "checkbox": lambda f: boxed(f, lambda a: _name(a[0]), arrow),
            "radio_button": lambda f: boxed(f, lambda a: _name(a[0]), arrow),
            "begin_combo": lambda f: boxed(f, lambda a: a[1], lambda: padding() + arrow(), lambda result: not result),
            "slider_float": lambda f: boxed(f, lambda a: (a[4] if len(a) > 4 else "%.3f") % a[1], padding),
            "input_text": lambda f: boxed(f, lambda a: a[1], padding),
            "input_text_with_hint": lambda f: boxed(f, lambda a: a[2] or a[1], padding),
            "table_header": lambda f: boxed(f, lambda a: _name(a[0]), lambda: 0.0),
            "tree_node": lambda f: boxed(f, lambda a: _name(a[0]), lambda: imgui.get_font_size() + padding()),
            "tree_node_ex": lambda f: boxed(f, lambda a: _name(a[0]), lambda: imgui.get_font_size() + padding()),
            "selectable": lambda f: plain(f, lambda a: _name(a[0])),
        }
        for name, wrap in makers.items():
            monkeypatch.setattr(imgui, name, wrap(getattr(imgui, name)))

    def _note(self, text: str, needs: Rectangle, has: Rectangle) -> None:
        if text:
            self.drawn.append(Drawn(imgui.internal.get_current_window().name, text, needs, has))

    def _plain(self, function: Callable[..., Any], text_of: Callable[[Any], str]) -> Callable[..., Any]:
        """A function that draws text without a frame."""

        @wraps(function)
        def call(*arguments: Any, **named: Any) -> Any:
            at = imgui.get_cursor_screen_pos()
            result = function(*arguments, **named)
            text, item = text_of(arguments), _item()
            if imgui.is_rect_visible(imgui.get_item_rect_min(), imgui.get_item_rect_max()):
                extent = imgui.calc_text_size(text)
                left = max(item[0], at.x)
                self._note(text, (left, item[1], left + extent.x, item[1] + extent.y), _clip())
            return result

        return call

    def _boxed(
        self,
        function: Callable[..., Any],
        text_of: Callable[[Any], str],
        around: Callable[[], float],
        is_one: Callable[[Any], bool] = lambda _: True,
    ) -> Callable[..., Any]:
        """Wrap a function that draws text in a frame; `around`: width of the frame beside the text."""

        @wraps(function)
        def call(*arguments: Any, **named: Any) -> Any:
            result = function(*arguments, **named)
            if is_one(result) and imgui.is_rect_visible(imgui.get_item_rect_min(), imgui.get_item_rect_max()):
                item, clip, text = _item(), _clip(), text_of(arguments)
                width = max(imgui.calc_text_size(text).x + around(), item[2] - item[0]) if text else item[2] - item[0]
                has = (clip[0], clip[1], min(clip[2], item[2]), clip[3])
                self._note(text or "(field)", (item[0], item[1], item[0] + width, item[3]), has)
            return result

        return call

    def problems(self) -> list[str]:
        """Return the faults of the texts as lines."""
        cut = [f"cut: {d.text!r} needs {d.needs[2] - d.has[2]:.0f} more in {d.window}" for d in self.drawn if d.is_cut]
        over = [
            f"overlap: {first.text!r} and {second.text!r} in {first.window}"
            for number, first in enumerate(self.drawn)
            for second in self.drawn[number + 1 :]
            if first.overlaps(second)
        ]
        return [*dict.fromkeys(cut), *dict.fromkeys(over)]
