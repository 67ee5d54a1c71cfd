"""Bounds of work that hold on a busy machine: processor time, compared with that of other work measured beside it."""

import gc
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial

SHORT_SECONDS = 0.1
"""What takes less processor time than this is quick on every machine: it is compared with nothing."""


def processor_seconds(work: Callable[[], object]) -> float:
    """Processor time that this process needs for `work`, without collections of garbage, whose time other tests decide."""
    was_enabled = gc.isenabled()
    gc.disable()
    try:
        began = time.process_time()
        work()
        return time.process_time() - began
    finally:
        if was_enabled:
            gc.enable()


def unit_seconds() -> float:
    """Processor time of one unit of work, as the machine is now: about 0.05 s of arithmetic in Python."""
    return processor_seconds(lambda: sum(number * number for number in range(600_000)))


@contextmanager
def limited(units: float) -> Iterator[None]:
    """Fail where the block takes more processor time than `units` of work."""
    began = time.process_time()
    yield
    used = time.process_time() - began
    if used > SHORT_SECONDS:
        assert used < units * unit_seconds(), f"took {used:.2f} s of processor time"


def growth(work: Callable[[int], object], count: int, turns: int = 2) -> float:
    """Processor time of `work(10 * count)` over that of `work(count)`: about 10 where it grows with the count, 100 with its square.

    Both are measured in turns; the least of each counts.
    """
    measured = [[processor_seconds(partial(work, size)) for size in (count, 10 * count)] for _ in range(turns)]
    small, large = (min(times) for times in zip(*measured, strict=True))
    return large / small
