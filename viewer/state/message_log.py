"""The log of messages with their times; the oldest are dropped."""

import time
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Literal

LONGEST_LOG = 1000
LONGEST_DETAILS = 20_000
"""Characters: a shader's whole text fits, a dump does not."""
MessageKind = Literal["message", "error"]


@dataclass(frozen=True)
class LogEntry:
    """One message."""

    number: int
    """Counts from 0 over all messages, including those that were dropped."""
    seconds: float
    """Time of day, in seconds since the epoch."""
    text: str
    kind: MessageKind
    details: str = ""
    """More of it than one line: the causes of an error."""
    repeats: int = 1
    """How often it came in a row."""

    @property
    def clock(self) -> str:
        """Local time as 12:34:56."""
        return time.strftime("%H:%M:%S", time.localtime(self.seconds))

    def line(self) -> str:
        """Time, kind and text."""
        again = f" ({self.repeats} times)" if self.repeats > 1 else ""
        return f"{self.clock} {'ERROR ' if self.kind == 'error' else ''}{self.text}{again}"

    def whole(self) -> str:
        """The line, and the details below it."""
        return self.line() + (f"\n{self.details}" if self.details else "")


def details_of(error: BaseException) -> str:
    """The causes of an error, one a line; "" where there is nothing beside the error's own single line."""
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
    """The last messages, oldest first."""

    def __init__(self) -> None:
        self._entries: deque[LogEntry] = deque(maxlen=LONGEST_LOG)
        self.count = 0
        """Messages so far, including those that were dropped."""

    def add(self, text: str, kind: MessageKind, details: str = "") -> None:
        """Remember a message; one that repeats the last is counted."""
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
        """All messages with their details."""
        return "\n".join(entry.whole() for entry in self._entries)
