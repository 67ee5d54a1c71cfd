"""Background training: whatever one side sends, the other one neither raises nor hangs, and leaves nothing behind."""

import contextlib
import pickle
import random
import struct
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import msgspec
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from lab.benchmarks.fuzzing.messages import FILLS, KINDS, MessageReader, mutate_messages, talks
from ntc.codec.grid.model import GridDecoder
from ntc.errors import InputError, WireError
from ntc.training.progress import Ended, GroupOutcome
from ntc.training.snapshot import GroupSnapshot
from ntc.worker.pipe import framed
from ntc.worker.protocol import (
    Cancel,
    Command,
    Failed,
    Finished,
    Pause,
    Paused,
    ProgressTaken,
    Ready,
    Received,
    SnapshotTaken,
    WorkerReport,
    decode_command,
    decode_report,
    encode,
)
from ntc.worker.shared_arrays import ArrayPlace
from tests.support.worker_sessions import (
    BLOCK_CODEC,
    CODEC,
    Session,
    left_of,
    placed,
    progress,
    small_request,
    snapshots,
    starts,
    stream,
    whole_training,
)

REQUEST = small_request()


WHOLE = whole_training(REQUEST)


IN_BLOCKS = small_request(BLOCK_CODEC)


FIRST, REST = stream(WHOLE[:1]), stream(WHOLE[1:])


TALKS = list(talks())


LONGEST_POLL = 0.5
"""Seconds, on a loaded machine; a poll takes 0.01 and the copy of a snapshot."""


SLOW = settings(deadline=2000, max_examples=150, suppress_health_check=[HealthCheck.too_slow])


QUICK = settings(deadline=1000, max_examples=150, suppress_health_check=[HealthCheck.too_slow])


@pytest.fixture(scope="module")
def reader() -> Iterator[MessageReader]:
    """Takes talks in on either side, and checks how they end."""
    made = MessageReader()
    yield made
    made.close()


@pytest.mark.parametrize(
    "message",
    [*WHOLE, *whole_training(IN_BLOCKS), Failed("a", "b"), Ended("cancelled")],
    ids=lambda m: type(m).__name__,
)
def test_reports_arrive_as_they_were_sent(message: WorkerReport) -> None:
    found = decode_report(encode(message))
    assert type(found) is type(message)
    assert encode(found) == encode(message)


def test_orders_arrive_as_they_were_sent() -> None:
    orders: tuple[Command, ...] = (
        *starts(),
        *starts(BLOCK_CODEC),
        Pause(),
        Cancel(),
        SnapshotTaken(3),
        ProgressTaken(),
    )
    for order in orders:
        assert encode(decode_command(encode(order))) == encode(order)


@given(data=st.binary(max_size=300))
@QUICK
def test_any_bytes_are_a_message_or_refused(data: bytes) -> None:
    for decode in (decode_command, decode_report):
        with contextlib.suppress(WireError):
            decode(data)


JSON_LIKE = st.recursive(
    st.one_of(
        st.none(),
        st.booleans(),
        st.integers(-(2**63), 2**64 - 1),
        st.floats(),
        st.text(max_size=8),
        st.binary(max_size=8),
    ),
    lambda inner: st.one_of(
        st.lists(inner, max_size=4),
        st.dictionaries(st.one_of(st.text(max_size=8), st.integers(-3, 3)), inner, max_size=4),
    ),
    max_leaves=12,
)


@given(
    name=st.sampled_from(
        ["Ready", "Ended", "Failed", "GroupSnapshot.grid", "GroupSnapshot.block", "SnapshotTaken", "x"]
    ),
    fields=st.dictionaries(
        st.sampled_from(["step", "group", "line", "details", "reason", "outcomes", "record", "members", "shape"]),
        st.one_of(JSON_LIKE, st.sampled_from(["Ready", "Ended", "Failed", "GroupSnapshot", "Cancel", "done"])),
    ),
)
@QUICK
def test_any_document_is_a_message_or_refused(name: str, fields: dict[str, Any]) -> None:
    data = msgspec.msgpack.encode((name, fields))
    for decode in (decode_command, decode_report):
        with contextlib.suppress(WireError):
            decode(data)


def _flip(source: random.Random) -> Callable[[bytes, int], bytes]:
    def mutate(data: bytes, limit: int) -> bytes:
        changed = bytearray(data)
        for _ in range(source.choice((1, 2, 8))):
            if changed:
                changed[source.randrange(len(changed))] = source.randrange(256)
        return bytes(changed[:limit])

    return mutate


@given(talk=st.sampled_from(TALKS), rounds=st.integers(1, 4), seed=st.integers(0, 2**32))
@settings(SLOW, max_examples=400)
def test_damaged_talks_end_as_they_should(reader: MessageReader, talk: bytes, rounds: int, seed: int) -> None:
    source = random.Random(seed)
    for _ in range(rounds):
        talk = mutate_messages(talk, 1 << 14, source, _flip(source))
    reader.read(talk)


