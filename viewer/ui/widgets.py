"""Widgets that panels share: areas, colours, sizes, cards, lists, table cells, labels and tooltips."""

import bisect
import math
import re
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace

import numpy as np
from imgui_bundle import ImVec2, imgui

from viewer.scene.json_text import counted as counted
from viewer.state.palettes import PaletteName, palette_colors, share_of_most
from viewer.ui.theme import GRID

WHITE = (1.0, 1.0, 1.0, 0.9)
SHADE = (0.0, 0.0, 0.0, 0.65)
"""Colours of text (WHITE) and plates (SHADE) over the picture."""


_FLAGS = imgui.WindowFlags_
CARD_FLAGS = _FLAGS.no_title_bar | _FLAGS.no_resize | _FLAGS.always_auto_resize | _FLAGS.no_saved_settings
CARD_FLAGS |= _FLAGS.no_docking | _FLAGS.no_move | _FLAGS.no_focus_on_appearing | _FLAGS.no_nav
"""Window flags of a card over the picture, which is as high as its content."""
DIALOG_FLAGS = _FLAGS.no_collapse | _FLAGS.no_saved_settings | _FLAGS.no_docking | _FLAGS.no_resize | _FLAGS.no_move
"""Window flags of a dialog that `place_dialog` places."""


@contextmanager
def side_bar(name: str, side: imgui.Dir, size: float, padding: ImVec2) -> Iterator[bool]:
    """Draw a bar along an edge of the window; ImGui docks panels inside of it. Yields True where it is visible."""
    style = imgui.get_style()
    flags = imgui.WindowFlags_.no_decoration | imgui.WindowFlags_.no_saved_settings
    flags |= imgui.WindowFlags_.no_nav | imgui.WindowFlags_.no_focus_on_appearing
    imgui.push_style_var(imgui.StyleVar_.window_padding, padding)
    imgui.push_style_var(imgui.StyleVar_.window_min_size, ImVec2(1.0, 1.0))
    imgui.push_style_var(imgui.StyleVar_.window_rounding, 0.0)
    imgui.push_style_color(imgui.Col_.window_bg, style.color_(imgui.Col_.menu_bar_bg))
    opened = imgui.internal.begin_viewport_side_bar(name, imgui.get_main_viewport(), side, size, flags)
    imgui.pop_style_color()
    imgui.pop_style_var(3)
    yield opened
    imgui.end()


def ui_scale() -> float:
    """Return the scale of the interface: window units per unit of normal scale."""
    style = imgui.get_style()
    return float(style.font_scale_main * style.font_scale_dpi)


def grid(units: float) -> float:
    """Return a padding or gap of `units` grid units, in window units."""
    return units * GRID * ui_scale()


def place_dialog(size: tuple[float, float], width: float, height: float = 0.0, top: float = 0.0) -> None:
    """Place the next ImGui window opaque in the middle of a window of `size`, below `top`. Width and height are font sizes, less
    where they do not fit; height 0 is that of the content."""
    low = em(height) and min(em(height), size[1] - top - grid(4))
    imgui.set_next_window_pos(ImVec2(size[0] / 2.0, (top + size[1]) / 2.0), imgui.Cond_.always, ImVec2(0.5, 0.5))
    imgui.set_next_window_size(ImVec2(min(em(width), size[0] - grid(4)), low))
    imgui.set_next_window_bg_alpha(1.0)


def packed(rgba: tuple[float, float, float, float]) -> int:
    """Return a colour as the packed integer of ImGui's draw lists."""
    return imgui.color_convert_float4_to_u32(imgui.ImVec4(*rgba))


def heat(palette: PaletteName, decoders: float, most: int) -> tuple[float, float, float, float]:
    """Return the divergence map's colour of a number of decoders, in sRGB with opacity 1."""
    red, green, blue = palette_colors(palette, np.array(share_of_most(decoders, most))).tolist()
    return red, green, blue, 1.0


@dataclass(frozen=True)
class Area:
    """Rectangle in window units."""

    left: float
    top: float
    right: float
    bottom: float

    @property
    def width(self) -> float:
        """Width along x."""
        return self.right - self.left

    @property
    def height(self) -> float:
        """Height along y."""
        return self.bottom - self.top

    def share_of(self, x: float, y: float) -> tuple[float, float]:
        """Return a position in the window as shares of this area, from its upper left corner."""
        return (x - self.left) / self.width, (y - self.top) / self.height

    def at(self, x: float, y: float) -> tuple[float, float]:
        """Return the position in the window at the shares (x, y) of this area."""
        return self.left + x * self.width, self.top + y * self.height

    def pixels(self, window: tuple[float, float], framebuffer: tuple[int, int]) -> tuple[int, int]:
        """Return the size (width, height) of the area in pixels, at least 1.

        `window` is the size (width, height) of the window in window units, `framebuffer` in pixels.
        """
        width, height = (
            max(1, round(side * pixels / max(units, 1.0)))
            for side, units, pixels in zip((self.width, self.height), window, framebuffer, strict=True)
        )
        return width, height


