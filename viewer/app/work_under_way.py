"""Work in the background for the status bar: its progress, and the time left."""

import time
from collections.abc import Iterator, Mapping, Sequence

from ntc.metrics.block_compression import BlockFormat
from viewer.jobs.job import JobReport
from viewer.render.pass_scheduler import Pending
from viewer.scene.json_text import duration
from viewer.state.session import Session
from viewer.training.live_training import LiveTraining
from viewer.training.preparation import job_title
from viewer.ui.facts import Work
from viewer.ui.panels.training import STATES


def work_for_picture(
    session: Session, encoding: Mapping[BlockFormat, JobReport], comparing: bool, pending: Sequence[Pending]
) -> Iterator[Work]:
    """Yield the work for the picture and its figures, the slowest first.

    `encoding` is the progress of block formats, `comparing` tells that A is compared with B, `pending` what the picture lacks.
    """
    for name, report in encoding.items():
        yield Work(f"encoding {name}", report.share, report.seconds_left, "slot.leave-format")
    if session.precision_searches:
        yield Work("searching the fastest precision")
    yield from (Work(item.line) for item in pending)
    if comparing:
        yield Work("comparing A with B")


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