@given(data=st.binary(max_size=200), kind=st.integers(0, KINDS * len(FILLS) - 1))
@SLOW
def test_random_talks_end_as_they_should(reader: MessageReader, data: bytes, kind: int) -> None:
    reader.read(bytes([kind]) + data)


def _snapshot(**changes: Any) -> GroupSnapshot:
    return replace(placed(REQUEST, snapshots(REQUEST))[0], **changes)


def _with_texture(**changes: Any) -> GroupSnapshot:
    first, *others = _snapshot().textures
    return _snapshot(textures=(replace(first, **changes), *others))


def _with_latents(place: ArrayPlace) -> GroupSnapshot:
    return _with_texture(latents=place)


def _ended(**changes: Any) -> Ended:
    return replace(Ended("done", (), {}), **changes)


LATENTS: Any = _snapshot().textures[0].latents
"""The place of the first ones."""


HOSTILE: dict[str, WorkerReport | bytes] = {
    "objects, whose addresses would be followed": _with_latents(replace(LATENTS, dtype="|O")),
    "structured": _with_latents(replace(LATENTS, dtype="i4,f8")),
    "no type": _with_latents(replace(LATENTS, dtype="((((")),
    "before the block": _with_latents(replace(LATENTS, offset=-64)),
    "behind the block": _with_latents(replace(LATENTS, offset=2**62)),
    "an overflowing shape": _with_latents(replace(LATENTS, shape=(2**33, 2**33))),
    "a negative shape": _with_latents(replace(LATENTS, shape=(-1, -4))),
    "65 axes": _with_latents(replace(LATENTS, shape=(1,) * 65)),
    "another shape": _with_latents(replace(LATENTS, shape=(1, 3))),
    "a group that is not there": _snapshot(group=7),
    "a negative group": _snapshot(group=-1),
    "members of another group": _snapshot(members=(1,)),
    "no members": _snapshot(members=(), textures=()),
    "members that are not there": _snapshot(members=(0, 2**40)),
    "too few textures": _snapshot(textures=_snapshot().textures[:1]),
    "other pixels": _with_texture(pixel_hash="f" * 32),
    "another size": _with_texture(width=2**31),
    "another name": _with_texture(name="\x1b[2J"),
    "another group of the texture": _with_texture(group=9),
    "a PSNR that overflows": _with_texture(psnr_db=-1e308),
    "no adapter": _with_texture(adapter=None),
    "half an adapter": _with_texture(adapter=replace(_snapshot().textures[0].adapter, output_bias=None)),  # type: ignore[type-var]
    "no decoder": _snapshot(decoder=GridDecoder((), ())),
    "a decoder with too few layers": _snapshot(
        decoder=GridDecoder(_snapshot().decoder.weights[:2], _snapshot().decoder.biases)  # type: ignore[union-attr]
    ),
    "a snapshot of another codec": placed(IN_BLOCKS, snapshots(IN_BLOCKS))[0],
    "ended before all groups": _ended(),
    "ended by a cancel that nobody sent": _ended(reason="cancelled"),
    "an outcome of no group": _ended(outcomes=(GroupOutcome(5, None, 1.0),)),
    "an outcome that is no number": _ended(outcomes=(GroupOutcome(0, float("nan"), 1.0),)),
    "a record that is no JSON": _ended(record={"a": b"bytes"}),
    "a record without end": _ended(
        record={"a": [[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[]]]]]]]]]]]]]]]]]]]]]]]]]]]]]]]]]]]]}
    ),
    "a record that is infinite": _ended(record={"a": float("inf")}),
    "progress that is no number": replace(progress(), seconds_left=float("nan")),
    "progress backwards": replace(progress(), step=-5),
    "progress of no texture": replace(progress(), psnr_db={2**40: 1.0}),
    "progress that overflows a curve": replace(progress(), psnr_db={0: -1e308}),
    "progress of no group": replace(progress(), losses={-1: 1.0}),
    "a note for a terminal": replace(progress(), note="\x1b[2J\n"),
    "starting twice": Ready(),
    "pickled": pickle.dumps(Paused()),
    "nothing": b"",
    "a command": encode(Cancel()),
    "nested without end": b"\x91" * 60000,
    "a list of 2^32 - 1": b"\xdd\xff\xff\xff\xff",
    "an unknown field": msgspec.msgpack.encode(("Ready", {"more": 1})),
    "half a surrogate": b"\x92\xa6Failed\x81\xa4line\xa3\xed\xa0\x80",
    "larger than anything": bytes(1 << 20),
}


