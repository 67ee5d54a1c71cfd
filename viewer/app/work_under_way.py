"""What is under way beside the frames, for the status bar: how far it is, and how long it goes on."""

import time
from collections.abc import Iterator, Mapping, Sequence

from ntc.metrics.block_compression import BlockFormat
from viewer.render.pass_scheduler import ToCome
from viewer.state.session import Session
from viewer.training.live_training import LiveTraining
from viewer.training.preparation import job_title
from viewer.ui.facts import Work
from viewer.ui.widgets import duration

LEAST_SHARE, LEAST_SECONDS = 0.03, 1.0
"""Of the work, and since its beginning: before that its end cannot be told."""
TRAINING_STATES = {
    "preparing": "preparing textures and groups",
    "pausing": "pausing",
    "paused": "paused",
    "cancelling": "cancelling",
}


def seconds_left(share: float, began: float) -> float | None:
    """Seconds until work ends of which `share` is done since `began` (monotonic seconds); None while that cannot be told."""
    seconds = time.monotonic() - began
    return seconds * (1.0 - share) / share if share >= LEAST_SHARE and seconds >= LEAST_SECONDS else None


class WorkUnderWay:
    """Remembers when each piece of work was seen first."""

    def __init__(self) -> None:
        self._began: dict[str, float] = {}
        """Monotonic seconds, by title."""

    def read(
        self, session: Session, encoding: Mapping[BlockFormat, float], comparing: bool, to_come: Sequence[ToCome]
    ) -> tuple[Work, ...]:
        """What is under way for the picture and its figures, what takes longest first.

        `encoding`: how far block formats are; `comparing`: whether A is compared with B; `to_come`: what the picture lacks.
        """
        found = [*self._formats(encoding)]
        if session.precision_searches:
            found.append(Work("finding the cheapest precision"))
        found += [Work(item.line) for item in to_come]
        if comparing:
            found.append(Work("comparing A with B"))
        return tuple(found)

    def _formats(self, encoding: Mapping[BlockFormat, float]) -> Iterator[Work]:
        now = time.monotonic()
        titles = {f"encoding {name}": share for name, share in encoding.items()}
        self._began = {title: self._began.get(title, now) for title in titles}
        for title, share in titles.items():
            yield Work(title, share, seconds_left(share, self._began[title]), "slot.leave-format")


def training_work(training: LiveTraining) -> Iterator[Work]:
    """The training under way, and the pack that is written."""
    if (run := training.active) is not None:
        title, progress = f"{run.name}: {job_title(run.job)}", run.progress
        state = TRAINING_STATES.get(run.state, "")
        if progress is None:
            state = f"{state or 'starting'}, {duration(time.monotonic() - run.began)}"
        share = progress.step / max(1, progress.steps) if progress is not None else None
        left = progress.seconds_left if progress is not None and not state else None
        # One that is about to end cannot be ended again.
        cancel = "training.cancel" if run.state != "cancelling" else ""
        yield Work(f"{title}, {state}" if state else title, share, left, cancel)
    if training.saving:
        yield Work("writing the pack")
