"""A question that the window asks before it does what cannot be taken back."""

from dataclasses import dataclass
from typing import Any

CANCEL = "Cancel"


@dataclass(frozen=True)
class Choice:
    """An answer, and the command that carries it out."""

    label: str
    """What its button says, one or two words."""
    command: str = ""
    """Id of the command; "" for none: the question is closed, and nothing else happens."""
    values: tuple[Any, ...] = ()
    """Of the command's parameters."""


@dataclass(frozen=True)
class Question:
    """What is asked. Everything else waits until it is answered; Escape takes the last choice."""

    title: str
    """One line."""
    text: str
    """What is at stake, one or more lines."""
    choices: tuple[Choice, ...]
    """The first is the safe one; the last leaves everything as it is."""
