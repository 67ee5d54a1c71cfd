"""The log of training runs: what came of each, and which of their packs are still held."""

from dataclasses import replace
from typing import TYPE_CHECKING

from ntc.errors import InputError
from viewer.training.runs import Run
from viewer.training.work import Before, put_away

if TYPE_CHECKING:
    from viewer.state.session import Session

MOST_RUNS = 100
MOST_PACKS = 8
"""Packs of runs that are kept for a second look, besides those that are shown."""


class RunLog:
    """The runs of one scene."""

    def __init__(self) -> None:
        self.runs: tuple[Run, ...] = ()
        """Oldest first."""
        self.undecided: int | None = None
        """Number of the run that is to be accepted or discarded."""
        self._before: dict[int, Before] = {}

    @property
    def next_number(self) -> int:
        """Of a run that begins now."""
        return self.runs[-1].number + 1 if self.runs else 1

    def __contains__(self, number: int) -> bool:
        return any(run.number == number for run in self.runs)

    def __getitem__(self, number: int) -> Run:
        """A run by its number. Raises InputError."""
        for run in self.runs:
            if run.number == number:
                return run
        raise InputError(f"run {number}: there is no such run; runs so far: {len(self.runs)}")

    def undecided_run(self) -> Run:
        """The one that is to be accepted or discarded. Raises InputError where there is none."""
        if self.undecided is None:
            raise InputError("training: no finished run waits to be accepted or discarded")
        return self[self.undecided]

    def add(self, run: Run, before: Before | None) -> None:
        """A run has ended; `before` is what was shown when it began to be."""
        self.runs = (*self.runs, run)[-MOST_RUNS:]
        if before is not None:
            self._before[run.number] = before
        if run.pack is not None:
            self.undecided = run.number

    def change(self, changed: Run) -> None:
        """Put down something else about a run."""
        self.runs = tuple(changed if run.number == changed.number else run for run in self.runs)

    def discard(self, session: "Session") -> None:
        """Show again what was shown before the undecided run. Raises InputError where there is none."""
        run = self.undecided_run()
        self.undecided = None
        self.change(replace(run, outcome=f"{run.outcome}, discarded"))
        put_away(session, run.name, self._before.get(run.number))

    def let_go(self, session: "Session") -> None:
        """Forget packs of old runs that nobody looks at."""
        shown = {session.view.slot_a.source, session.view.slot_b.source}
        with_pack = [run for run in self.runs if run.pack is not None]
        for run in with_pack[:-MOST_PACKS]:
            if run.name not in shown and run.number != self.undecided:
                self.change(replace(run, pack=None))
                session.packs = {name: pack for name, pack in session.packs.items() if name != run.name}
