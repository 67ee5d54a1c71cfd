"""Progress of long work on standard error, with the time left: a live bar on a terminal, lines elsewhere."""

import time
from typing import Self

from rich.console import Console
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn

from viewer.scene.json_text import duration, time_left

LINES_PER_PHASE = 20
"""Lines for each phase where standard error is no terminal."""


class TerminalProgress:
    """Progress of long work. Use it in a `with` block."""

    def __init__(self, title: str, unit: str = "", lines: bool = False) -> None:
        """Make a bar called `title`; `unit` names its steps. Without a terminal, `lines` prints LINES_PER_PHASE lines a phase."""
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
        self._began: tuple[str, float, float] | None = None
        """(name of the phase, seconds, share) when the phase began."""

    def __enter__(self) -> Self:
        if self.console.is_terminal:
            self._bar.start()
        return self

    def __exit__(self, *_exception: object) -> None:
        if self.console.is_terminal:
            self._bar.stop()

    def progress(self, done: int, of: int) -> None:
        """Show that `done` of `of` steps are done."""
        self.show(done / max(of, 1), f"{done} of {of} {self._unit}" if self._unit else "")

    def show(self, share: float, status: str, phase: str = "") -> None:
        """Show `share` of the work, 0 to 1, with a text and the time left. `phase` names a part of the work; `share` is then that
        of the phase."""
        now = time.monotonic()
        if self._began is None or self._began[0] != phase:
            self._began = (phase, now, share)
        left = time_left(now - self._began[1], share, self._began[2])
        status = status if left is None else f"{status}  {duration(left)} left".strip()
        # Rounded down, so that 100 % means done.
        step, shown = (phase, int(share * LINES_PER_PHASE)), int(100.0 * share) / 100.0
        if self.console.is_terminal:
            self._bar.update(self._task, description=phase or self._title, total=1.0, completed=shown, status=status)
        elif self._lines and (phase != self._last[0] or step > self._last):
            self._last = step
            self.print(f"{phase} {shown:4.0%}  {status}" if phase else f"{shown:4.0%}  {status}")

    def print(self, line: str) -> None:
        """Print a line above the bar."""
        self.console.print(line, highlight=False, markup=False)
