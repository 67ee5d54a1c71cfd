"""Tables of keys and commands of docs/reference/commands.md, made from the registry of commands."""

from viewer.commands import COMMANDS, PICTURE_HINTS, bindings
from viewer.commands.command import Command
from viewer.commands.keys import HOLD_KEY


def key_table() -> str:
    """Return a Markdown table of all keys and mouse gestures, keys first."""
    bound = bindings({})
    keys = [(bound.text(command.id), command.help) for command in COMMANDS if bound.text(command.id)]
    held = ((HOLD_KEY, "hold: show the other slot"), *keys, ("1 to 9", "go to a camera of the scene"), *PICTURE_HINTS)
    return "\n".join(["| key or mouse | what it does |", "|---|---|", *(f"| {key} | {text} |" for key, text in held)])


def command_table() -> str:
    """Return a Markdown table of all commands."""
    bound = bindings({})
    rows = [f"| `{c.usage}` | {c.help} | {_parameters(c)} | {bound.text(c.id)} |" for c in COMMANDS]
    return "\n".join(["| command | what it does | parameters | key |", "|---|---|---|---|", *rows])


def _parameters(command: Command) -> str:
    parts = []
    for parameter in command.parameters:
        what = " \\| ".join(f"`{choice}`" for choice in parameter.fixed) or parameter.arg.help
        default = f" ({parameter.default_text})" if parameter.default_text else ""
        parts.append(f"{parameter.name.upper()}: {what}{default}")
    return "; ".join(parts)
