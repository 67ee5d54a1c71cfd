"""Keys with modifiers as text (`F`, `Ctrl+S`, `Shift+/`), and the commands that they run."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from ntc.errors import InputError
from viewer.commands.command import Command

MODIFIERS = ("Ctrl", "Shift", "Alt")
NAMED_KEYS = (
    *(chr(code) for code in range(ord("A"), ord("Z") + 1)),
    *(str(digit) for digit in range(10)),
    *(f"F{number}" for number in range(1, 13)),
    *("Space", "Tab", "Escape", "Enter", "Backspace", "Delete", "Insert", "Home", "End", "PageUp", "PageDown"),
    *("Up", "Down", "Left", "Right"),
    *("/", ",", ".", ";", "'", "[", "]", "\\", "-", "=", "`"),
)
"""Names of the keys that a chord can end with, in any case."""
_BY_LOWER = {name.lower(): name for name in NAMED_KEYS}


@dataclass(frozen=True)
class Chord:
    """Key with exactly the modifiers that must be held."""

    key: str
    """Name of the key, one of NAMED_KEYS."""
    ctrl: bool = False
    shift: bool = False
    alt: bool = False

    def __str__(self) -> str:
        held = [name for name, is_held in zip(MODIFIERS, (self.ctrl, self.shift, self.alt), strict=True) if is_held]
        return "+".join([*held, self.key])

    @property
    def is_function_key(self) -> bool:
        """True for F1 to F12. They type no text, therefore they work while a text field is active."""
        return len(self.key) > 1 and self.key[0] == "F" and self.key[1:].isdigit()


def parse_chord(text: str) -> Chord:
    """Return the chord of a text; `?` means `Shift+/`. Raises InputError for an unknown key."""
    *held, key = ("Shift+/" if text.strip() == "?" else text).split("+")
    modifiers = [part.strip().capitalize() for part in held]
    named = _BY_LOWER.get(key.strip().lower())
    if named is None or len(set(modifiers)) != len(modifiers) or not set(modifiers) <= set(MODIFIERS):
        raise InputError(f"{text[:40]!r}: no such key; write it like F, Ctrl+S or Shift+F5")
    return Chord(named, *(name in modifiers for name in MODIFIERS))


HOLD_KEY = "Space"
"""Key that shows the other slot while it is held."""
RESERVED = {
    HOLD_KEY: "showing the other slot",
    **dict.fromkeys("WASDQE", "flying"),
    **dict.fromkeys("123456789", "cameras of the scene"),
}
"""Uses of the keys that commands cannot have."""


@dataclass(frozen=True)
class Bindings:
    """Keys of all commands."""

    chords: Mapping[str, tuple[Chord, ...]]
    """Chords by command id; commands without a key are absent."""
    problems: tuple[str, ...] = ()
    """Reasons why keys of the user were refused, one line each. Their commands have the default keys."""

    def text(self, command_id: str) -> str:
        """Return the keys of a command as text; "" for none."""
        return ", ".join(str(chord) for chord in self.chords.get(command_id, ()))


def _wanted(commands: Sequence[Command], keys: Mapping[str, str], problems: list[str]) -> dict[str, tuple[Chord, ...]]:
    """Return the user's chords by command id. Unreadable and reserved keys are left out and added to `problems`."""
    ids = {command.id for command in commands}
    wanted: dict[str, tuple[Chord, ...]] = {}
    for command_id, text in keys.items():
        if command_id not in ids:
            problems.append(f"keys: {command_id[:60]!r} is not a command; remove it from the settings")
            continue
        try:
            chord = parse_chord(text) if text else None
        except InputError as error:
            problems.append(f"keys: {command_id}: {error}")
            continue
        use = RESERVED.get(str(chord))
        if use is not None:
            problems.append(f"keys: {command_id}: {chord} is for {use}; choose another")
            continue
        wanted[command_id] = () if chord is None else (chord,)
    return wanted


def _conflict(
    commands: Sequence[Command], wanted: Mapping[str, tuple[Chord, ...]]
) -> tuple[dict[str, tuple[Chord, ...]], tuple[str, str, Chord] | None]:
    """Return all chords with the `wanted` ones, and the first conflict: (refused id, id that has the chord, chord)."""
    chords: dict[str, tuple[Chord, ...]] = {}
    owners: dict[Chord, str] = {}
    # Commands that the user did not change come first, so that they have their keys.
    for command in sorted(commands, key=lambda command: command.id in wanted):
        default = tuple(parse_chord(key) for key in (command.key, command.second_key) if key)
        mine = wanted.get(command.id, default)
        for chord in mine:
            if chord in owners:
                refused = command.id if command.id in wanted else owners[chord]
                return chords, (refused, owners[chord], chord)
            owners[chord] = command.id
        if mine:
            chords[command.id] = mine
    return chords, None


def bind_keys(commands: Sequence[Command], keys: Mapping[str, str]) -> Bindings:
    """Return the chords of all commands; `keys` (command id: key, "" for none) replace the default ones.

    A key that two commands would share is refused, and the problem names both. Two commands may exchange their keys.
    """
    problems: list[str] = []
    wanted = _wanted(commands, keys, problems)
    while True:
        chords, conflict = _conflict(commands, wanted)
        if conflict is None:
            return Bindings(chords, tuple(problems))
        refused, owner, chord = conflict
        problems.append(f"keys: {refused}: {chord} belongs to {owner}; choose another, or change that one too")
        if refused not in wanted:
            # Two commands have the same default key: the later command gets no key.
            wanted[refused] = ()
            continue
        del wanted[refused]
