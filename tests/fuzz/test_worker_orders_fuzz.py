"""Background training: whatever a window sends, the process refuses it, goes on, and does not stay behind."""

import socket
import struct
import time
import tracemalloc
from collections.abc import Iterator
from dataclasses import replace
from typing import Any, cast

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from ntc.codec.encoding import StepBudget
from ntc.codec.grid.training.config import TrainingConfig
from ntc.codec.model import Grouping
from ntc.errors import WireError
from ntc.training.progress import Ended
from ntc.worker.pipe import LONGEST_COMMAND, WindowEnd, WorkerEnd, framed
from ntc.worker.process import NOT_A_COMMAND, TrainingProcess, WorkerState, run_job, start_process
from ntc.worker.protocol import (
    Cancel,
    Failed,
    Pause,
    ProgressTaken,
    Ready,
    Received,
    SnapshotTaken,
    WorkerReport,
    decode_command,
    decode_report,
    encode,
)
from tests.support.worker_sessions import (
    BLOCK_CODEC,
    REFUSED,
    Orders,
    starts,
)

pytestmark = pytest.mark.process

QUICK = settings(deadline=1000, max_examples=150, suppress_health_check=[HealthCheck.too_slow])


def test_memory_grows_with_what_came_and_not_with_what_was_claimed() -> None:
    own, other = socket.socketpair()
    with other:
        end = WindowEnd(own)
        tracemalloc.start()
        other.sendall(struct.pack("<I", LONGEST_COMMAND) + b"x" * 100)
        assert end.receive(LONGEST_COMMAND) is None
        for claim in (
            b"\xdd\x7f\xff\xff\xff",
            b"\xdf\x7f\xff\xff\xff",
            b"\xdb\x7f\xff\xff\xff",
            b"\xc6\x7f\xff\xff\xff",
        ):
            for decode in (decode_command, decode_report):
                with pytest.raises(WireError):
                    decode(b"\x92\xa6Failed\x81\xa4line" + claim)
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        assert peak < 1 << 20
        end.close()


@pytest.fixture
def orders() -> Iterator[Orders]:
    """Shared memory for orders."""
    made = Orders()
    yield made
    made.close()


@pytest.fixture
def ends() -> Iterator[tuple[WorkerEnd, socket.socket]]:
    """Both ends of a pipe."""
    own, other = socket.socketpair()
    with own, other:
        yield WorkerEnd(own), other


ORDER = starts()[0]


BAD_ORDERS: dict[str, Any] = {
    "other memory": replace(ORDER, input_block="../../etc/passwd"),
    "memory that is gone": replace(ORDER, input_block="ntc-0-" + "9" * 16),
    "no room": replace(ORDER, regions={}),
    "groups without end": replace(ORDER, request=replace(ORDER.request, grouping=Grouping("x", (0, 2**62, 0)))),
    "a negative group": replace(ORDER, request=replace(ORDER.request, grouping=Grouping("x", (0, -1, 0)))),
    "no groups": replace(ORDER, request=replace(ORDER.request, grouping=Grouping("x", ()))),
    "a budget below nothing": replace(ORDER, request=replace(ORDER.request, budget=StepBudget(-1))),
    "a pack of other groups": replace(
        starts()[1],
        request=replace(
            starts()[1].request,
            start=replace(starts()[1].request.start, grouping=Grouping("x", (0, 2**62, 0))),  # type: ignore[type-var]
        ),
    ),
    "a pack of another codec": replace(
        ORDER, request=replace(ORDER.request, start=starts(BLOCK_CODEC)[1].request.start)
    ),
    "objects": replace(
        ORDER,
        request=replace(
            ORDER.request,
            textures=tuple(replace(t, pixels=replace(cast(Any, t.pixels), dtype="|O")) for t in ORDER.request.textures),
        ),
    ),
}


@pytest.mark.parametrize("what", BAD_ORDERS)
def test_bad_orders_are_refused_before_anything_is_done(
    what: str, orders: Orders, ends: tuple[WorkerEnd, socket.socket]
) -> None:
    began = time.monotonic()
    with pytest.raises(REFUSED, match=r"."):
        run_job(ends[0], WorkerState(), orders.named(BAD_ORDERS[what]))
    assert time.monotonic() - began < 1.0
    ends[1].setblocking(False)
    with pytest.raises(BlockingIOError):
        ends[1].recv(1)


@given(
    commands=st.lists(
        st.one_of(
            st.sampled_from([Pause(), Cancel(), ProgressTaken(), Ready(), None, 3, "x", b"", ORDER]),
            st.builds(SnapshotTaken, st.integers(-(2**63), 2**63)),
        ),
        max_size=8,
    )
)
@QUICK
def test_the_worker_state_takes_anything(commands: list[Any]) -> None:
    state = WorkerState()
    for command in commands:
        state.apply(command)
    assert state.starts.qsize() == commands.count(ORDER)
    assert not (state.paused and state.cancelled)
    assert state.open_progress() in (True, False)


def _process() -> tuple[TrainingProcess, socket.socket]:
    own, other = socket.socketpair()
    process = start_process(other)
    other.close()
    own.settimeout(120.0)
    return process, own


def _report(pipe: WorkerEnd) -> WorkerReport:
    return decode_report(pipe.receive())


def test_the_process_answers_bad_orders_goes_on_and_leaves_at_the_first_nonsense(orders: Orders) -> None:
    process, end = _process()
    with end:
        pipe = WorkerEnd(end)
        assert isinstance(_report(pipe), Ready)
        for what in ("other memory", "groups without end", "no room"):
            pipe.send(encode(BAD_ORDERS[what]))
            answer = _report(pipe)
            assert isinstance(answer, Failed)
            assert answer.line.isprintable()
        pipe.send(encode(orders.named(ORDER)))
        for command in (Pause(), SnapshotTaken(-5), ProgressTaken(), Cancel()):
            pipe.send(encode(command))
        assert isinstance(_report(pipe), Received)
        assert _report(pipe) == Ended("cancelled")
        absurd = TrainingConfig(steps=None, epochs=1e308, device="cpu")
        pipe.send(encode(orders.named(replace(ORDER, request=replace(ORDER.request, training=absurd)))))
        assert isinstance(_report(pipe), Received)
        assert isinstance(_report(pipe), Failed)
        assert process.is_alive()
        end.sendall(framed(b"\x80\x04garbage"))
        process.join(10.0)
        assert process.exitcode == NOT_A_COMMAND, "with the pipe still open: the window sees that it is gone"
    process.close()


@pytest.mark.parametrize("last", [b"", b"\x05", struct.pack("<I", 100) + b"half", b"\xff\xff\xff\xff"])
def test_the_process_does_not_stay_behind(last: bytes) -> None:
    process, end = _process()
    end.sendall(last)
    end.close()
    process.join(10.0)
    assert process.exitcode in (0, NOT_A_COMMAND)
    process.close()
