"""Notes every text that the window's content draws with the place it needs, and says which are cut or overlap another one."""

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
    """A text of the last frame."""

    window: str
    text: str
    needs: Rectangle
    """Where it is, whole."""
    has: Rectangle
    """Where it may be seen."""

    @property
    def is_cut(self) -> bool:
        """Whether part of a line in sight lies beyond its left or right end. What is scrolled out of sight is not cut."""
        in_sight = self.needs[1] < self.has[3] - TOLERANCE and self.needs[3] > self.has[1] + TOLERANCE
        return in_sight and (self.needs[2] > self.has[2] + TOLERANCE or self.needs[0] < self.has[0] - TOLERANCE)

    @property
    def seen(self) -> Rectangle:
        """What of it is in sight."""
        first, second = self.needs, self.has
        return (max(first[0], second[0]), max(first[1], second[1]), min(first[2], second[2]), min(first[3], second[3]))

    def overlaps(self, other: "Drawn") -> bool:
        """Whether the two are drawn over one another."""
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
    """Wraps ImGui's functions that draw text; `drawn` is to be cleared before the frame that is to be judged."""

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
        """A function that draws text in a frame of its own; `around`: width of the frame that is no text."""

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
        """What is wrong with the texts, in words."""
        cut = [f"cut: {d.text!r} needs {d.needs[2] - d.has[2]:.0f} more in {d.window}" for d in self.drawn if d.is_cut]
        over = [
            f"overlap: {first.text!r} and {second.text!r} in {first.window}"
            for number, first in enumerate(self.drawn)
            for second in self.drawn[number + 1 :]
            if first.overlaps(second)
        ]
        return [*dict.fromkeys(cut), *dict.fromkeys(over)]
