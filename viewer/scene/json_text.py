"""JSON from untrusted files: parsed, checked against a schema, quoted in error messages. Also numbers and times as text."""

import json
import re
from typing import Annotated, Any, Literal, TypeVar, get_args, get_origin, get_type_hints

import msgspec

from ntc.errors import InputError

Finite = Annotated[float, msgspec.Meta(gt=-1e30, lt=1e30)]
Vector = tuple[Finite, Finite, Finite]
Share = Annotated[float, msgspec.Meta(ge=0.0, le=1.0)]

_Schema = TypeVar("_Schema")
_TYPE_WORDS = {
    "float": "number",
    "int": "whole number",
    "int | float": "whole number",
    "str": "text",
    "bool": "true or false",
    "array": "list",
}
_NOT_FINITE = re.compile(r"Expected `float` [<>] -?1e\+3[08]\b")


def printable(text: str) -> str:
    """Return `text` in one line of at most 200 printable characters, valid in every terminal and file; "" when none is left."""
    line = " ".join(text.encode("utf-8", "replace").decode().split())
    return "".join(character for character in line if character.isprintable())[:200]


def counted(number: int, noun: str) -> str:
    """Return a number with its noun: `1 texture`, `2 textures`."""
    return f"{number:,} {noun}" if number == 1 else f"{number:,} {noun}s"


def duration(seconds: float) -> str:
    """Return a time as text: `45 s`, `3 min`, `2.5 h`."""
    if seconds < 99.5:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 5400 else f"{seconds / 3600:.1f} h"


LEAST_SHARE = 0.1
"""Share of the work, 0 to 1, from which on the time left is estimated."""


def time_left(seconds: float, share: float, first: float = 0.0) -> float | None:
    """Return the time left in seconds, at least 1, at the mean speed so far: progress rose from `first` to `share`, 0 to 1, in
    `seconds`. None before LEAST_SHARE is done, and at the end."""
    if share - first < LEAST_SHARE or share >= 1.0:
        return None
    return max(1.0, seconds * (1.0 - share) / (share - first))


def percent(share: float) -> str:
    """Return the progress of running work as text: `34 %`, never 100 %."""
    return f"{min(int(100.0 * share), 99)} %"


def describe(value: Any) -> str:
    """Return a JSON value as text for a message, at most 40 characters. Containers, which may be very deep, only by their kind."""
    if isinstance(value, list):
        return "an array"
    if isinstance(value, dict):
        return "an object"
    text = repr(value)
    return text if len(text) <= 40 else text[:37] + "..."


def nonempty_line(text: str) -> str:
    """Return `printable(text)`. Raises ValueError where nothing is left."""
    line = printable(text)
    if not line:
        raise ValueError("names and sources must not be empty")
    return line


def parse_json(data: str | bytes, where: str, remedy: str) -> Any:
    """Return the JSON value in `data` (UTF-8). Raises InputError that names `where` and ends in `remedy`."""
    try:
        text = data.decode("utf-8") if isinstance(data, bytes) else data.encode("utf-8", "replace").decode()
        value = json.loads(text)
        if "\\ud" in text or "\\uD" in text:
            # Half a surrogate pair: JSON can express it. UTF-8, and therefore msgspec, cannot.
            value = json.loads(json.dumps(value, ensure_ascii=False).encode("utf-8", "replace"))
        return value
    except (ValueError, RecursionError) as error:
        raise InputError(f"{where}: not valid JSON ({error}); {remedy}") from error


def convert(content: Any, schema: type[_Schema], where: str, remedy: str) -> _Schema:
    """Return JSON values as an instance of `schema`, a msgspec struct or a dataclass; unknown fields are ignored.

    Raises InputError, one line that names `where` and the field and ends in `remedy`.
    """
    try:
        return msgspec.convert(content, schema)
    except ValueError as error:
        field, problem = schema_problem(error, schema)
        raise InputError(f"{where}: {field + ': ' if field else ''}{problem}; {remedy}") from error


def schema_problem(error: ValueError, schema: Any) -> tuple[str, str]:
    """Return (field such as "slots[0].path", "" for the whole content; its fault) of an error of msgspec."""
    problem, _, place = str(error).partition(" - at `$")
    field = place.rstrip("`").lstrip(".")
    problem = _NOT_FINITE.sub("Expected a finite number", printable(problem))
    problem = re.sub(r"`([\w| ]+)`", lambda match: _TYPE_WORDS.get(match[1], match[1]), problem)
    return field, problem + (_choices(schema, field) if problem.startswith("Invalid enum value") else "")


def _choices(schema: Any, field: str) -> str:
    """Return a text of the allowed values of a field like "slots.a.path"; "" inside of lists."""
    for name in field.split("."):
        stored = dict(
            zip(getattr(schema, "__struct_encode_fields__", ()), getattr(schema, "__struct_fields__", ()), strict=True)
        )
        schema = get_type_hints(schema).get(stored.get(name, name))
    return f", must be one of {', '.join(map(str, get_args(schema)))}" if get_origin(schema) is Literal else ""
