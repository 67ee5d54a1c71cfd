"""Command palette: the user types to search a command, then gives its arguments one by one."""

from collections.abc import Sequence
from dataclasses import dataclass

from imgui_bundle import ImVec2, imgui

from ntc.errors import InputError
from viewer.commands import COMMANDS, bindings, find_command
from viewer.commands.command import Command, Parameter
from viewer.state.setting import sentence
from viewer.ui.controls import explained
from viewer.ui.facts import UiFrame
from viewer.ui.help.texts import choice_text
from viewer.ui.theme import icon, ink
from viewer.ui.widgets import em, grid, place_dialog, shortened, wrapped


def score(query: str, text: str) -> float | None:
    """Return the score of `text` for `query`, higher for a better match; None where its letters do not occur in this order.

    An equal text scores most, then one that begins with the query, one with it at the start of a word, and one with it anywhere.
    Otherwise the letters may be spread (fuzzy match), and gaps between them cost points. Shorter texts win ties.
    """
    query, text = query.lower(), text.lower()
    if query == text:
        return 100.0
    at = text.find(query)
    if at >= 0:
        starts_word = at == 0 or not text[at - 1].isalnum()
        return (80.0 if at == 0 else 60.0 if starts_word else 40.0) - 0.01 * len(text)
    position, gaps = -1, 0
    for letter in query:
        at = text.find(letter, position + 1)
        if at < 0:
            return None
        gaps += at - position - 1 if position >= 0 else 0
        position = at
    return 20.0 - gaps - 0.01 * len(text)


def best_first(query: str, commands: Sequence[Command]) -> tuple[Command, ...]:
    """Return the commands that match all words of `query` in any order, best first; for an empty query, all commands."""
    parts = query.split()
    ranked: list[tuple[float, int, Command]] = []
    for index, command in enumerate(commands):
        total = 0.0
        for part in parts:
            # Help texts match only whole words: in prose, spread letters match nearly always.
            fits = [score(part, command.id), score(part, command.title)]
            if part.lower() in command.help.lower():
                fits.append(10.0)
            known = [fit for fit in fits if fit is not None]
            if not known:
                break
            total += max(known)
        else:
            ranked.append((-total, index, command))
    return tuple(command for _, _, command in sorted(ranked, key=lambda entry: entry[:2]))


WIDTH = 48.0
"""Largest width of the palette in font sizes."""
ICON_ROOM = 1.75
"""Width of the column of icons in font sizes."""
TOP_SHARE = 0.12
ROWS_SHARE = 0.6
"""Largest height of the list, as a share of the window."""
LABEL = "palette: "
"""Prefix of the labels of entries: `palette: compare.mode`, `palette: wipe`."""
FIELD_FLAGS = imgui.InputTextFlags_.enter_returns_true | imgui.InputTextFlags_.auto_select_all


@dataclass(frozen=True)
class _Row:
    """Entry of the palette's list."""

    value: str
    """Id of a command, or an argument."""
    text: str
    note: str = ""
    key: str = ""
    icon: str = ""
    refusal: str = ""
    """Reason why the entry cannot be taken now; "" where it can."""


def _shown_name(parameter: Parameter) -> str:
    """Return the name of a parameter with spaces."""
    return parameter.name.replace("_", " ")