@pytest.mark.parametrize("what", HOSTILE)
def test_what_makes_no_sense_ends_the_training_in_one_line_and_it_can_begin_again(what: str) -> None:
    bad = HOSTILE[what]
    session = Session(FIRST, stream([Received(), progress()]) + framed(bad if isinstance(bad, bytes) else encode(bad)))
    session.start(REQUEST)
    session.run()
    (end,) = session.ends
    assert isinstance(end, Failed)
    assert "invalid message" in end.line
    assert not session.worker.busy
    assert session.processes[0].exitcode == -9, "it was ended"
    assert left_of(session.processes[0]) == []
    session.says(FIRST, REST)
    session.start(REQUEST)
    session.run()
    assert isinstance(session.ends[-1], Finished)
    session.worker.close()
    assert all(left_of(process) == [] for process in session.processes)


@pytest.mark.parametrize("fill", [127, 255])
def test_weights_that_are_no_numbers_are_refused(fill: int) -> None:
    codec = replace(CODEC, latent_bits=8)
    request = small_request(codec)
    session = Session(FIRST, stream(whole_training(request)[1:]), fill)
    session.start(request)
    session.run()
    assert isinstance(session.ends[0], Finished if fill == 127 else Failed)
    assert fill == 127 or "not finite" in session.ends[0].line  # type: ignore[union-attr]
    session.worker.close()


@pytest.mark.parametrize("name", ["half \ud800", "x" * 4000])
def test_names_of_any_kind_are_sent_or_refused(name: str) -> None:
    session = Session(FIRST, b"")
    request = replace(REQUEST, textures=(replace(REQUEST.textures[0], name=name), *REQUEST.textures[1:]))
    before = _open_files()
    if len(name) < 1000:
        with pytest.raises(InputError, match="cannot be sent"):
            session.start(request)
        assert not session.worker.busy
        assert _open_files() == before
        return
    # What the process says of them may be as long.
    session.says(FIRST, stream(whole_training(request)[1:]))
    session.start(request)
    session.run()
    assert isinstance(session.ends[0], Finished)
    session.worker.close()


def test_what_is_said_without_a_training_ends_the_process_quietly() -> None:
    session = Session(stream([Ready(), progress()]))
    session.worker.warm_up()
    assert session.poll() == []
    assert session.processes[0].exitcode == -9
    session.says(FIRST, REST)
    session.start(REQUEST)
    session.run()
    assert isinstance(session.ends[-1], Finished)


def test_a_message_without_an_end_holds_nobody_up() -> None:
    session = Session(FIRST, struct.pack("<I", 1000) + b"x" * 500)
    session.start(REQUEST)
    for _ in range(20):
        began = time.monotonic()
        assert session.poll() == []
        assert time.monotonic() - began < LONGEST_POLL
    assert session.worker.busy
    session.worker.cancel()
    began = time.monotonic()
    while session.worker.busy:
        session.poll()
        assert time.monotonic() - began < 2.0
        time.sleep(0.01)
    (end,) = session.ends
    assert isinstance(end, Finished)
    assert left_of(session.processes[0]) == []


def test_who_talks_without_end_and_never_listens_is_ended() -> None:
    session = Session(FIRST, b"")
    session.start(REQUEST)
    session.poll()
    process, data = session.processes[0], stream([progress()]) * 500
    left = data
    began = time.monotonic()
    while session.worker.busy and time.monotonic() - began < 20.0:
        left = left[process.say(left) :] or data
        asked = time.monotonic()
        session.worker.poll()
        assert time.monotonic() - asked < LONGEST_POLL
    assert not session.worker.busy
    assert not process.is_alive()


def _open_files() -> int:
    folder = Path("/proc/self/fd")
    return len(list(folder.iterdir())) if folder.is_dir() else 0


STEPS = st.lists(
    st.one_of(
        st.sampled_from([encode(report) for report in WHOLE]),
        st.sampled_from([bad if isinstance(bad, bytes) else encode(bad) for bad in HOSTILE.values()]),
        st.sampled_from(["start", "pause", "resume", "cancel", "die", "close", "warm"]),
    ),
    max_size=14,
)


@given(steps=STEPS)
@SLOW
def test_any_order_of_anything_is_survived(steps: list[bytes | str]) -> None:
    open_files = _open_files()
    session = Session(FIRST)
    session.start(REQUEST)
    started = 1
    for step in steps:
        process = session.processes[-1]
        if isinstance(step, bytes):
            process.say(framed(step))
        elif step == "start" and not session.worker.busy:
            session.start(REQUEST)
            started += 1
        elif step == "die":
            process.die()
        elif step in ("pause", "resume", "cancel"):
            getattr(session.worker, step)()
        elif step == "warm":
            session.worker.warm_up()
        elif step == "close":
            started -= session.worker.busy
            session.worker.close()
        began = time.monotonic()
        session.poll()
        assert time.monotonic() - began < LONGEST_POLL
    assert len(session.ends) == started - session.worker.busy, "each training ends once"
    session.worker.close()
    assert not any(process.is_alive() for process in session.processes)
    assert all(left_of(process) == [] for process in session.processes)
    assert _open_files() <= open_files