def draw_plate(
    draw: imgui.ImDrawList, at: ImVec2, text: str, fill: tuple[float, float, float, float] = SHADE, wrap: float = 0.0
) -> tuple[ImVec2, ImVec2]:
    """Draw text on a plate, its upper left corner at `at`. Returns the upper left and lower right corner of the plate."""
    size = imgui.calc_text_size(text, wrap_width=wrap if wrap > 0.0 else -1.0)
    low, high = ImVec2(at.x - grid(2), at.y - grid(1)), ImVec2(at.x + size.x + grid(2), at.y + size.y + grid(1))
    draw.add_rect_filled(low, high, packed(fill), grid(1))
    draw.add_text(imgui.get_font(), imgui.get_font_size(), at, packed(WHITE), text, wrap_width=wrap)
    return low, high


LEAST_CARD = 6.0
"""Least height of a card in font sizes. With less room it is not drawn."""


def card_room(rects: "WidgetRects", area: Area, width: float, on_right: bool) -> Area | None:
    """Return the area for a card over the picture at the left or right of `area`, below names and warnings and above hints; None
    where it is too low."""
    left = area.right - grid(3) - width if on_right else area.left + grid(3)
    room = Area(left, area.top + grid(10), left + width, area.bottom - grid(10))
    warnings = [rects.rectangle(label) for label in rects.labels() if label.startswith("warning ")]
    lows = [low + grid(2) for start, _, end, low in warnings if end > left - grid(2) and start < room.right]
    room = replace(room, top=max([room.top, *lows]))
    return room if room.height >= em(LEAST_CARD) else None


@contextmanager
def card(name: str, room: Area, at_bottom: bool) -> Iterator[None]:
    """Draw a card at the top or bottom of `room`. It scrolls if its content is higher."""
    place = ImVec2(room.left, room.bottom if at_bottom else room.top)
    imgui.set_next_window_pos(place, imgui.Cond_.always, ImVec2(0.0, float(at_bottom)))
    imgui.set_next_window_size_constraints(ImVec2(room.width, 0.0), ImVec2(room.width, room.height))
    imgui.set_next_window_bg_alpha(0.92)
    imgui.begin(name, None, CARD_FLAGS)
    yield
    imgui.end()


TOOLTIP_SECONDS = 0.2
"""Seconds until a frame is drawn for a tooltip: ImGui's delay of 0.15 s, and a little more."""
TOOLTIP_FONT_SIZES = 28.0
"""Largest width of a tooltip in font sizes."""
TALLEST_ROW = 3.0
"""Largest height in font sizes of a widget whose tooltip lies below or above it; else it lies beside the mouse."""
TOOLTIP_IMAGE = 8.0
"""Side of an image in a tooltip, in font sizes."""


def draw_tooltip(text: str, image: imgui.ImTextureRef | None = None, of_item: bool = False) -> None:
    """Draw a tooltip with wrapped lines, below `image`. With `of_item` it does not cover the last item. With an image, which is
    large, it lies beside the panel."""
    low, high = imgui.get_item_rect_min(), imgui.get_item_rect_max()
    if image is not None:
        imgui.set_next_window_pos(ImVec2(imgui.get_window_pos().x + imgui.get_window_width() + grid(2), low.y))
    elif of_item and high.y - low.y < em(TALLEST_ROW):
        padding = 2.0 * imgui.get_style().window_padding.y
        height = imgui.calc_text_size(text, wrap_width=em(TOOLTIP_FONT_SIZES)).y + padding
        fits = high.y + grid(1) + height <= imgui.get_io().display_size.y
        imgui.set_next_window_pos(
            ImVec2(imgui.get_mouse_pos().x, high.y + grid(1) if fits else low.y - grid(1) - height)
        )
    if imgui.begin_tooltip():
        if image is not None:
            imgui.image(image, ImVec2(em(TOOLTIP_IMAGE), em(TOOLTIP_IMAGE)))
        imgui.push_text_wrap_pos(TOOLTIP_FONT_SIZES * imgui.get_font_size())
        imgui.text_unformatted(text)
        imgui.pop_text_wrap_pos()
        imgui.end_tooltip()


