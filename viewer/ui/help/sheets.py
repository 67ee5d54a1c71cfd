"""Sheets over the window, with two columns and a search field: keys and mouse, and the glossary."""

from collections.abc import Callable, Sequence

from imgui_bundle import imgui

from viewer.commands import COMMANDS, PICTURE_HINTS, bindings
from viewer.commands.keys import HOLD_KEY
from viewer.commands.menus import MENUS
from viewer.state.session import Session
from viewer.ui.facts import UiFrame
from viewer.ui.help.texts import TERMS
from viewer.ui.widgets import DIALOG_FLAGS, em, place_dialog

WIDTH, HEIGHT = 49.0, 62.0
"""Largest size of a sheet in font sizes."""
Rows = Sequence[tuple[str, str]]


class Sheet:
    """Sheet of two columns with a search field."""

    def __init__(
        self,
        title: str,
        label: str,
        rows: Callable[[Session], Rows],
        is_open: Callable[[Session], bool],
        layer: str,
        hint: str,
        tip: str,
    ) -> None:
        """Make a sheet. `label` names it for scripts, `tip` is the tooltip of its title, `rows` returns (word, meaning) and
        ("", heading), `layer` is one of `commands.closing.LAYERS`."""
        self._title, self._label, self._rows = title, label, rows
        self._is_open, self._layer, self._hint, self._tip = is_open, layer, hint, tip
        self._text = ""
        self._was_open = False
        self._typing = False

    def draw(self, ui: UiFrame, size: tuple[float, float], top: float) -> None:
        """Draw the sheet while it is open, below `top` in window units."""
        is_open = self._is_open(ui.session)
        opening, self._was_open = is_open and not self._was_open, is_open
        if not is_open:
            self._typing = False
            return
        place_dialog(size, WIDTH, HEIGHT, top)
        if opening:
            self._text = ""
            imgui.set_next_window_focus()
        opened, stays = imgui.begin(self._title, True, DIALOG_FLAGS)
        # The tooltip belongs to the title, because over the rows it would hide them.
        ui.rects.note(self._label, self._tip)
        if opened:
            self._search(opening, ui)
            self._table(self._rows(ui.session))
        imgui.end()
        # In the frame in which Escape ends typing, only the field receives it.
        if not stays or (self._typing and imgui.is_key_pressed(imgui.Key.escape, repeat=False)):
            ui.emit("window.close-layer", self._layer)

    def _table(self, rows: Rows) -> None:
        if not imgui.begin_table(self._label, 2, imgui.TableFlags_.scroll_y | imgui.TableFlags_.row_bg):
            return
        imgui.table_setup_column("what", imgui.TableColumnFlags_.width_fixed)
        imgui.table_setup_column("meaning", imgui.TableColumnFlags_.width_stretch)
        sought = self._text.lower()
        for name, text in rows:
            if not name and not sought:
                imgui.table_next_row(imgui.TableRowFlags_.headers)
                imgui.table_next_column()
                imgui.text(text)
            elif name and sought in f"{name} {text}".lower():
                imgui.table_next_row()
                imgui.table_next_column()
                imgui.text(name)
                imgui.table_next_column()
                imgui.text_wrapped(text)
        imgui.end_table()

    def _search(self, opening: bool, ui: UiFrame) -> None:
        imgui.set_next_item_width(-em(13.0))
        if opening:
            imgui.set_keyboard_focus_here()
        _, self._text = imgui.input_text_with_hint("##search", "search", self._text)
        self._typing = imgui.is_item_active() or imgui.is_item_deactivated()
        ui.rects.note(f"search {self._label}", "Shows only lines with this text.")
        imgui.same_line()
        imgui.text_disabled(self._hint)


def key_rows(session: Session) -> Rows:
    """Return (key, effect) of all keys by menu, then of the mouse, with a heading before each group."""
    bound = bindings(session.settings.keys)
    left = {command.id: (bound.text(command.id), command.help) for command in COMMANDS if bound.text(command.id)}
    rows: list[tuple[str, str]] = []
    for menu, sections in MENUS.items():
        shown = [left.pop(command.id) for section in sections for command in section if command.id in left]
        rows += [("", menu), *shown] if shown else []
    held = ((HOLD_KEY, "hold: show the other slot"), ("1 to 9", "go to a camera of the scene"))
    return (*rows, ("", "Other keys"), *left.values(), *held, ("", "Mouse"), *PICTURE_HINTS)


def make_sheets() -> tuple[Sheet, ...]:
    """Make the sheets of one window."""
    return (
        Sheet(
            "Keys and mouse",
            "keys",
            key_rows,
            lambda session: session.window.show_help,
            "window.show_help",
            "F1 closes this",
            "All keys and mouse gestures.",
        ),
        Sheet(
            "Glossary",
            "glossary",
            lambda _session: tuple(TERMS.items()),
            lambda session: session.window.show_glossary,
            "window.show_glossary",
            "Escape closes this",
            "Terms of this program.",
        ),
    )
