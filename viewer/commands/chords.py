"""Keys with their modifiers, as text: `F`, `Ctrl+S`, `Shift+/`."""

from dataclasses import dataclass

from ntc.errors import InputError

MODIFIERS = ("Ctrl", "Shift", "Alt")
NAMED_KEYS = (
    *(chr(code) for code in range(ord("A"), ord("Z") + 1)),
    *(str(digit) for digit in range(10)),
    *(f"F{number}" for number in range(1, 13)),
    *("Space", "Tab", "Escape", "Enter", "Backspace", "Delete", "Insert", "Home", "End", "PageUp", "PageDown"),
    *("Up", "Down", "Left", "Right"),
    *("/", ",", ".", ";", "'", "[", "]", "\\", "-", "=", "`"),
)
"""Every key that a chord can end with; letters stand for the key, whatever the case."""
_BY_LOWER = {name.lower(): name for name in NAMED_KEYS}


@dataclass(frozen=True)
class Chord:
    """A key, and the modifiers that are held with it: exactly these."""

    key: str
    """One of NAMED_KEYS."""
    ctrl: bool = False
    shift: bool = False
    alt: bool = False

    def __str__(self) -> str:
        held = [name for name, is_held in zip(MODIFIERS, (self.ctrl, self.shift, self.alt), strict=True) if is_held]
        return "+".join([*held, self.key])

    @property
    def is_function_key(self) -> bool:
        """Whether it types nothing, so that it also works while a field is active."""
        return len(self.key) > 1 and self.key[0] == "F" and self.key[1:].isdigit()


def parse_chord(text: str) -> Chord:
    """The chord that `text` names; `?` stands for `Shift+/`. Raises InputError for a key that there is not."""
    *held, key = ("Shift+/" if text.strip() == "?" else text).split("+")
    modifiers = [part.strip().capitalize() for part in held]
    named = _BY_LOWER.get(key.strip().lower())
    if named is None or len(set(modifiers)) != len(modifiers) or not set(modifiers) <= set(MODIFIERS):
        raise InputError(f"{text[:40]!r}: no such key; write it like F, Ctrl+S or Shift+F5")
    return Chord(named, *(name in modifiers for name in MODIFIERS))
