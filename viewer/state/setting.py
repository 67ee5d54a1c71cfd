"""Descriptions of values that the user sets: one makes the command, menu item, palette entry, script line and widget of a field."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Annotated, Any, get_args, get_origin, get_type_hints


@dataclass(frozen=True)
class Setting:
    """Command that sets a field of the session's state, written as `Annotated[type, Setting(...), Arg(...)]`.

    `msgspec.Meta` beside it declares the range of a number, for files and for the command.
    """

    command: str
    """Name of the command in scripts: `noun.verb`, lower case."""
    title: str
    """Title in menus and the palette: a few words."""
    help: str
    """Description of the command in one line, lower case, without a full stop."""
    about: str = ""
    """Text of tooltip and `--help` in sentences, with unit and range; "" takes `help`."""
    key: str = ""
    """Default key as `viewer.commands.keys` spells it; "" for none."""
    second_key: str = ""
    """Second default key; "" for none."""
    icon: str = ""
    """Name of the Font Awesome icon beside the title; "" for none."""
    toggles: bool = False
    """True for a command without a value that switches a bool on and off."""


@dataclass(frozen=True)
class Arg:
    """Description, limits and widget of a value, written as `Annotated[type, Arg(...)]`."""

    help: str = ""
    choices: Callable[[Any], tuple[str, ...]] | None = None
    """Function of the session that lists the choices, where they depend on what is open. A Literal declares choices that never
    change."""
    minimum: float | None = None
    maximum: float | None = None
    """Range of a number, `minimum` to `maximum`: both or neither is given. A value outside is an error."""
    clamp: bool = False
    """Replace a value outside the range by the nearer end, instead of refusing it."""
    wraps: bool = False
    """Replace a number by its remainder after division by `maximum`, as for angles."""
    suggestion: Callable[[Any], str] | None = None
    """Function of the session that gives the text with which the palette's field begins; None leaves it empty."""
    refuses: Callable[[Any, str], str] | None = None
    """Function of session and text that says why a choice cannot be taken now, "" where it can. Menus, lists and palette grey the
    choice out and show the reason; a script gets the reason as its error."""
    name: str = ""
    """Name of the value in usage lines; "" takes the name of field or parameter."""
    values: Mapping[str, str] = field(default_factory=dict)
    """Tooltips of choices that do not explain themselves."""
    names: Mapping[str, str] = field(default_factory=dict)
    """Names of choices in lists and buttons, where they differ from what is typed."""
    ends: tuple[float, float] | None = None
    """Ends of the slider; None takes the range."""
    text: str = "%.2f"
    """Text of the slider in printf's notation, with the unit."""
    logarithmic: bool = False
    """True for a slider with a logarithmic scale."""
    offers: tuple[float, ...] = ()
    """Numbers that the widget offers in a list, instead of a slider."""
    read: Callable[[str], Any] | None = None
    """Function that returns the value of a typed text and raises InputError; None reads the text by the type of the value."""


def sentence(text: str) -> str:
    """Return `text` with a capital letter and a full stop."""
    return f"{text[:1].upper()}{text[1:]}{'' if text.endswith(('.', '?', '!')) else '.'}" if text else ""


def field_args(owner: type) -> dict[str, Arg]:
    """Return the `Arg` of each field of `owner` that has one, by the field's name."""
    hints = get_type_hints(owner, include_extras=True).items()
    return {name: each for name, hint in hints for each in _metadata(hint) if isinstance(each, Arg)}


def field_text(owner: type, name: str) -> str:
    """Return what a field of `owner` sets, in sentences: the text of its tooltip and of its option on the command line."""
    hint = get_type_hints(owner, include_extras=True)[name]
    setting = next((each for each in _metadata(hint) if isinstance(each, Setting)), None)
    return setting.about or sentence(setting.help) if setting is not None else sentence(field_args(owner)[name].help)


def _metadata(hint: Any) -> tuple[Any, ...]:
    return get_args(hint)[1:] if get_origin(hint) is Annotated else ()
