"""Registry of all commands of the window, for menus, keys, the palette, the help and scripts."""

import difflib
from collections.abc import Mapping
from functools import lru_cache
from typing import Any

from ntc.errors import InputError
from viewer.commands import (
    animation,
    camera,
    closing,
    compare,
    edit,
    files,
    inspection,
    materials,
    overlay,
    training,
    window,
)
from viewer.commands.command import Command, Context, words
from viewer.commands.history import present_state
from viewer.commands.keys import Bindings, bind_keys
from viewer.state.event_handlers import notify
from viewer.state.message_log import details_of

_MODULES = (edit, compare, inspection, overlay, materials, animation, camera, files, closing, training, window)
_ALL = tuple(value for module in _MODULES for value in vars(module).values() if isinstance(value, Command))
COMMANDS = tuple(command for command in _ALL if command.help)
"""Commands with a text form, for menus, palette, scripts and tables. Gestures of mouse and widgets have no text form."""
BY_ID = {command.id: command for command in _ALL}
"""Commands and gestures by id."""
NEXT = {command.steps: command.id for command in COMMANDS if command.steps}
"""Ids of the commands that switch to the next choice, by id of the command that sets the choice."""
REPLACED = {
    "training.accept": "training.keep",
    "training.kept-back": "training.show, training.keep or training.discard",
    "window.close": "file.quit",
}
"""Replacements of commands of earlier versions, by id of the old command."""
PICTURE_HINTS = (
    ("left drag", "orbit; look around when flying"),
    ("right or middle drag", "pan"),
    ("wheel", "zoom; change the speed when flying"),
    ("Ctrl + wheel", "magnify the pixels; Ctrl + drag moves the picture"),
    ("click", "keep the pixel in the open panel Pixel, and with the divergence map the block in the panel Divergence"),
    ("W A S D Q E", "fly; Shift: faster"),
    ("drag the divider", "wipe between A and B; a double-click centres the divider"),
    ("Shift + left drag", "move the sun, in the lit view"),
    ("drop a file", "open a scene or a pack, or light the scene by an .hdr or .exr"),
)
"""Gestures of the mouse over the picture with their effects, for the sheet of keys."""


def find_command(command_id: str) -> Command:
    """Return the command with this id. Raises InputError that names similar ids."""
    for command in COMMANDS:
        if command.id == command_id:
            return command
    if command_id in REPLACED:
        raise InputError(f"{command_id!r}: is no longer a command; use {REPLACED[command_id]}")
    near = difflib.get_close_matches(command_id, [command.id for command in COMMANDS])
    hint = f"; did you mean {' or '.join(near)}?" if near else "; `help.keys` or F1 shows all"
    raise InputError(f"{command_id!r}: no such command{hint}")


def run(context: Context, command_id: str, *values: Any) -> None:
    """Run a command with typed values and carry out its effect. Missing values take their defaults.

    Raises InputError for wrong values, and where a file cannot be read or written.
    """
    command, session = BY_ID[command_id], context.session
    before = present_state(session)
    try:
        effect = command.run(context, values)
        if not command.id.startswith("edit."):
            title = command.title.lower() or command.id.partition(".")[0]
            context.history.note(command.id, title, before, present_state(session), session.scene)
        if effect is not None:
            context.perform(effect)
    except OSError as error:
        raise InputError(f"{command_id}: {error.filename or 'a file'}: {error.strerror or error}") from error


def why_not(context: Context, command_id: str) -> str:
    """Return the reason in one line why a command cannot run now; "" where it can."""
    return BY_ID[command_id].why_not(context)


def run_or_notify(context: Context, command_id: str, *values: Any) -> None:
    """Run a command with typed values; an error becomes a message."""
    try:
        run(context, command_id, *values)
    except InputError as error:
        notify(context.session, str(error), "error", details_of(error))


def run_line(context: Context, line: str) -> None:
    """Run a typed command; an empty line or a comment does nothing. Raises InputError."""
    parts = words(line)
    if parts:
        run(context, parts[0], *find_command(parts[0]).parse(parts[1:]))


def bindings(keys: Mapping[str, str]) -> Bindings:
    """Return the keys of all commands; the user's `keys` (command id: key) replace the default ones."""
    return _bindings(tuple(sorted(keys.items())))


@lru_cache(maxsize=8)
def _bindings(keys: tuple[tuple[str, str], ...]) -> Bindings:
    """Return the bound keys. They are cached, because every frame needs them."""
    return bind_keys(COMMANDS, dict(keys))
