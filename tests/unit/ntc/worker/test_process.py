"""The one kind of process beside the window: calls, commands during work, priorities, and arrays in shared memory."""

import math
import os
import signal
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing import shared_memory

import numpy as np
import pytest
from numpy.typing import NDArray

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
from ntc.worker.shared_arrays import LARGEST_INSIDE, Pickled, SharedBlock, inside, received, sent
from tests.support.training_workers import array_bytes, blocks, lives

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


@pytest.mark.process
@pytest.mark.skipif(sys.platform == "win32", reason="stops and interrupts by signal")
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


@pytest.mark.process
@pytest.mark.skipif(sys.platform == "win32", reason="stops and interrupts by signal")
def test_commands_arrive_during_work() -> None:
    with running(obey) as process:
        process.call(None)
        for command in (Pause(), Resume(), Taken(7), Cancel()):
            assert isinstance(process.receive(SECONDS), Paused | Resumed | Part)
            assert process.receive() is None, "it waits"
            process.send(command)
        assert answer(process) == (False, True)


@pytest.mark.process
@pytest.mark.skipif(sys.platform == "win32", reason="stops and interrupts by signal")
def test_it_has_its_priority_and_ctrl_c_is_not_its_business() -> None:
    with running(priority, 10) as process:
        process.call(None)
        assert answer(process) == max(10, os.getpriority(os.PRIO_PROCESS, 0))
        assert process.pid is not None
        os.kill(process.pid, signal.SIGINT)
        process.call(None)
        assert isinstance(answer(process), int)


@pytest.mark.process
@pytest.mark.skipif(sys.platform == "win32", reason="stops and interrupts by signal")
def test_a_process_that_was_stopped_holds_up_nobody() -> None:
    with running(total) as process:
        process.call(LARGE)
        answer(process)
        assert process.pid is not None
        os.kill(process.pid, signal.SIGSTOP)
        # More than the pipe takes: a call that waited would never return.
        for _ in range(1000):
            process.call("x" * 1000)
            assert process.receive() is None
    assert not lives(process.pid)


@pytest.mark.process
@pytest.mark.skipif(sys.platform == "win32", reason="stops and interrupts by signal")
@pytest.mark.parametrize("killed", [True, False])
def test_ended_in_the_middle_of_a_call_it_says_how_and_leaves_nothing(killed: bool) -> None:
    with running(sleep) as process:
        process.call(600)
        process.call(LARGE)
        assert len(blocks()) == 1
        assert process.pid is not None
        if killed:
            os.kill(process.pid, signal.SIGKILL)
        else:
            process.end()
        with pytest.raises(ProcessEndedError, match="was killed by signal 9"):
            process.receive(SECONDS)
        assert not process.is_alive
    with pytest.raises(ProcessEndedError):
        process.call(LARGE)
    assert blocks() == []


@dataclass(frozen=True, eq=False)
class _Inner:
    values: NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class _Value:
    decibels: float
    parts: tuple[_Inner, ...]
    bytes: NDArray[np.uint8]
    empty: NDArray[np.float64]


def value() -> _Value:
    """Arrays of several types and sizes, one not contiguous."""
    random = np.random.default_rng(0)
    cut = [_Inner(random.random((3, n), np.float32)[::2]) for n in (1, LARGEST_INSIDE)]
    whole = _Inner(random.random(LARGEST_INSIDE + 1, np.float32))
    return _Value(math.inf, (*cut, whole), random.integers(0, 256, (LARGEST_INSIDE + 1, 3), np.uint8), np.zeros((0, 2)))


def test_what_is_sent_arrives_and_the_memory_has_no_name_once_it_is_open() -> None:
    given = value()
    payload, block = sent(given)
    assert block is not None
    assert blocks() == [block.name]
    large = (given.parts[2].values.nbytes, given.bytes.nbytes)
    assert payload.sizes == large, "what is small, and what is not contiguous, goes inside the message"
    found = received(payload)
    assert blocks() == []
    block.close()
    block.close()
    assert found.decibels == math.inf
    assert array_bytes(found) == array_bytes(given)
    assert found.parts[1].values.dtype == np.float32
    assert found.bytes.shape == given.bytes.shape
    assert not found.bytes.flags.writeable


def test_values_lie_side_by_side_in_a_block() -> None:
    first, second = (Pickled(np.full(LARGEST_INSIDE + 1, number, np.uint8)) for number in (1, 2))
    block = SharedBlock.create(first.size + second.size)
    parcels = [block.write(first), block.write(second, first.size)]
    assert [int(block.read(payload).max()) for payload in parcels] == [1, 2]
    with pytest.raises(ValueError, match="arrays end at byte"):
        block.write(second, first.size + 8192)
    block.close()
    with pytest.raises(ValueError, match="closed"):
        block.read(parcels[0])
    assert blocks() == []


@pytest.mark.skipif(not hasattr(os, "posix_fallocate"), reason="room is not asked for ahead here")
def test_no_room_is_said_and_nothing_stays() -> None:
    before = blocks()
    with pytest.raises(InputError, match=r"shared memory: 1099512 MB cannot be allocated \(.*\); allow more"):
        SharedBlock.create(1 << 40)
    assert blocks() == before


def test_without_shared_memory_it_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_arguments: object, **_options: object) -> None:
        raise OSError(38, "Function not implemented")

    monkeypatch.setattr("ntc.worker.shared_arrays.SharedMemory", refuse)
    with pytest.raises(InputError, match="Function not implemented"):
        SharedBlock.create(10)
    assert shared_memory.SharedMemory is not refuse
