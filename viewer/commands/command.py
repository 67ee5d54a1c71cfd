"""What a command is. Its parameters are declared once, by the types of a function, for scripts, widgets, help and tables."""

import inspect
import shlex
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path
from typing import Annotated, Any, Literal, get_args, get_origin, get_type_hints

from ntc.errors import InputError
from viewer.commands.effects import Effect
from viewer.commands.history import History
from viewer.state.event_handlers import apply_event
from viewer.state.session import Session
from viewer.training.kept_runs import KeptRuns
from viewer.training.live_training import LiveTraining

Menu = Literal["File", "Edit", "View", "Camera", "Compare", "Inspect", "Overlay", "Train", "Window", "Help"]
SWITCH = {"on": True, "off": False}
REQUIRED: Any = inspect.Parameter.empty


class Context:
    """What commands change, and what they use for it."""

    def __init__(
        self,
        session: Session,
        read_clipboard: Callable[[], str] = str,
        write_clipboard: Callable[[str], object] = len,
        kept: KeptRuns | None = None,
    ) -> None:
        """Without a clipboard, an empty one is read and what is written is lost; without `kept`, so are undecided runs."""
        self.session, self.training = session, LiveTraining(partial(apply_event, session), kept)
        self.read_clipboard, self.write_clipboard = read_clipboard, write_clipboard
        self.history = History()
        self.perform: Callable[[Effect], object] = lambda _effect: None
        """Carries out what commands return. Raises InputError. Without a window nothing does."""


@dataclass(frozen=True)
class Arg:
    """How a parameter of a command is described and checked, as `Annotated[type, Arg(...)]`."""

    help: str = ""
    choices: Callable[[Session], tuple[str, ...]] | None = None
    """What it can be now, where that depends on what is open; a Literal declares choices that are always the same."""
    minimum: float | None = None
    maximum: float | None = None
    """Both or neither; a value beyond them is an error."""
    clamp: bool = False
    """Take the nearer of minimum and maximum in place of a value beyond them."""
    suggestion: Callable[[Session], str] | None = None
    """What the palette has in its field to begin with; None: nothing."""
    refuses: Callable[[Session, str], str] | None = None
    """Why a choice, as it is typed, cannot be taken now; "" where it can. Menus, lists and palette show such a choice in grey, with
    the reason; a script gets it as the error."""


def typed_path(text: str) -> Path:
    """A path as it is typed, with ~. Raises InputError for what no file can be called."""
    try:
        if "\0" in text:
            raise InputError(f"{text!r}: is no name of a file")
        return Path(text).expanduser()
    except RuntimeError as error:
        raise InputError(f"{text}: there is no such user; write the whole path") from error


@dataclass(frozen=True)
class Parameter:
    """One argument of a command."""

    name: str
    type: Any
    """str, Path, float, int, bool (written as `on` and `off`) or a Literal; any other for commands without a text form."""
    arg: Arg
    default: Any = REQUIRED

    @property
    def help(self) -> str:
        """What it is, in a few words."""
        return self.arg.help

    @property
    def fixed(self) -> dict[str, Any]:
        """Values by their text, where they do not depend on what is open; else empty."""
        if self.type is bool:
            return SWITCH
        return {str(value): value for value in get_args(self.type)} if get_origin(self.type) is Literal else {}

    @property
    def is_choice(self) -> bool:
        """Whether it is one of a list."""
        return self.arg.choices is not None or bool(self.fixed)

    @property
    def default_text(self) -> str | None:
        """The default as it is typed; None where it must be given."""
        if self.default is REQUIRED:
            return None
        if isinstance(self.default, bool):
            return "on" if self.default else "off"
        if isinstance(self.default, float):
            return f"{self.default:g}"
        return "" if self.default == Path() else str(self.default)

    def options(self, session: Session) -> tuple[str, ...]:
        """The texts that it can be now; empty unless it is a choice."""
        return self.arg.choices(session) if self.arg.choices is not None else tuple(self.fixed)

    def refusal(self, session: Session, text: str) -> str:
        """Why the choice `text` cannot be taken now; "" where it can."""
        return self.arg.refuses(session, text) if self.arg.refuses is not None else ""

    def parse(self, text: str) -> Any:
        """The value of `text`. Raises InputError where it is wrong whatever is open."""
        if self.fixed:
            if text not in self.fixed:
                raise InputError(f"{self.name} {text!r}: must be one of {', '.join(self.fixed)}")
            return self.fixed[text]
        if self.type is Path:
            return typed_path(text)
        if self.type not in (int, float):
            return text
        try:
            number = self.type(text)
        except ValueError as error:
            what = "a whole number" if self.type is int else "a number"
            raise InputError(f"{self.name} {text!r}: must be {what}") from error
        self._require_finite(number)
        return number

    def checked(self, value: Any, session: Session) -> Any:
        """`value`, or what is taken in its place. Raises InputError where it cannot be now."""
        if self.is_choice:
            options = self.options(session) if self.arg.choices is not None else tuple(self.fixed.values())
            # Nothing stands for what the command takes by itself, where that may be left out.
            if value not in options and not value == self.default == "":
                raise InputError(
                    f"{self.name} {value!r}: must be one of {', '.join(map(str, options)) or 'nothing yet'}"
                )
            if reason := self.refusal(session, str(value)):
                raise InputError(f"{self.name} {value}: {reason}")
        elif self.type in (int, float):
            self._require_finite(value)
            low, high = self.arg.minimum, self.arg.maximum
            if low is not None and high is not None and not low <= value <= high:
                if not self.arg.clamp:
                    raise InputError(f"{self.name} {value:g}: must be {low:g} to {high:g}")
                return min(max(value, low), high)
        return typed_path(value) if self.type is Path and isinstance(value, str) else value

    def _require_finite(self, number: float) -> None:
        if not abs(number) < 1e30:
            raise InputError(f"{self.name} '{number}': must be finite")


