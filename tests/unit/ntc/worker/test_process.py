"""The one kind of process beside the window: calls, commands during work, priorities, and that nobody waits for it."""

import os
import signal
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
import pytest

from ntc.errors import InputError, ProcessEndedError
from ntc.worker.process import (
    Answer,
    Cancel,
    Failed,
    Function,
    Part,
    Pause,
    Paused,
    Resume,
    Resumed,
    Taken,
    WindowEnd,
    WorkerProcess,
    WorkerReport,
)
from ntc.worker.shared_arrays import inside, received
from tests.support.training_workers import blocks, lives

pytestmark = [
    pytest.mark.process,
    pytest.mark.skipif(sys.platform == "win32", reason="stops and interrupts by signal"),
]
SECONDS = 60.0
LARGE = np.arange(1 << 20, dtype=np.uint8)


@contextmanager
def running(function: Function, niceness: int = 0) -> Iterator[WorkerProcess]:
    process = WorkerProcess(function, "tested", niceness)
    try:
        yield process
    finally:
        process.end()


def answer(process: WorkerProcess) -> object:
    report = process.receive(SECONDS)
    assert isinstance(report, Answer), report
    return received(report.value)


def total(numbers: np.ndarray | None, _window: WindowEnd) -> int:
    """Raises InputError for None."""
    if numbers is None:
        raise InputError("nothing to\nadd up")
    return int(numbers.sum())


def priority(_argument: object, _window: WindowEnd) -> int:
    return os.getpriority(os.PRIO_PROCESS, 0)


def obey(_argument: object, window: WindowEnd) -> tuple[bool, bool]:
    """Waits for a pause, its end, and the window to take what was sent, and then to be cancelled."""
    window.send(Resumed())
    window.wait(lambda: not window.paused)
    window.send(Paused())
    window.wait(lambda: window.paused)
    window.send_part(7, inside(None))
    window.wait(lambda: window.is_untaken(7))
    before = window.cancelled
    window.send(Paused())
    window.wait(lambda: True)
    return before, window.cancelled


def sleep(seconds: float, _window: WindowEnd) -> None:
    time.sleep(seconds)


def test_calls_are_answered_in_order_and_a_failure_is_one_line() -> None:
    with running(total) as process:
        process.call(LARGE)
        process.call(None)
        process.call(LARGE[:10])
        assert answer(process) == LARGE.sum()
        failed: WorkerReport | None = process.receive(SECONDS)
        assert isinstance(failed, Failed)
        assert failed.line == "nothing to add up"
        assert "InputError" in failed.details
        assert answer(process) == 45
        assert process.receive() is None
        assert blocks() == []


def test_commands_arrive_during_work() -> None:
    with running(obey) as process:
        process.call(None)
        for command in (Pause(), Resume(), Taken(7), Cancel()):
            assert isinstance(process.receive(SECONDS), Paused | Resumed | Part)
            assert process.receive() is None, "it waits"
            process.send(command)
        assert answer(process) == (False, True)


def test_it_has_its_priority_and_ctrl_c_is_not_its_business() -> None:
    with running(priority, 10) as process:
        process.call(None)
        assert answer(process) == max(10, os.getpriority(os.PRIO_PROCESS, 0))
        assert process.pid is not None
        os.kill(process.pid, signal.SIGINT)
        process.call(None)
        assert isinstance(answer(process), int)


def test_a_process_that_was_stopped_holds_up_nobody() -> None:
    with running(total) as process:
        process.call(LARGE)
        answer(process)
        assert process.pid is not None
        os.kill(process.pid, signal.SIGSTOP)
        began = time.monotonic()
        for _ in range(1000):
            process.call("x" * 1000)
            assert process.receive() is None
        assert time.monotonic() - began < 1.0
    assert not lives(process.pid)


@pytest.mark.parametrize("killed", [True, False])
def test_ended_in_the_middle_of_a_call_it_says_how_and_leaves_nothing(killed: bool) -> None:
    with running(sleep) as process:
        process.call(600)
        process.call(LARGE)
        assert len(blocks()) == 1
        assert process.pid is not None
        began = time.monotonic()
        if killed:
            os.kill(process.pid, signal.SIGKILL)
        else:
            process.end()
        with pytest.raises(ProcessEndedError, match="was killed by signal 9"):
            process.receive(SECONDS)
        assert time.monotonic() - began < 1.0
        assert not process.is_alive
    with pytest.raises(ProcessEndedError):
        process.call(LARGE)
    assert blocks() == []
