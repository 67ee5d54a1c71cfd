"""Interleaved timing: candidates run in turn, round by round, so that drift of the clock rate affects all of them equally."""

import statistics
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from viewer.gl.context import GraphicsContext
from viewer.gl.timer import PassTimer

Progress = Callable[[int, int], None]
"""Function that is called with (finished rounds, all rounds)."""


def no_progress(_done: int, _of: int) -> None:
    """Ignore progress: a `Progress` without effect."""


@dataclass(frozen=True)
class Spread:
    """Times of one candidate, in ms."""

    median_ms: float
    min_ms: float
    max_ms: float


def spread_of(times: Sequence[float]) -> Spread:
    """Return median, minimum and maximum of at least one time, in ms."""
    return Spread(statistics.median(times), min(times), max(times))


def warm_up_rounds(context: GraphicsContext) -> int:
    """Return the number of rounds before the first timed one: several on a GPU, because its clock rises under load."""
    return 1 if context.info.is_software else 10


def time_interleaved(
    context: GraphicsContext,
    candidates: Sequence[Callable[[], None]],
    repeats: int,
    progress: Progress = no_progress,
) -> tuple[Spread, ...]:
    """Run each candidate once per round, with `repeats` (at least 1) timed rounds after the warm-up, and return their spreads.

    Raises ContextLostError.
    """
    timer = PassTimer(context)
    times: list[list[float]] = [[] for _ in candidates]
    warm_up = warm_up_rounds(context)
    for number in range(warm_up + repeats):
        for candidate, candidate_times in zip(candidates, times, strict=True):
            with timer.measure("candidate"):
                candidate()
            (milliseconds,) = timer.take().values()
            if number >= warm_up:
                candidate_times.append(milliseconds)
        context.reset.check()
        progress(number + 1, warm_up + repeats)
    return tuple(spread_of(candidate_times) for candidate_times in times)
