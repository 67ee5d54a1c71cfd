"""Tooltips of labelled widgets, columns and figures."""

import re

from viewer.commands import COMMANDS
from viewer.commands.command import Command
from viewer.commands.keys import Bindings
from viewer.ui.help.texts import COMMAND_OF, CONTROLS, FIGURES, FORMATS, VALUES

_BY_ID = {command.id: command for command in COMMANDS}
_COMMAND_PREFIXES = ("menu: ", "palette: ")
"""Prefixes of labels that name a command, and maybe values for it."""


def sentence(text: str) -> str:
    """Return `text` with a capital letter and a full stop."""
    return f"{text[:1].upper()}{text[1:]}{'' if text.endswith(('.', '?', '!')) else '.'}" if text else ""


def command_text(command: Command, bound: Bindings) -> str:
    """Return the help of a command with its key."""
    key = bound.text(command.id)
    return sentence(command.help) + (f"\nKey: {key}" if key else "")


def value_text(value: str) -> str:
    """Return the explanation of an entry of a list; "" for names that explain themselves and names of the scene."""
    if value in VALUES:
        return VALUES[value]
    return next((text for start, text in FORMATS.items() if value.startswith(start)), "")


def explanation(label: str, bound: Bindings) -> str:
    """Return the explanation of a label with its key; "" for none.

    A number in a label counts as `#`, a leading `A` or `B` as `slot`. Other labels take the explanation of their first words.
    """
    for prefix in _COMMAND_PREFIXES:
        if label.startswith(prefix) and label.removeprefix(prefix).partition(" ")[0] in _BY_ID:
            return _of_command(label.removeprefix(prefix), bound)
    for name in (label, re.sub(r"\d+", "#", label), re.sub("^[AB] ", "slot ", label)):
        if text := _own(name, bound):
            return text
    list_label, colon, value = label.partition(": ")
    if colon:
        return value_text(value) or explanation(list_label, bound)
    words = label.split(" ")
    return next((found for end in range(len(words) - 1, 0, -1) if (found := _own(" ".join(words[:end]), bound))), "")


def _own(label: str, bound: Bindings) -> str:
    """Return the explanation of exactly this label."""
    command = _BY_ID.get(COMMAND_OF.get(label, ""))
    text = CONTROLS.get(label) or FIGURES.get(label, "")
    if command is None:
        return text
    key = bound.text(command.id)
    return f"{text}\nKey: {key}" if text and key else text or command_text(command, bound)


def _of_command(words: str, bound: Bindings) -> str:
    """Return the explanation of the last value in `words`, else the help of the command."""
    command_id, _, values = words.partition(" ")
    of_value = value_text(values.rpartition(" ")[2]) if values else ""
    return of_value or command_text(_BY_ID[command_id], bound)
