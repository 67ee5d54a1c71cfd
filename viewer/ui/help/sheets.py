"""Sheets of two columns over the window, with a field to search them: keys and mouse, and the glossary."""

from collections.abc import Callable, Sequence

from imgui_bundle import ImVec2, imgui

from viewer.commands import bindings, key_table
from viewer.state.session import Session
from viewer.ui.facts import UiFrame
from viewer.ui.help.glossary import TERMS

WIDTH, HEIGHT = 640.0, 800.0
"""Largest, in window units at normal scale."""
Rows = Sequence[tuple[str, str]]


class Sheet:
    """Remembers what is searched for."""

    def __init__(
        self,
        title: str,
        label: str,
        rows: Callable[[Session], Rows],
        is_open: Callable[[Session], bool],
        layer: str,
        hint: str,
    ) -> None:
        """`label` names it for scripts, `rows` are what it and what it means, `layer` is one of `viewer.commands.leaving.LAYERS`."""
        self._title, self._label, self._rows = title, label, rows
        self._is_open, self._layer, self._hint = is_open, layer, hint
        self._text = ""
        self._was_open = False
        self._typing = False

    def draw(self, ui: UiFrame, size: tuple[float, float], top: float) -> None:
        """The sheet, while the session has it open; below `top` in window units."""
        is_open = self._is_open(ui.session)
        opening, self._was_open = is_open and not self._was_open, is_open
        if not is_open:
            self._typing = False
            return
        scale = imgui.get_font_size() / 13.0
        middle = ImVec2(size[0] / 2.0, (top + size[1]) / 2.0)
        imgui.set_next_window_pos(middle, imgui.Cond_.always, ImVec2(0.5, 0.5))
        extent = ImVec2(min(WIDTH * scale, size[0] - 16.0), min(HEIGHT * scale, size[1] - top - 16.0))
        imgui.set_next_window_size(extent)
        imgui.set_next_window_bg_alpha(1.0)
        flags = imgui.WindowFlags_
        if opening:
            self._text = ""
            imgui.set_next_window_focus()
        opened, stays = imgui.begin(
            self._title, True, flags.no_collapse | flags.no_saved_settings | flags.no_docking | flags.no_resize
        )
        if opened:
            self._search(opening, ui)
            self._table(self._rows(ui.session))
            ui.rects.note(self._label)
        imgui.end()
        # The field owns the key in the frame in which it ends the typing.
        if not stays or (self._typing and imgui.is_key_pressed(imgui.Key.escape, repeat=False)):
            ui.emit("window.close-layer", self._layer)

    def _table(self, rows: Rows) -> None:
        if not imgui.begin_table(self._label, 2, imgui.TableFlags_.scroll_y | imgui.TableFlags_.row_bg):
            return
        imgui.table_setup_column("what", imgui.TableColumnFlags_.width_fixed)
        imgui.table_setup_column("meaning", imgui.TableColumnFlags_.width_stretch)
        sought = self._text.lower()
        for name, text in rows:
            if sought in f"{name} {text}".lower():
                imgui.table_next_row()
                imgui.table_next_column()
                imgui.text(name)
                imgui.table_next_column()
                imgui.text_wrapped(text)
        imgui.end_table()

    def _search(self, opening: bool, ui: UiFrame) -> None:
        imgui.set_next_item_width(-13.0 * imgui.get_font_size())
        if opening:
            imgui.set_keyboard_focus_here()
        _, self._text = imgui.input_text_with_hint("##search", "search", self._text)
        self._typing = imgui.is_item_active() or imgui.is_item_deactivated()
        ui.rects.note(f"search {self._label}")
        imgui.same_line()
        imgui.text_disabled(self._hint)


def make_sheets() -> tuple[Sheet, ...]:
    """The sheets of one window."""
    return (
        Sheet(
            "Keys and mouse",
            "keys",
            lambda session: key_table(bindings(session.settings.keys)),
            lambda session: session.window.show_help,
            "window.show_help",
            "F1 closes this",
        ),
        Sheet(
            "Words of this program",
            "glossary",
            lambda _session: TERMS,
            lambda session: session.window.show_glossary,
            "window.show_glossary",
            "Escape closes this",
        ),
    )