class Tooltips:
    """Tooltips of widgets, with the time at which a frame must be drawn to show one."""

    def __init__(self) -> None:
        self._waits = False
        self._due: float | None = None
        """Monotonic time at which a tooltip must appear; None while none is due."""

    def begin(self) -> None:
        """Begin the tooltips of a frame."""
        self._waits = False

    def end(self) -> None:
        """End the tooltips of a frame."""
        if not self._waits:
            self._due = None
        elif self._due is None or self._due <= time.monotonic():
            self._due = time.monotonic() + TOOLTIP_SECONDS

    @property
    def seconds_until_due(self) -> float | None:
        """Seconds until a frame must be drawn to show a tooltip, 0 or less where it is late; None without one."""
        return None if self._due is None else self._due - time.monotonic()

    def show(self, text: Callable[[], str], image: imgui.ImTextureRef | None = None) -> None:
        """Show `text` as the tooltip of the last widget, also of a disabled one. `text` is called only if the mouse is over it."""
        if not imgui.is_item_hovered(imgui.HoveredFlags_.allow_when_disabled):
            return
        shown = text()
        if not shown:
            return
        if not imgui.is_item_hovered(imgui.HoveredFlags_.for_tooltip | imgui.HoveredFlags_.allow_when_disabled):
            self._waits = True
        else:
            draw_tooltip(shown, image, of_item=True)


class WidgetRects:
    """Rectangles of the last frame's labelled widgets in window pixels, with their tooltips."""

    def __init__(self) -> None:
        self._rects: dict[str, tuple[float, float, float, float]] = {}
        self.tips: dict[str, str] = {}
        """Tooltips of the last frame's widgets by label."""
        self.tooltips = Tooltips()

    def begin(self) -> None:
        """Begin a frame: drop all rectangles and tooltips of the last one."""
        self._rects.clear()
        self.tips.clear()
        self.tooltips.begin()

    def note(self, label: str, tip: str, is_open: bool = False, image: imgui.ImTextureRef | None = None) -> None:
        """Record the last widget's rectangle, and show its tooltip `tip`, below `image`.

        `label` names the widget for scripts. An open menu (`is_open`) shows no tooltip, because it would hide the items.
        """
        low, high = imgui.get_item_rect_min(), imgui.get_item_rect_max()
        self._rects[label] = (low.x, low.y, high.x, high.y)
        self.tips[label] = tip
        if not is_open:
            self.tooltips.show(lambda: tip, image)

    def tip(self, text: str) -> None:
        """Show `text` as the tooltip of the last widget, which has no label."""
        self.tooltips.show(lambda: text)

    def note_rectangle(self, label: str, left: float, top: float, right: float, bottom: float) -> None:
        """Record a rectangle that is not a widget."""
        self._rects[label] = (left, top, right, bottom)

    def rectangle(self, label: str) -> tuple[float, float, float, float]:
        """Return (left, top, right, bottom) of a widget. Raises KeyError where the last frame had no such label."""
        return self._rects[label]

    def centre(self, label: str) -> tuple[float, float]:
        """Return the middle of a widget. Raises KeyError where the last frame had no such label."""
        left, top, right, bottom = self._rects[label]
        return (left + right) / 2.0, (top + bottom) / 2.0

    def labels(self) -> tuple[str, ...]:
        """Return the labels of all widgets of the last frame."""
        return tuple(self._rects)


def _allowed(_choice: str) -> str:
    return ""


def combo(
    label: str,
    current: str,
    choices: tuple[str, ...],
    items: WidgetRects,
    tip: str,
    refusal: Callable[[str], str] = _allowed,
    shown: Callable[[str], str] | None = None,
    name: Callable[[str], str] = str,
    about: Callable[[str], str] = _allowed,
) -> str:
    """Draw a drop-down list, and return the chosen text. `refusal` returns the reason why a choice is grey, `name` the text of a
    choice, `shown` its text in the opened list. `tip` is the tooltip of the list; `about` returns that of a choice, "" for `tip`."""
    chosen = current
    opened = imgui.begin_combo(f"##{label}", name(current))
    items.note(label, tip)
    if opened:
        for choice in choices:
            reason = refusal(choice)
            flags = imgui.SelectableFlags_.disabled if reason else 0
            if imgui.selectable(f"{(shown or name)(choice)}##{choice}", choice == current, flags)[0]:
                chosen = choice
            items.note(f"{label}: {name(choice)}", f"Not now: {reason}" if reason else about(choice) or tip)
        if imgui.is_key_pressed(imgui.Key.escape, repeat=False):
            imgui.close_current_popup()
        imgui.end_combo()
    return chosen


@contextmanager
def branch(items: WidgetRects, title: str, label: str, tip: str, is_open: bool = False) -> Iterator[bool]:
    """Draw a heading that unfolds; yields True while it is unfolded. `is_open`: whether it is unfolded at first."""
    unfolded = imgui.tree_node_ex(title, imgui.TreeNodeFlags_.default_open if is_open else 0)
    items.note(label, tip)
    yield unfolded
    if unfolded:
        imgui.tree_pop()


