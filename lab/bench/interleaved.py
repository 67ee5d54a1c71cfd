"""Interleaved timing: candidates run one after the other, round by round, so that drift affects all alike."""

import statistics
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from viewer.gl.context import GraphicsContext
from viewer.gl.timer import PassTimer

Progress = Callable[[int, int], None]
"""Called with (rounds done, rounds in all)."""


def no_progress(_done: int, _of: int) -> None:
    """A Progress that ignores its calls."""


@dataclass(frozen=True)
class Spread:
    """Times of one candidate, in ms."""

    median_ms: float
    min_ms: float
    max_ms: float


def spread_of(times: Sequence[float]) -> Spread:
    """Median, minimum and maximum of times in ms, at least one."""
    return Spread(statistics.median(times), min(times), max(times))


def warm_up_rounds(context: GraphicsContext) -> int:
    """Rounds before the first timed one: a GPU raises its clock under load, a software renderer has none to raise."""
    return 1 if context.info.is_software else 10


def time_interleaved(
    context: GraphicsContext,
    candidates: Sequence[Callable[[], None]],
    repeats: int,
    progress: Progress = no_progress,
) -> tuple[Spread, ...]:
    """Run each candidate once a round, `repeats` (at least 1) timed rounds after the warm-up; a spread for each.

    Raises ContextLostError.
    """
    timer = PassTimer(context)
    times: list[list[float]] = [[] for _ in candidates]
    warm_up = warm_up_rounds(context)
    for number in range(warm_up + repeats):
        for candidate, own in zip(candidates, times, strict=True):
            with timer.measure("candidate"):
                candidate()
            (milliseconds,) = timer.take().values()
            if number >= warm_up:
                own.append(milliseconds)
        context.reset.check()
        progress(number + 1, warm_up + repeats)
    return tuple(spread_of(own) for own in times)
