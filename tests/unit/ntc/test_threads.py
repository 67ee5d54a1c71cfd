"""Threads that encode: as many as pay, in order, and no further than is asked for."""

import os
import threading
import time

import pytest

from ntc.threads import PacedThreads, usable_cores, wait_passively

ITEM_SECONDS = 0.01


def sleep(item: int) -> int:
    """Work that other threads do not hinder."""
    time.sleep(ITEM_SECONDS)
    return item


@pytest.mark.timing
def test_threads_that_pay_stay() -> None:
    with PacedThreads(4) as threads:
        assert threads.count == 1
        assert list(threads.map(sleep, range(40), [1] * 40)) == list(range(40))
        assert threads.count == 4


@pytest.mark.timing
def test_threads_that_do_not_pay_go() -> None:
    lock = threading.Lock()

    def work(item: int) -> int:
        with lock:
            return sleep(item)

    with PacedThreads(4) as threads:
        assert list(threads.map(work, range(30), [1] * 30)) == list(range(30))
        assert threads.count == 1


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
        time.sleep(5 * ITEM_SECONDS)
        assert len(begun) <= 2
        results.close()  # type: ignore[attr-defined]
    assert len(begun) <= 2


@pytest.mark.parametrize("count", [1, 2])
def test_what_work_raises_is_raised(count: int) -> None:
    def fail(item: int) -> int:
        raise ValueError(f"item {item}")

    with PacedThreads(count, count=count) as threads, pytest.raises(ValueError, match="item 0"):
        list(threads.map(fail, range(5), [1] * 5))


def test_what_the_user_has_set_about_waiting_stays(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("OMP_WAIT_POLICY", "active")
    monkeypatch.delenv("KMP_BLOCKTIME", raising=False)
    wait_passively()
    assert (os.environ["OMP_WAIT_POLICY"], os.environ["KMP_BLOCKTIME"]) == ("active", "0")
    assert usable_cores() >= 1