@dataclass(frozen=True, eq=False)
class Command:
    """Something the user can do. One definition feeds menus, keys, the palette, the help, scripts and README's table."""

    id: str
    """How scripts call it: `noun.verb`, lower case."""
    title: str
    """A few words, for menus and the palette."""
    help: str
    """One line."""
    menu: Menu | None
    """None: a gesture of the mouse or a widget, which menus, palette, scripts and tables do not show."""
    function: Callable[..., Effect | None]
    """Takes a Session, or a Context where it needs more than that, and the values of the parameters. Returns what is to be done
    outside the session. Raises InputError."""
    parameters: tuple[Parameter, ...]
    key: str = ""
    """Default key as `viewer.commands.keys` spells it; "" for none. Only for commands that need no arguments."""
    second_key: str = ""
    """Another one."""
    unavailable: Callable[[Context], str] | None = None
    """Why it cannot run now, in a line; "" where it can. Menus, palette and buttons are grey then, with the reason as a tooltip; a
    script gets it as the error."""
    current: Callable[..., str | None] | None = None
    """What is chosen now, as it is typed: takes the session and the texts of all parameters but the last. `on` and `off` for a command
    without parameters that switches something. Menus tick it."""

    @property
    def usage(self) -> str:
        """The command as it is typed."""
        parts = [p.name if p.default is REQUIRED else f"[{p.name}]" for p in self.parameters]
        return " ".join([self.id, *(part.upper() for part in parts)])

    @property
    def needs_arguments(self) -> bool:
        """Whether a parameter has no default."""
        return any(parameter.default is REQUIRED for parameter in self.parameters)

    @property
    def is_switch(self) -> bool:
        """Whether it switches something on and off, and tells which of them is so now."""
        own = not self.parameters or (len(self.parameters) == 1 and self.parameters[0].type is bool)
        return own and self.current is not None

    def is_on(self, session: Session) -> bool:
        """Of a switch: whether what it switches is on."""
        return self.current is not None and self.current(session) == "on"

    def why_not(self, context: Context) -> str:
        """Why it cannot run now; "" where it can."""
        return self.unavailable(context) if self.unavailable is not None else ""

    @cached_property
    def _takes_context(self) -> bool:
        return "context" in inspect.signature(self.function).parameters

    def parse(self, texts: Sequence[str]) -> tuple[Any, ...]:
        """Values from texts. Raises InputError where they are wrong whatever is open."""
        self._require_all(len(texts))
        return tuple(self._each(lambda parameter, text: parameter.parse(text), texts))

    def run(self, context: Context, values: Sequence[Any]) -> Effect | None:
        """Check the values, and change the session; what is to be done outside it. Raises InputError."""
        self._require_all(len(values))
        if reason := self.why_not(context):
            raise InputError(f"{self.id}: {reason}")
        values = [*values, *(parameter.default for parameter in self.parameters[len(values) :])]
        values = self._each(lambda parameter, value: parameter.checked(value, context.session), values)
        return self.function(context if self._takes_context else context.session, *values)

    def _require_all(self, given: int) -> None:
        if given > len(self.parameters):
            raise InputError(f"{self.id}: takes at most {len(self.parameters)} arguments; usage: {self.usage}")
        for parameter in self.parameters[given:]:
            if parameter.default is REQUIRED:
                raise InputError(f"{self.id}: lacks {parameter.name} ({parameter.help}); usage: {self.usage}")

    def _each(self, convert: Callable[[Parameter, Any], Any], values: Sequence[Any]) -> list[Any]:
        try:
            return [convert(parameter, value) for parameter, value in zip(self.parameters, values, strict=False)]
        except InputError as error:
            raise InputError(f"{self.id}: {error}") from error


def command(
    command_id: str,
    title: str,
    help_line: str,
    menu: Menu,
    key: str = "",
    second_key: str = "",
    *,
    unavailable: Callable[[Context], str] | None = None,
    current: Callable[..., str | None] | None = None,
) -> Callable[[Callable[..., Effect | None]], Command]:
    """Make a command of a function: its parameters after the first are the command's. The rest as `Command` says."""
    return lambda function: Command(
        command_id, title, help_line, menu, function, _parameters(function), key, second_key, unavailable, current
    )


def switch(is_on: Callable[[Session], bool]) -> Callable[[Session], str]:
    """What is chosen now, for `current` of a command that switches something on and off."""
    return lambda session: "on" if is_on(session) else "off"


def gesture(command_id: str, title: str = "") -> Callable[[Callable[..., Effect | None]], Command]:
    """Make a command of a function that widgets and the mouse call, with values that have no text; `title` is what undo calls it."""
    return lambda function: Command(command_id, title, "", None, function, _parameters(function))


def _parameters(function: Callable[..., Effect | None]) -> tuple[Parameter, ...]:
    hints = get_type_hints(function, include_extras=True)
    parameters = []
    for name, declared in list(inspect.signature(function).parameters.items())[1:]:
        kind, arg = get_args(hints[name]) if get_origin(hints[name]) is Annotated else (hints[name], Arg())
        parameters.append(Parameter(name, kind, arg, declared.default))
    return tuple(parameters)


def words(line: str) -> list[str]:
    """Words of a line, quoted as in a shell; none for an empty line or a comment. Raises InputError."""
    try:
        return shlex.split(line, comments=True)
    except ValueError as error:
        raise InputError(f"{line.strip()!r}: {str(error).lower()}") from error
