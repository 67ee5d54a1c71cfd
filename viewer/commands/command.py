"""What a command is, and how a line of text becomes one."""

import shlex
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from ntc.errors import InputError

if TYPE_CHECKING:
    from viewer.session import Session

Menu = Literal["File", "View", "Camera", "Compare", "Overlay", "Train", "Window", "Help"]
Value = str | float | int | Path
Choices = Callable[["Session"], tuple[str, ...]]


def fixed(*choices: str) -> Choices:
    """Choices that do not depend on what is open."""
    return lambda _session: choices


@dataclass(frozen=True)
class Parameter:
    """Something that a command must be told."""

    name: str
    kind: Literal["text", "choice", "number", "whole", "path"]
    help: str
    choices: Choices | None = None
    """What it can be, for kind `choice`."""
    default: str | None = None
    """None: it must be given."""

    def read(self, text: str, session: "Session") -> Value:
        """The value that `text` stands for. Raises InputError."""
        if self.kind == "choice":
            choices = self.choices(session) if self.choices is not None else ()
            if text not in choices:
                raise InputError(f"{self.name} {text!r}: must be one of {', '.join(choices) or 'nothing yet'}")
            return text
        if self.kind in ("number", "whole"):
            try:
                number = float(text) if self.kind == "number" else int(text)
            except ValueError as error:
                what = "a number" if self.kind == "number" else "a whole number"
                raise InputError(f"{self.name} {text!r}: must be {what}") from error
            if not abs(number) < 1e30:
                raise InputError(f"{self.name} {text!r}: must be finite")
            return number
        return Path(text).expanduser() if self.kind == "path" else text


@dataclass(frozen=True)
class Command:
    """Something the user can do. One definition feeds menus, keys, the palette, the help, scripts and README's table."""

    id: str
    """How scripts call it: `noun.verb`, lower case."""
    title: str
    """A few words, for menus and the palette."""
    help: str
    """One line."""
    menu: Menu
    run: Callable[..., None]
    """(session, *values of the parameters). Raises InputError."""
    parameters: tuple[Parameter, ...] = ()
    key: str = ""
    """Default key as ImGui spells it, after `Ctrl+` or `Shift+`; "" for none. Only for commands that need no arguments."""

    @property
    def usage(self) -> str:
        """The command as it is typed."""
        parts = [p.name if p.default is None else f"[{p.name}]" for p in self.parameters]
        return " ".join([self.id, *(part.upper() for part in parts)])

    def values(self, arguments: Sequence[str], session: "Session") -> tuple[Value, ...]:
        """Values of the parameters. Raises InputError."""
        if len(arguments) > len(self.parameters):
            raise InputError(f"{self.id}: takes at most {len(self.parameters)} arguments; usage: {self.usage}")
        given = [*arguments, *(None for _ in range(len(self.parameters) - len(arguments)))]
        values: list[Value] = []
        for parameter, argument in zip(self.parameters, given, strict=True):
            text = parameter.default if argument is None else argument
            if text is None:
                raise InputError(f"{self.id}: lacks {parameter.name} ({parameter.help}); usage: {self.usage}")
            try:
                values.append(parameter.read(text, session))
            except InputError as error:
                raise InputError(f"{self.id}: {error}") from error
        return tuple(values)


def words(line: str) -> list[str]:
    """Words of a line, quoted as in a shell; none for an empty line or a comment. Raises InputError."""
    try:
        return shlex.split(line, comments=True)
    except ValueError as error:
        raise InputError(f"{line.strip()!r}: {str(error).lower()}") from error
