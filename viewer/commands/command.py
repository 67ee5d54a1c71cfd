"""What a command is, and how a line of text becomes one."""

import shlex
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from ntc.errors import InputError

if TYPE_CHECKING:
    from viewer.state.session import Session

Menu = Literal["File", "View", "Camera", "Compare", "Inspect", "Overlay", "Train", "Window", "Help"]
Value = str | float | int | Path
Choices = Callable[["Session"], tuple[str, ...]]


def typed_path(text: str) -> Path:
    """A path as it is typed, with ~. Raises InputError for what no file can be called."""
    try:
        if "\0" in text:
            raise InputError(f"{text!r}: is no name of a file")
        return Path(text).expanduser()
    except RuntimeError as error:
        raise InputError(f"{text}: there is no such user; write the whole path") from error


@dataclass(frozen=True)
class FixedChoices:
    """Choices that do not depend on what is open: a script is checked against them before it starts."""

    names: tuple[str, ...]

    def __call__(self, _session: "Session") -> tuple[str, ...]:
        return self.names


def fixed(*choices: str) -> FixedChoices:
    """Choices that do not depend on what is open."""
    return FixedChoices(choices)


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

    def options(self, session: "Session") -> tuple[str, ...]:
        """What it can be now, for kind `choice`."""
        return self.choices(session) if self.choices is not None else ()

    def check(self, text: str) -> None:
        """Raise InputError where `text` is wrong whatever is open."""
        if isinstance(self.choices, FixedChoices) and text not in self.choices.names:
            raise InputError(f"{self.name} {text!r}: must be one of {', '.join(self.choices.names)}")
        if self.kind in ("number", "whole"):
            self._number(text)

    def read(self, text: str, session: "Session") -> Value:
        """The value that `text` stands for. Raises InputError."""
        if self.kind == "choice":
            choices = self.options(session)
            if text not in choices:
                raise InputError(f"{self.name} {text!r}: must be one of {', '.join(choices) or 'nothing yet'}")
            return text
        if self.kind in ("number", "whole"):
            return self._number(text)
        return typed_path(text) if self.kind == "path" else text

    def _number(self, text: str) -> float | int:
        try:
            number = float(text) if self.kind == "number" else int(text)
        except ValueError as error:
            what = "a number" if self.kind == "number" else "a whole number"
            raise InputError(f"{self.name} {text!r}: must be {what}") from error
        if not abs(number) < 1e30:
            raise InputError(f"{self.name} {text!r}: must be finite")
        return number


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
    """Default key as `viewer.commands.chords` spells it; "" for none. Only for commands that need no arguments."""
    second_key: str = ""
    """Another one."""

    @property
    def usage(self) -> str:
        """The command as it is typed."""
        parts = [p.name if p.default is None else f"[{p.name}]" for p in self.parameters]
        return " ".join([self.id, *(part.upper() for part in parts)])

    @property
    def needs_arguments(self) -> bool:
        """Whether it must be told something."""
        return any(parameter.default is None for parameter in self.parameters)

    def _texts(self, arguments: Sequence[str]) -> list[str]:
        """One text for each parameter, defaults filled in. Raises InputError."""
        if len(arguments) > len(self.parameters):
            raise InputError(f"{self.id}: takes at most {len(self.parameters)} arguments; usage: {self.usage}")
        texts = list(arguments)
        for parameter in self.parameters[len(arguments) :]:
            if parameter.default is None:
                raise InputError(f"{self.id}: lacks {parameter.name} ({parameter.help}); usage: {self.usage}")
            texts.append(parameter.default)
        return texts

    def check(self, arguments: Sequence[str]) -> None:
        """Raise InputError where the arguments are wrong whatever is open."""
        for parameter, text in zip(self.parameters, self._texts(arguments), strict=True):
            try:
                parameter.check(text)
            except InputError as error:
                raise InputError(f"{self.id}: {error}") from error

    def values(self, arguments: Sequence[str], session: "Session") -> tuple[Value, ...]:
        """Values of the parameters. Raises InputError."""
        values: list[Value] = []
        for parameter, text in zip(self.parameters, self._texts(arguments), strict=True):
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
