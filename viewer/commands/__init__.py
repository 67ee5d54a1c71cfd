"""Every command of the window: one registry feeds menus, keys, the palette, the help, scripts and README's key table."""

import difflib
from collections.abc import Sequence

from ntc.errors import InputError
from viewer.commands import camera, compare, overlay, training, window
from viewer.commands.command import Command, words
from viewer.session import Session

COMMANDS: tuple[Command, ...] = (
    *compare.COMMANDS,
    *overlay.COMMANDS,
    *camera.COMMANDS,
    *training.COMMANDS,
    *window.COMMANDS,
)
HOLD_KEY = "Space"
"""While held, the other slot is shown."""
PICTURE_HINTS = (
    ("left drag", "orbit, or look round when flying"),
    ("right or middle drag", "pan"),
    ("wheel", "nearer, farther; speed when flying"),
    ("Ctrl + wheel", "look at the pixels themselves; Ctrl + drag moves them"),
    ("click", "with the heatmap: keep the block under the mouse in the panel Divergence"),
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
    """Run a command. Raises InputError for one that does not exist, and for arguments that do not fit."""
    command = find_command(command_id)
    command.run(session, *command.values(arguments, session))


def run_line(line: str, session: Session) -> None:
    """Run a command as it is typed; nothing for an empty line or a comment. Raises InputError."""
    parts = words(line)
    if parts:
        run_command(parts[0], parts[1:], session)


def key_table() -> tuple[tuple[str, str], ...]:
    """(key, what it does) of everything that has a key or is done with the mouse, keys first."""
    keys = tuple((command.key, command.help) for command in COMMANDS if command.key)
    return ((HOLD_KEY, "hold: show the other slot"), *keys, ("1 to 9", "go to a camera of the scene"), *PICTURE_HINTS)


def key_table_markdown() -> str:
    """The key table of README."""
    rows = [f"| {key} | {description} |" for key, description in key_table()]
    return "\n".join(["| key or mouse | what it does |", "|---|---|", *rows])