class Palette:
    """Palette with the command and the arguments chosen so far."""

    def __init__(self) -> None:
        self._was_open: str | None = None
        self._command: Command | None = None
        self._arguments: tuple[str, ...] = ()
        self._text = ""
        self._selected = 0
        self._problem = ""
        self._step = 0
        """Number in the text field's id. A new id replaces the field, because ImGui ignores new text of an active one."""
        self._focus = False

    def draw(self, ui: UiFrame, size: tuple[float, float]) -> None:
        """Draw the palette while it is open."""
        if ui.session.window.palette != self._was_open:
            self._was_open = ui.session.window.palette
            self._begin(find_command(ui.session.window.palette) if ui.session.window.palette else None, ui)
        if ui.session.window.palette is None:
            return
        place_dialog(size, WIDTH)
        imgui.set_next_window_pos(ImVec2(size[0] / 2.0, size[1] * TOP_SHARE), imgui.Cond_.always, ImVec2(0.5, 0.0))
        flags = imgui.WindowFlags_
        imgui.set_next_window_focus()
        imgui.begin(
            "##palette",
            None,
            flags.no_decoration | flags.no_move | flags.no_saved_settings | flags.no_docking | flags.always_auto_resize,
        )
        rows = self._rows(ui)
        chosen = self._field(rows, ui)
        clicked = self._list(rows, size[1] * ROWS_SHARE, ui)
        outside = imgui.is_mouse_clicked(imgui.MouseButton_.left) and not imgui.is_window_hovered(
            imgui.HoveredFlags_.root_and_child_windows | imgui.HoveredFlags_.allow_when_blocked_by_active_item
        )
        imgui.end()
        if imgui.is_key_pressed(imgui.Key.escape, repeat=False) or (outside and clicked is None):
            self._close(ui)
            return
        answer = clicked if clicked is not None else chosen
        if answer is not None:
            self._answer(answer, ui)

    def _begin(self, command: Command | None, ui: UiFrame) -> None:
        self._command, self._arguments = command, ()
        self._next_step(ui)

    def _next_step(self, ui: UiFrame) -> None:
        suggestion = self._parameter.arg.suggestion if self._parameter is not None else None
        self._text = suggestion(ui.session) if suggestion is not None else ""
        self._selected, self._problem = 0, ""
        self._step += 1
        self._focus = True

    def _close(self, ui: UiFrame) -> None:
        # A command may open the palette again within the same frame.
        self._was_open = None
        ui.emit("palette.set", None)

    @property
    def _parameter(self) -> Parameter | None:
        return self._command.parameters[len(self._arguments)] if self._command is not None else None

    def _rows(self, ui: UiFrame) -> tuple[_Row, ...]:
        parameter = self._parameter
        if parameter is None:
            bound = bindings(ui.session.settings.keys)
            return tuple(
                _Row(c.id, c.title, c.help, bound.text(c.id), icon(c.icon), ui.why_not(c.id))
                for c in best_first(self._text, COMMANDS)
            )
        options = parameter.options(ui.session)
        fits = [(score(self._text, option), option) for option in options]
        return tuple(
            _Row(option, option, choice_text(parameter, option), refusal=parameter.refusal(ui.session, option))
            for fit, option in sorted(fits, key=lambda f: -(f[0] or 0.0))
            if fit is not None
        )

    def _field(self, rows: tuple[_Row, ...], ui: UiFrame) -> str | None:
        """Draw the text field. Returns the choice on Enter, else None."""
        parameter = self._parameter
        if self._command is not None and parameter is not None:
            imgui.text(" ".join((self._command.title, *self._arguments)))
            imgui.same_line()
            imgui.text_disabled(f"{_shown_name(parameter)}: {parameter.arg.help}")
        hint = "find a command" if parameter is None else parameter.default_text or _shown_name(parameter)
        imgui.set_next_item_width(-1.0)
        if self._focus:
            imgui.set_keyboard_focus_here()
            self._focus = False
        entered, text = imgui.input_text_with_hint(f"##field{self._step}", hint, self._text, FIELD_FLAGS)
        ui.rects.note("palette", "Part of a command's name. Up and Down choose a line, Enter takes it.")
        if text != self._text:
            self._text, self._selected, self._problem = text, 0, ""
        if self._problem:
            wrapped(self._problem, ink("error"))
        for key, step in ((imgui.Key.down_arrow, 1), (imgui.Key.up_arrow, -1)):
            if rows and imgui.is_key_pressed(key):
                self._selected = (self._selected + step) % len(rows)
        if not entered:
            return None
        # Enter takes the focus from the field, so it is set again.
        self._focus = True
        if rows and (parameter is None or parameter.is_choice):
            return rows[min(self._selected, len(rows) - 1)].value
        if parameter is None:
            self._problem = f"no command matches {self._text!r}"
            return None
        if not self._text and parameter.default_text is None:
            self._problem = f"{_shown_name(parameter)}: {parameter.arg.help}"
            return None
        return self._text or parameter.default_text or ""

    def _list(self, rows: tuple[_Row, ...], height: float, ui: UiFrame) -> str | None:
        """Draw the list. Returns a clicked entry, else None."""
        if not rows:
            if self._parameter is None or self._parameter.is_choice:
                imgui.text_disabled("nothing found")
                ui.rects.note("nothing found", "No entry has all these words.")
            return None
        line = imgui.get_text_line_height_with_spacing()
        imgui.begin_child("##rows", ImVec2(0.0, min(len(rows) * line + grid(1), height)))
        clicked = None
        moved = imgui.get_io().mouse_delta.x != 0.0 or imgui.get_io().mouse_delta.y != 0.0
        # One row is marked, by the mouse or the arrow keys.
        imgui.push_style_color(imgui.Col_.header_hovered, imgui.get_style_color_vec4(imgui.Col_.header))
        for index, row in enumerate(rows):
            is_selected = index == self._selected
            if not is_selected:
                imgui.push_style_color(imgui.Col_.header_hovered, imgui.ImVec4(0.0, 0.0, 0.0, 0.0))
            if imgui.selectable(f"##{row.value}", is_selected)[0]:
                clicked = row.value
            if not is_selected:
                imgui.pop_style_color()
            if moved and imgui.is_item_hovered():
                self._selected = index
            text = f"{sentence(row.note)}\nKey: {row.key}" if row.key else sentence(row.note)
            ui.rects.note(f"{LABEL}{row.value}", explained(text, row.refusal))
            if index == self._selected and not imgui.is_item_visible():
                imgui.set_scroll_here_y(0.5)
            write = imgui.text_disabled if row.refusal else imgui.text
            imgui.same_line(grid(2))
            if self._command is None:
                write(row.icon)
                imgui.same_line(grid(2) + em(ICON_ROOM))
            write(row.text)
            key_left = imgui.get_window_width() - imgui.calc_text_size(row.key).x - grid(5)
            if row.note:
                imgui.same_line()
                imgui.text_disabled(shortened(row.note, key_left - imgui.get_cursor_pos_x() - grid(2)))
            if row.key:
                imgui.same_line(key_left)
                imgui.text_disabled(row.key)
        imgui.pop_style_color()
        imgui.end_child()
        return clicked

    def _answer(self, answer: str, ui: UiFrame) -> None:
        """Take a command or an argument. A command with all arguments is run."""
        if self._command is None:
            if reason := ui.why_not(answer):
                self._problem = f"{find_command(answer).title}: {reason}"
                return
            self._command = find_command(answer)
        else:
            parameter = self._parameter
            assert parameter is not None
            try:
                parameter.checked(parameter.parse(answer), ui.session)
            except InputError as error:
                self._problem = str(error)
                return
            self._arguments = (*self._arguments, answer)
        if len(self._arguments) < len(self._command.parameters):
            self._next_step(ui)
            return
        command, arguments = self._command, self._arguments
        self._close(ui)
        ui.emit(command.id, *command.parse(arguments))
