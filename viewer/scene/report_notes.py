"""Gathers what a reader meets while it loads, for the load report."""

from collections import Counter

from viewer.scene.model import LoadReport

MAX_LINES = 200
"""Most distinct lines of one kind that a report keeps; the rest is counted."""


class ReportNotes:
    """Counts equal remarks; one is made for each load."""

    def __init__(self) -> None:
        self._lines: dict[str, Counter[str]] = {kind: Counter() for kind in ("honoured", "ignored", "missing", "notes")}

    def honoured(self, what: str, count: int = 1) -> None:
        """A feature that is drawn as specified, `count` times more."""
        self._add("honoured", what, count)

    def ignored(self, what: str, count: int = 1) -> None:
        """A feature that has no effect here."""
        self._add("ignored", what, count)

    def missing(self, what: str) -> None:
        """Something that could not be read, and what is used instead."""
        self._add("missing", what, 1)

    def note(self, what: str, count: int = 1) -> None:
        """Anything else worth saying."""
        self._add("notes", what, count)

    def _add(self, kind: str, what: str, count: int) -> None:
        if count > 0:
            self._lines[kind][what] += count

    def _finished(self, kind: str) -> tuple[str, ...]:
        lines = [text if count == 1 else f"{text} ({count})" for text, count in self._lines[kind].items()]
        if len(lines) > MAX_LINES:
            return (*lines[:MAX_LINES], f"and {len(lines) - MAX_LINES} more")
        return tuple(lines)

    def report(self, used: dict[str, int]) -> LoadReport:
        """The finished report with the counts `used`."""
        return LoadReport(
            used=used,
            honoured=self._finished("honoured"),
            ignored=self._finished("ignored"),
            missing=self._finished("missing"),
            notes=self._finished("notes"),
        )