def sort_order() -> tuple[int, bool] | None:
    """Return (column, descending) of the order of the current table; None without an order."""
    specs = imgui.table_get_sort_specs()
    if specs is None or specs.specs_count == 0:
        return None
    spec = specs.get_specs(0)
    return spec.column_user_id, spec.get_sort_direction() == imgui.SortDirection.descending


def decibels(value: float | None) -> str:
    """Return a PSNR in dB as text, without the unit: `38.12`, `equal`, or `-` for None."""
    if value is None:
        return "-"
    return f"{value:.2f}" if math.isfinite(value) else "equal"


def cells(*texts: str) -> None:
    """Draw texts in the next columns of a table's row."""
    for text in texts:
        imgui.table_next_column()
        imgui.text(text)


WORD_ENDS = re.compile(r"(?<=[-_. ])(?=.)|(?<=[a-z])(?=[A-Z])")
"""Positions where a name may be broken: behind `_`, `-`, `.` and spaces, and before a capital letter behind a small one."""


def shortened(text: str, width: float, end: float = 0.0) -> str:
    """Return `text`, shortened with dots to fit into `width` window units. `end` is the share of the shown letters that come from
    its end."""

    def cut(count: int) -> str:
        last = int(end * count)
        return f"{text[: count - last].rstrip()}...{text[len(text) - last :]}" if count else ""

    fitting = bisect.bisect_right(range(1, len(text) + 1), width, key=lambda count: text_width(cut(count)))
    return text if text_width(text) <= width else cut(fitting)


def two_lines(text: str, width: float) -> str:
    """Return `text` on one or two lines of `width` window units, broken between words, and shortened in the middle if needed."""
    ends = [match.start() for match in WORD_ENDS.finditer(text) if text_width(text[: match.start()]) <= width]
    if text_width(text) <= width or not ends:
        return shortened(text, width, 0.5)
    return f"{text[: ends[-1]]}\n{shortened(text[ends[-1] :], width, 0.5)}"


def named_cells(items: WidgetRects, name: str, tip: str, *texts: str) -> None:
    """Draw the name of a figure and its values in the next columns of a table row, all with the tooltip `tip`."""
    imgui.table_next_column()
    imgui.text(name)
    items.note(name, tip)
    for text in texts:
        imgui.table_next_column()
        imgui.text(text)
        items.tip(tip)


def headings(columns: Mapping[str, str], items: WidgetRects) -> None:
    """Draw the headings of a table whose columns are set up. `columns`: tooltip by heading."""
    imgui.table_next_row(imgui.TableRowFlags_.headers)
    for number, (name, tip) in enumerate(columns.items()):
        if imgui.table_set_column_index(number):
            imgui.table_header(name)
            items.note(f"column {name.partition('##')[0] or 'picture'}", tip)


def em(count: float) -> float:
    """Return `count` font sizes in window units."""
    return float(count * imgui.get_font_size())


def text_width(text: str) -> float:
    """Return the width of a line of text in window units."""
    return float(imgui.calc_text_size(text).x)


LABEL_PLACE = 6.0
"""Left edge of fields that have a label before them, in font sizes."""


def labelled(text: str) -> None:
    """Draw the label of a row of fields."""
    imgui.align_text_to_frame_padding()
    imgui.text(text)
    imgui.same_line(em(LABEL_PLACE))


def list_width(*choices: str) -> float:
    """Return the width of a drop-down list that shows each of these texts in full."""
    arrow = imgui.get_frame_height()
    return max(map(text_width, choices)) + arrow + 2.0 * imgui.get_style().frame_padding.x


def box_width(label: str) -> float:
    """Return the width of a check box or a radio button with its label."""
    return text_width(label) + imgui.get_frame_height() + imgui.get_style().item_inner_spacing.x


def beside(width: float) -> None:
    """Continue beside the last item if an item of `width` fits there, else in the next line."""
    imgui.same_line()
    if imgui.get_content_region_avail().x < width:
        imgui.new_line()


def wrapped(text: str, color: imgui.ImVec4) -> None:
    """Draw coloured text over as many lines as it needs."""
    imgui.push_style_color(imgui.Col_.text, color)
    imgui.text_wrapped(text)
    imgui.pop_style_color()


def wrapped_disabled(text: str) -> None:
    """Draw faint text over as many lines as it needs."""
    wrapped(text, imgui.get_style().color_(imgui.Col_.text_disabled))


def disabled_beside(text: str) -> None:
    """Draw faint text beside the last item if it fits there, else below it over as many lines as it needs."""
    beside(text_width(text))
    wrapped_disabled(text)
