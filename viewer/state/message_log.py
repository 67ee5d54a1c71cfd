"""Log of messages with their times; the oldest are dropped."""

import time
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Literal

LONGEST_LOG = 1000
LONGEST_DETAILS = 20_000
"""Longest details in characters: a shader's whole text fits, a dump does not."""
MessageKind = Literal["message", "error"]


@dataclass(frozen=True)
class LogEntry:
    """Message of the log."""

    number: int
    """Number of the message, from 0 over all messages, dropped ones included."""
    seconds: float
    """Time of day, in seconds since the epoch."""
    text: str
    kind: MessageKind
    details: str = ""
    """Further lines, such as the causes of an error."""
    repeats: int = 1
    """Number of times that the message came in a row."""

    @property
    def clock(self) -> str:
        """Local time as 12:34:56."""
        return time.strftime("%H:%M:%S", time.localtime(self.seconds))

    def line(self) -> str:
        """Return time, kind and text in one line."""
        again = f" ({self.repeats} times)" if self.repeats > 1 else ""
        return f"{self.clock} {'ERROR ' if self.kind == 'error' else ''}{self.text}{again}"

    def whole(self) -> str:
        """Return the line with the details below it."""
        return self.line() + (f"\n{self.details}" if self.details else "")


def details_of(error: BaseException) -> str:
    """Return the causes of an error, one a line; "" where the error is one line without causes."""
    lines = [str(error)] if "\n" in str(error).strip() else []
    cause = error.__cause__ or error.__context__
    # Chains are short; a ring of causes must not hang the window.
    for _ in range(10):
        if cause is None:
            break
        # Causes whose text is in the message add nothing.
        if str(cause) not in str(error):
            lines.append(f"{type(cause).__name__}: {cause}")
        cause = cause.__cause__ or cause.__context__
    return "\n".join(lines)[:LONGEST_DETAILS]


class MessageLog:
    """Last LONGEST_LOG messages, oldest first."""

    def __init__(self) -> None:
        self._entries: deque[LogEntry] = deque(maxlen=LONGEST_LOG)
        self.count = 0
        """Number of messages so far, dropped ones included."""

    def add(self, text: str, kind: MessageKind, details: str = "") -> None:
        """Add a message; one that repeats the last only counts it up."""
        last = self._entries[-1] if self._entries else None
        if last is not None and (last.text, last.kind, last.details) == (text, kind, details):
            self._entries[-1] = replace(last, seconds=time.time(), repeats=last.repeats + 1)
            return
        self._entries.append(LogEntry(self.count, time.time(), text, kind, details[:LONGEST_DETAILS]))
        self.count += 1

    def __len__(self) -> int:
        return len(self._entries)

    def __iter__(self) -> Iterator[LogEntry]:
        return iter(self._entries)

    def __getitem__(self, index: int) -> LogEntry:
        return self._entries[index]

    def text(self) -> str:
        """Return all messages with their details."""
        return "\n".join(entry.whole() for entry in self._entries)
