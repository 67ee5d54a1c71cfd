"""Threads that encode: as many as pay, in order, and no further than is asked for."""

import threading
import time
from collections.abc import Callable
from types import SimpleNamespace

import pytest

from ntc.threads import PacedThreads

Items = Callable[[int], int]


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> threading.local:
    """Clock of each thread in `seconds`. Work sets it forward: the processor's real load decides nothing."""
    time_of_thread = threading.local()
    stand_in = SimpleNamespace(perf_counter=lambda: getattr(time_of_thread, "seconds", 0.0))
    monkeypatch.setattr("ntc.threads.time", stand_in)
    return time_of_thread


def work_that_takes(clock: threading.local, seconds: Callable[[], float]) -> Items:
    """A function that returns its item, and takes so many seconds of `clock`."""

    def work(item: int) -> int:
        clock.seconds = getattr(clock, "seconds", 0.0) + seconds()
        return item

    return work


def test_threads_that_pay_stay(clock: threading.local) -> None:
    with PacedThreads(4) as threads:
        assert threads.count == 1
        work = work_that_takes(clock, lambda: 1.0)
        assert list(threads.map(work, range(40), [1] * 40)) == list(range(40))
        assert threads.count == 4


@pytest.mark.parametrize("hindrance", [0.9, 1.0])
def test_threads_that_do_not_pay_go(clock: threading.local, hindrance: float) -> None:
    counts = set[int]()
    with PacedThreads(4) as threads:

        def seconds() -> float:
            # Items wait for each other, as for a lock.
            counts.add(threads.count)
            return 1.0 + hindrance * (threads.count - 1)

        assert list(threads.map(work_that_takes(clock, seconds), range(30), [1] * 30)) == list(range(30))
        assert threads.count == 1
    assert counts == {1, 2}, "two were tried"


@pytest.mark.parametrize("most", [1, 2, 3])
def test_results_come_in_order_whatever_is_found(most: int) -> None:
    with PacedThreads(most, count=most) as threads:
        for length in (0, 1, 5):
            assert list(threads.map(lambda item: -item, range(length), [7] * length)) == [-i for i in range(length)]
        assert threads.count <= most


def test_no_more_is_begun_than_is_asked_for() -> None:
    begun: list[int] = []
    with PacedThreads(2, count=2) as threads:
        results = threads.map(begun.append, range(10), [1] * 10)
        next(results)
        time.sleep(0.05)
        assert len(begun) <= 2
        results.close()  # type: ignore[attr-defined]
    assert len(begun) <= 2


@pytest.mark.parametrize("count", [1, 2])
def test_what_work_raises_is_raised(count: int) -> None:
    def fail(item: int) -> int:
        raise ValueError(f"item {item}")

    with PacedThreads(count, count=count) as threads, pytest.raises(ValueError, match="item 0"):
        list(threads.map(fail, range(5), [1] * 5))
