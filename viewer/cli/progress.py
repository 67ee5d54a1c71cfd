"""Progress of long work on standard error, with the time left: a live bar on a terminal."""

import time
from typing import Self

from rich.console import Console
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn

from ntc.training.time_left import TimeLeft
from viewer.scene.json_text import duration

LINES_PER_PHASE = 20
"""Lines of each phase where standard error is no terminal."""


def time_left_text(seconds: float | None) -> str:
    """Return `  12 s left`; "" while that is unknown."""
    return "" if seconds is None else f"  {duration(seconds)} left"


class TerminalProgress:
    """Progress of one piece of work. Use in a `with` block."""

    def __init__(self, title: str, unit: str = "", lines: bool = False) -> None:
        """`unit` names the steps. Without a terminal, `lines` prints about LINES_PER_PHASE lines for each phase."""
        self.console = Console(stderr=True, soft_wrap=True)
        self._title, self._unit, self._lines, self._last = title, unit, lines, ("", -1)
        columns = (
            TextColumn("{task.description}"),
            BarColumn(),
            TaskProgressColumn(),
            TextColumn("{task.fields[status]}"),
        )
        self._bar = Progress(*columns, console=self.console, transient=True)
        self._task = self._bar.add_task(title, total=None, status="")
        self._time_left = TimeLeft(time.monotonic())

    def __enter__(self) -> Self:
        if self.console.is_terminal:
            self._bar.start()
        return self

    def __exit__(self, *_exception: object) -> None:
        if self.console.is_terminal:
            self._bar.stop()

    def progress(self, done: int, of: int) -> None:
        """Show that `done` of `of` steps are done."""
        now, share = time.monotonic(), done / max(of, 1)
        self._time_left.advance(now, share)
        steps = f"{done} of {of} {self._unit}" if self._unit else ""
        self.show(share, f"{steps}{time_left_text(self._time_left.left(now))}".strip())

    def show(self, share: float, status: str, phase: str = "") -> None:
        """Show `share` of the work, 0 to 1, and a text beside it. `phase` names the part of the work."""
        step = (phase, int(share * LINES_PER_PHASE))
        if self.console.is_terminal:
            self._bar.update(self._task, description=phase or self._title, total=1.0, completed=share, status=status)
        elif self._lines and (phase != self._last[0] or step > self._last):
            self._last = step
            self.print(f"{phase} {share:4.0%}  {status}" if phase else f"{share:4.0%}  {status}")

    def print(self, line: str) -> None:
        """Print a line above the bar."""
        self.console.print(line, highlight=False, markup=False)
