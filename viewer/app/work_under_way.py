"""Work in the background for the status bar: its progress, and the time left."""

import time
from collections.abc import Iterator, Mapping, Sequence

from ntc.metrics.block_compression import BlockFormat
from viewer.render.pass_scheduler import ToCome
from viewer.scene.json_text import duration, time_left
from viewer.state.session import Session
from viewer.training.live_training import LiveTraining
from viewer.training.preparation import job_title
from viewer.ui.facts import Work
from viewer.ui.panels.training import STATES


class WorkUnderWay:
    """Work in the background, with the time left of each piece."""

    def __init__(self) -> None:
        self._began: dict[str, float] = {}
        """Monotonic seconds at which work was seen first, by title."""

    def read(
        self, session: Session, encoding: Mapping[BlockFormat, float], comparing: bool, to_come: Sequence[ToCome]
    ) -> tuple[Work, ...]:
        """Return the work for the picture and its figures, the slowest first.

        `encoding` is the progress of block formats, `comparing` tells that A is compared with B, `to_come` what the picture lacks.
        """
        found = [*self._formats(encoding)]
        if session.precision_searches:
            found.append(Work("searching the fastest precision"))
        found += [Work(item.line) for item in to_come]
        if comparing:
            found.append(Work("comparing A with B"))
        return tuple(found)

    def _formats(self, encoding: Mapping[BlockFormat, float]) -> Iterator[Work]:
        now = time.monotonic()
        titles = {f"encoding {name}": share for name, share in encoding.items()}
        self._began = {title: self._began.get(title, now) for title in titles}
        for title, share in titles.items():
            yield Work(title, share, time_left(now - self._began[title], share), "slot.leave-format")


def training_work(training: LiveTraining) -> Iterator[Work]:
    """Yield the training under way, and the pack being written."""
    if (run := training.active) is not None:
        title, progress = f"{run.name}: {job_title(run.job)}", run.progress
        state = STATES[run.state]
        if progress is None:
            state = f"{state or 'starting'}, {duration(time.monotonic() - run.began)}"
        elif not state:
            state = progress.phase
        share = progress.share if progress is not None and progress.steps else None
        left = run.seconds_left if not state else None
        # A run that is being cancelled cannot be cancelled again.
        cancel = "training.cancel" if run.state != "cancelling" else ""
        yield Work(f"{title}, {state}" if state else title, share, left, cancel)
    if training.saving:
        yield Work("writing the pack")
