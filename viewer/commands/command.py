"""Commands and their parameters. Type hints of a function declare a command once, for scripts, widgets, help and tables."""

import inspect
import shlex
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from operator import attrgetter
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar, get_args, get_origin, get_type_hints

from msgspec import Meta

from ntc.errors import InputError
from viewer.commands.effects import Effect
from viewer.commands.history import History
from viewer.state.event_handlers import apply_event, notify
from viewer.state.session import Session
from viewer.state.setting import Arg as Arg
from viewer.state.setting import Setting
from viewer.state.view_state import Side
from viewer.training.live_training import LiveTraining
from viewer.training.run_store import UnsavedRuns

SWITCH = {"on": True, "off": False}
Name = TypeVar("Name", bound=str)
REQUIRED: Any = inspect.Parameter.empty
SlotSide = Annotated[Side, Arg("which slot", names={"a": "A", "b": "B"})]


class Context:
    """State that commands change, and services that they use."""

    def __init__(
        self,
        session: Session,
        read_clipboard: Callable[[], str] = str,
        write_clipboard: Callable[[str], object] = len,
        unsaved: UnsavedRuns | None = None,
    ) -> None:
        """Make a context. Without clipboard functions, copied text is lost. Without `unsaved`, runs are not autosaved."""
        self.session, self.training = session, LiveTraining(partial(apply_event, session), unsaved)
        self.read_clipboard, self.write_clipboard = read_clipboard, write_clipboard
        self.history = History()
        self.perform: Callable[[Effect], object] = lambda _effect: None
        """Function that carries out an effect; without a window it does nothing. Raises InputError."""


def typed(value: Any) -> str:
    """Return the text by which a user types `value`."""
    if isinstance(value, bool):
        return "on" if value else "off"
    return f"{value:g}" if isinstance(value, float) else "" if value == Path() else str(value)


def typed_path(text: str) -> Path:
    """Return the path of a typed text, with `~` expanded. Raises InputError for names that no file can have."""
    try:
        if "\0" in text:
            raise InputError(f"{text!r}: is not a valid file name")
        return Path(text).expanduser()
    except RuntimeError as error:
        raise InputError(f"{text}: there is no such user; write the whole path") from error


