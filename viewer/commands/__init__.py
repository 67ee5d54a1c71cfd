"""Every command of the window: one registry feeds menus, keys, the palette, the help, scripts and README's key table."""

import difflib
from collections.abc import Mapping, Sequence
from functools import lru_cache

from ntc.errors import InputError
from viewer.commands import (
    appearance,
    camera,
    compare,
    errors,
    explore,
    motion,
    overlay,
    pictures,
    training,
    views,
    window,
)
from viewer.commands.bindings import HOLD_KEY, Bindings, bind_keys
from viewer.commands.command import Command, FixedChoices, words
from viewer.state.session import Session

COMMANDS: tuple[Command, ...] = (
    *compare.COMMANDS,
    *errors.COMMANDS,
    *overlay.COMMANDS,
    *camera.COMMANDS,
    *explore.COMMANDS,
    *motion.COMMANDS,
    *pictures.COMMANDS,
    *views.COMMANDS,
    *training.COMMANDS,
    *window.COMMANDS,
    *appearance.COMMANDS,
)
PICTURE_HINTS = (
    ("left drag", "orbit, or look round when flying"),
    ("right or middle drag", "pan"),
    ("wheel", "nearer, farther; speed when flying"),
    ("Ctrl + wheel", "look at the pixels themselves; Ctrl + drag moves them"),
    (
        "click",
        "keep the pixel under the mouse in the panel Pixel, and with the heatmap its block in the panel Divergence",
    ),
    ("W A S D Q E", "fly; Shift: faster"),
    ("drag the divider", "wipe between A and B; double-click recentres it"),
    ("drop a file", "open a .gltf, .glb or .ntc"),
)
"""What the mouse does, for the help."""


def find_command(command_id: str) -> Command:
    """The command with this id. Raises InputError that names the nearest ones."""
    for command in COMMANDS:
        if command.id == command_id:
            return command
    near = difflib.get_close_matches(command_id, [command.id for command in COMMANDS])
    hint = f"; did you mean {' or '.join(near)}?" if near else "; `help.keys` or F1 shows all"
    raise InputError(f"{command_id!r}: no such command{hint}")


def run_command(command_id: str, arguments: Sequence[str], session: Session) -> None:
    """Run a command. Raises InputError for one that does not exist, for arguments that do not fit, and where files fail."""
    command = find_command(command_id)
    try:
        command.run(session, *command.values(arguments, session))
    except OSError as error:
        raise InputError(f"{command_id}: {error.filename or 'a file'}: {error.strerror or error}") from error


def run_line(line: str, session: Session) -> None:
    """Run a command as it is typed; nothing for an empty line or a comment. Raises InputError."""
    parts = words(line)
    if parts:
        run_command(parts[0], parts[1:], session)


def bindings(keys: Mapping[str, str]) -> Bindings:
    """Which key runs which command, with the user's `keys` (command id: key) in the place of the commands' own."""
    return _bindings(tuple(sorted(keys.items())))


@lru_cache(maxsize=8)
def _bindings(keys: tuple[tuple[str, str], ...]) -> Bindings:
    """Asked for in every frame, and the same until the settings change."""
    return bind_keys(COMMANDS, dict(keys))


def key_table(bound: Bindings) -> tuple[tuple[str, str], ...]:
    """(key, what it does) of everything that has a key or is done with the mouse, keys first."""
    keys = tuple((bound.text(command.id), command.help) for command in COMMANDS if bound.text(command.id))
    return ((HOLD_KEY, "hold: show the other slot"), *keys, ("1 to 9", "go to a camera of the scene"), *PICTURE_HINTS)


def key_table_markdown() -> str:
    """The key table of README."""
    rows = [f"| {key} | {description} |" for key, description in key_table(bindings({}))]
    return "\n".join(["| key or mouse | what it does |", "|---|---|", *rows])


def command_table_markdown() -> str:
    """The table of commands of docs/scripts.md."""
    bound = bindings({})
    rows = [f"| `{c.usage}` | {c.help} | {_parameters(c)} | {bound.text(c.id)} |" for c in COMMANDS]
    return "\n".join(["| command | what it does | parameters | key |", "|---|---|---|---|", *rows])


def _parameters(command: Command) -> str:
    parts = []
    for parameter in command.parameters:
        choices = parameter.choices.names if isinstance(parameter.choices, FixedChoices) else ()
        what = " \\| ".join(f"`{choice}`" for choice in choices) or parameter.help
        parts.append(f"{parameter.name.upper()}: {what}" + (f" ({parameter.default})" if parameter.default else ""))
    return "; ".join(parts)
