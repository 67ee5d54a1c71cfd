"""Tables of all command-line options and all settings, made from the dataclasses that define them."""

import dataclasses
import inspect
from pathlib import Path
from types import UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin, get_type_hints

from lab.commands import STUDIES
from lab.commands import SUBCOMMANDS as LAB_COMMANDS
from lab.documentation.api_page import class_fields, table_cell
from viewer.cli.options import SUBCOMMANDS, Subcommand
from viewer.state.settings import ViewerSettings


def option_tables() -> str:
    """Return Markdown with a section and a table for each subcommand and each study."""
    commands = [*SUBCOMMANDS, *LAB_COMMANDS]
    sections = [_section(f"ntc-viewer {command.name}", command) for command in commands]
    sections += [_section(f"ntc-viewer study {study.name}", study) for study in STUDIES]
    return "\n\n".join(sections)


def settings_table() -> str:
    """Return a Markdown table of the fields of settings.json."""
    said = {name: text for name, _, text in class_fields(ViewerSettings)}
    rows = [
        f"| `{field.name}` | {_default(field)} | {table_cell(said[field.name])} |"
        for field in dataclasses.fields(ViewerSettings)
    ]
    return "\n".join(["| field | default | what it sets |", "|---|---|---|", *rows])


def _section(title: str, command: Subcommand) -> str:
    hints = get_type_hints(command.options, include_extras=True)
    helps = {name: said for kind in reversed(command.options.__mro__) for name, _, said in _documented(kind)}
    rows = [_row(field, hints[field.name], helps.get(field.name, "")) for field in dataclasses.fields(command.options)]
    rows.sort(key=lambda row: row.startswith("| `--"))
    summary = " ".join(inspect.cleandoc(command.options.__doc__ or "").split())
    return "\n".join([f"## {title}", "", summary, "", "| option | default | what it sets |", "|---|---|---|", *rows])


def _documented(kind: type) -> list[tuple[str, str, str]]:
    return list(class_fields(kind)) if dataclasses.is_dataclass(kind) else []


def _row(field: dataclasses.Field[Any], hint: Any, said: str) -> str:
    """Return the table row of an option: its text on the command line, default and help."""
    metadata = hint.__metadata__ if get_origin(hint) is Annotated else ()
    inner = hint.__origin__ if metadata else hint
    metavar = next((text for one in metadata if (text := getattr(one, "metavar", None))), None) or _values(inner)
    name = next((text for one in metadata if (text := getattr(one, "name", None))), None) or field.name
    said = next((text for one in metadata if isinstance(text := getattr(one, "help", None), str)), said)
    if field.name == "out" and metavar == "FILE":
        metavar = "DIR"
    if any("positional" in str(one).lower() for one in metadata):
        written = metavar
    else:
        written = f"--{name.replace('_', '-')}" + (f" {metavar}" if metavar and inner is not bool else "")
    return f"| `{table_cell(written)}` | {table_cell(_default(field))} | {table_cell(said)} |"


def _values(kind: Any) -> str:
    """Return the values of an option as text."""
    origin = get_origin(kind)
    if origin is Annotated:
        return next(
            (one.metavar for one in kind.__metadata__ if getattr(one, "metavar", None)), _values(kind.__origin__)
        )
    if origin is Literal:
        return " | ".join(str(value) for value in get_args(kind))
    if origin in (Union, UnionType):
        return _values(next(part for part in get_args(kind) if part is not type(None)))
    if origin is tuple:
        return f"{_values(get_args(kind)[0])} ..."
    return {int: "N", float: "X", str: "TEXT", Path: "FILE"}.get(kind, "")


def _default(field: dataclasses.Field[Any]) -> str:
    """Return the default as text of the command line; "" where the help describes it."""
    value = field.default
    if value is dataclasses.MISSING:
        return "required" if field.default_factory is dataclasses.MISSING else ""
    if value is None or dataclasses.is_dataclass(value) or value in {(), ""}:
        return ""
    if isinstance(value, bool):
        return "on" if value else "off"
    if isinstance(value, tuple):
        sizes = bool(value) and isinstance(value[0], tuple)
        if field.name == "size":
            return f"`{value[0]}x{value[1]}`"
        return " ".join(f"`{one[0]}x{one[1]}`" if sizes else f"`{one}`" for one in value)
    return f"`{value}`"