@dataclass(frozen=True)
class Parameter:
    """Parameter of a command."""

    name: str
    type: Any
    """Type of the value: str, Path, float, int, bool (typed as `on` or `off`) or a Literal; any type for gestures."""
    arg: Arg
    default: Any = REQUIRED

    @property
    def fixed(self) -> dict[str, Any]:
        """Values by their text, for a bool or a Literal; empty for other types."""
        if self.type is bool:
            return SWITCH
        return {str(value): value for value in get_args(self.type)} if get_origin(self.type) is Literal else {}

    @property
    def is_choice(self) -> bool:
        """True where the value comes from a list of choices."""
        return self.arg.choices is not None or bool(self.fixed)

    @property
    def default_text(self) -> str | None:
        """Text of the default value; None where the user must give a value."""
        return None if self.default is REQUIRED else typed(self.default)

    def options(self, session: Session) -> tuple[str, ...]:
        """Return the choices as texts; empty where the parameter is not a choice."""
        return self.arg.choices(session) if self.arg.choices is not None else tuple(self.fixed)

    def refusal(self, session: Session, text: str) -> str:
        """Return the reason why the choice `text` cannot be taken now; "" where it can."""
        return self.arg.refuses(session, text) if self.arg.refuses is not None else ""

    def parse(self, text: str) -> Any:
        """Return the value of a typed text. Raises InputError for a text that is wrong in every session."""
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
        """Return `value`, clamped where the parameter clamps. Raises InputError for a value that cannot be taken now."""
        if self.is_choice:
            options = self.options(session) if self.arg.choices is not None else tuple(self.fixed.values())
            # An empty text means the default of the command.
            if value not in options and not value == self.default == "":
                raise InputError(
                    f"{self.name} {value!r}: must be one of {', '.join(map(str, options)) or 'nothing yet'}"
                )
            if reason := self.refusal(session, str(value)):
                raise InputError(f"{self.name} {value}: {reason}")
        elif self.type in (int, float):
            self._require_finite(value)
            low, high = self.arg.minimum, self.arg.maximum
            if self.arg.wraps and high is not None:
                return value % high
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
    """Command of the window. One definition feeds menus, keys, the palette, the help and scripts."""

    id: str
    """Name of the command in scripts: `noun.verb`, lower case."""
    title: str
    """Title in menus and the palette: a few words."""
    help: str
    """Description of the command in one line, lower case, without a full stop; "" for a gesture, which has no text form."""
    function: Callable[..., Effect | None]
    """Function that carries out the command. It takes a Session or a Context, and the values of the parameters. It returns the
    effect outside the session, or None. Raises InputError."""
    parameters: tuple[Parameter, ...]
    key: str = ""
    """Default key as `viewer.commands.keys` spells it; "" for none."""
    second_key: str = ""
    """Second default key; "" for none."""
    unavailable: Callable[[Context], str] | None = None
    """Function that returns the reason in one line why the command cannot run now, "" where it can. Menus, palette and buttons are
    then grey and show the reason as tooltip; a script stops with the reason as its error."""
    current: Callable[..., Any] | None = None
    """Function that returns the present value, which menus tick and widgets show. It takes the session and the texts of all
    parameters except the last. For a command that switches something on and off it returns a bool."""
    about: str = ""
    """Tooltip of the widget in sentences; "" takes `help`."""
    steps: str = ""
    """Id of the command whose next choice this command sets; "" for none."""
    icon: str = ""
    """Name of the Font Awesome icon beside the title, such as `folder-open`; "" for none."""

    @property
    def usage(self) -> str:
        """Command line with the names of the parameters, optional ones in brackets."""
        parts = [p.name if p.default is REQUIRED else f"[{p.name}]" for p in self.parameters]
        return " ".join([self.id, *(part.upper() for part in parts)])

    @property
    def needs_arguments(self) -> bool:
        """True where a parameter has no default."""
        return any(parameter.default is REQUIRED for parameter in self.parameters)

    @property
    def is_switch(self) -> bool:
        """True for a command that switches something on and off and has a present state."""
        takes_bool = not self.parameters or (len(self.parameters) == 1 and self.parameters[0].type is bool)
        return takes_bool and self.current is not None

    def is_on(self, session: Session) -> bool:
        """Return True where a switch is on now."""
        return self.current is not None and self.current(session) is True

    def why_not(self, context: Context) -> str:
        """Return the reason why the command cannot run now; "" where it can."""
        return self.unavailable(context) if self.unavailable is not None else ""

    @cached_property
    def _takes_context(self) -> bool:
        return "context" in inspect.signature(self.function).parameters

    def parse(self, texts: Sequence[str]) -> tuple[Any, ...]:
        """Return the values of typed arguments. Raises InputError for arguments that are wrong in every session."""
        self._require_all(len(texts))
        return tuple(self._each(lambda parameter, text: parameter.parse(text), texts))

    def run(self, context: Context, values: Sequence[Any]) -> Effect | None:
        """Check the values, change the session, and return the effect outside it. Raises InputError."""
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
                raise InputError(f"{self.id}: lacks {parameter.name} ({parameter.arg.help}); usage: {self.usage}")

    def _each(self, convert: Callable[[Parameter, Any], Any], values: Sequence[Any]) -> list[Any]:
        try:
            return [convert(parameter, value) for parameter, value in zip(self.parameters, values, strict=False)]
        except InputError as error:
            raise InputError(f"{self.id}: {error}") from error


def command(
    command_id: str,
    title: str,
    help_line: str,
    key: str = "",
    second_key: str = "",
    *,
    unavailable: Callable[[Context], str] | None = None,
    current: Callable[..., Any] | None = None,
    about: str = "",
    icon: str = "",
) -> Callable[[Callable[..., Effect | None]], Command]:
    """Return a decorator that makes a `Command` of a function. The function's parameters after the first are the command's."""
    return lambda function: Command(
        *(command_id, title, help_line, function, _parameters(function), key, second_key, unavailable, current, about),
        icon=icon,
    )


def unless(holds: Callable[[Context], object], reason: str) -> Callable[[Context], str]:
    """Return a function for `Command.unavailable` that returns `reason` where `holds` is false."""
    return lambda context: "" if holds(context) else reason


def gesture(command_id: str, title: str = "") -> Callable[[Callable[..., Effect | None]], Command]:
    """Return a decorator for commands of mouse and widgets, whose values have no text; undo shows `title`."""
    return lambda function: Command(command_id, title, "", function, _parameters(function))


def _parameters(function: Callable[..., Effect | None]) -> tuple[Parameter, ...]:
    hints = get_type_hints(function, include_extras=True)
    declared = list(inspect.signature(function).parameters.items())[1:]
    return tuple(_parameter(name, hints[name], each.default) for name, each in declared)


def _parameter(name: str, hint: Any, default: Any = REQUIRED) -> Parameter:
    """Return the parameter of a type hint with its `Arg` and, for a number, its range as `Meta`."""
    kind, *declared = get_args(hint) if get_origin(hint) is Annotated else (hint,)
    arg = next((each for each in declared if isinstance(each, Arg)), Arg())
    limits = next((each for each in declared if isinstance(each, Meta)), None)
    if limits is not None and arg.minimum is None:
        arg = replace(arg, minimum=limits.ge, maximum=limits.le)
    return Parameter(arg.name or name, kind, arg, default)


def hint_of(path: str) -> Any:
    """Return the type hint of a field of the session, such as `view.overlay.block`."""
    kind: Any = Session
    for name in path.split("."):
        kind = get_type_hints(kind, include_extras=True)[name]
    return kind


def with_field(owner: Any, path: str, value: Any) -> Any:
    """Return `owner` with another value of the field at `path`. Frozen dataclasses are replaced, others change in place."""
    name, _, rest = path.partition(".")
    value = with_field(getattr(owner, name), rest, value) if rest else value
    if owner.__dataclass_params__.frozen:
        return replace(owner, **{name: value})
    setattr(owner, name, value)
    return owner


def field_command(
    path: str,
    *,
    default: Any = REQUIRED,
    unavailable: Callable[[Context], str] | None = None,
    refuses: Callable[[Session, str], str] | None = None,
    said: Callable[[Any], str] | None = None,
) -> Command:
    """Return the command that sets the field of the session at `path`. The field's `Setting` and `Arg` describe the command.

    A `*` in the path is the side of a slot, which becomes the first parameter. `said` returns a message about the new value.
    """
    hint = hint_of(path.replace("*", "a"))
    setting = next(each for each in get_args(hint) if isinstance(each, Setting))
    parameter = _parameter(path.rpartition(".")[2], hint, default)
    if refuses is not None:
        parameter = replace(parameter, arg=replace(parameter.arg, refuses=refuses))

    def present(session: Session, side: str = "") -> Any:
        return attrgetter(path.replace("*", side))(session)

    def change(session: Session, *values: Any) -> None:
        *side, value = values if values else (not present(session),)
        with_field(session, path.replace("*", "".join(side)), value)
        if said is not None:
            notify(session, said(value))

    sides = (_parameter("side", SlotSide),) if "*" in path else ()
    parameters = (*sides, *(() if setting.toggles else (parameter,)))
    made = command(
        *(setting.command, setting.title, setting.help, setting.key, setting.second_key),
        unavailable=unavailable,
        current=present,
        about=setting.about,
        icon=setting.icon,
    )
    return replace(made(change), parameters=parameters)


def setter(path: str, value: Any) -> Callable[[Session], None]:
    """Return a function for `command` that sets the field of the session at `path` to `value`."""

    def change(session: Session) -> None:
        with_field(session, path, value)

    return change


def field_gesture(command_id: str, path: str) -> Command:
    """Return the gesture that sets the field of the session at `path`."""

    def change(session: Session, value: Any) -> None:
        with_field(session, path, value)

    return gesture(command_id)(change)


def next_command(
    of: Command, command_id: str, title: str, help_line: str, key: str, said: Callable[[Any], str] | None = None
) -> Command:
    """Return the command that switches to the next choice of command `of`. `said` returns a message about the new choice."""

    def change(session: Session) -> None:
        assert of.current is not None
        value = following(tuple(of.parameters[-1].fixed.values()), of.current(session))
        of.function(session, value)
        if said is not None:
            notify(session, said(value))

    return Command(command_id, title, help_line, change, (), key, steps=of.id)


def following(names: Sequence[Name], present: Name) -> Name:
    """Return the name after `present`; after the last name, the first one."""
    return names[(names.index(present) + 1) % len(names)]


def words(line: str) -> list[str]:
    """Split a line into words with the quotes and comments of a shell. Raises InputError."""
    try:
        return shlex.split(line, comments=True)
    except ValueError as error:
        raise InputError(f"{line.strip()!r}: {str(error).lower()}") from error
