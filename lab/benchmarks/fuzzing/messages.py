"""Messages of background training: one input is a talk, whose first byte says who talks and how."""

import random
import struct
from collections.abc import Iterator

import msgspec

from lab.benchmarks.fuzzing.mutators import Mutate, mutate_document
from ntc.errors import WireError
from ntc.training.snapshot import GroupSnapshot
from ntc.worker.pipe import framed
from ntc.worker.process import WorkerState, failure, read_request
from ntc.worker.protocol import (
    Cancel,
    Command,
    Failed,
    Pause,
    ProgressTaken,
    Ready,
    Resume,
    SnapshotTaken,
    StartTraining,
    decode_command,
    decode_report,
    encode,
)
from tests.support.worker_sessions import (
    BLOCK_CODEC,
    REFUSED,
    Orders,
    Session,
    left_of,
    placed,
    small_request,
    snapshots,
    starts,
    stream,
    whole_training,
)

REPORTS, COMMANDS, TRAINING, DYING = range(4)
"""Reports that are only decoded; commands; reports to a window that trains, from a process that lives on or dies."""
KINDS = 4
FILLS = (None, 0, 63, 127, 255)
"""Bytes of the snapshot block: as the window made it, small numbers, large ones and no numbers."""


def talks() -> Iterator[bytes]:
    """Well-formed ones."""
    request = small_request()
    whole, in_blocks = whole_training(request), whole_training(small_request(BLOCK_CODEC))
    failing = [*whole[:4], Failed("training: ran out of luck", "Traceback")]
    early = [*whole[:3], *placed(request, snapshots(request, final=False)), whole[-1]]
    for kind in (REPORTS, TRAINING, DYING):
        for reports in (whole, failing, early, in_blocks):
            yield bytes([kind]) + stream(reports)
    yield bytes([TRAINING + KINDS]) + stream([report for report in whole if not isinstance(report, GroupSnapshot)])
    yield bytes([TRAINING + KINDS * 3]) + stream(whole)
    commands: list[Command] = [
        *starts(),
        *starts(BLOCK_CODEC),
        Pause(),
        Resume(),
        SnapshotTaken(1),
        ProgressTaken(),
        Cancel(),
    ]
    yield bytes([COMMANDS]) + b"".join(framed(encode(command)) for command in commands)


def frames(data: bytes) -> list[bytes]:
    """The messages of a talk without their lengths; the last one may be cut."""
    found = []
    while len(data) >= 4:
        (length,) = struct.unpack_from("<I", data)
        found.append(data[4 : 4 + length])
        data = data[4 + length :]
    return found


class MessageReader:
    """Takes talks in, on either side. One session after the other; shared memory of orders is kept."""

    def __init__(self) -> None:
        self._orders = Orders()
        self._requests = {False: small_request(), True: small_request(BLOCK_CODEC)}
        """By whether snapshots are of codec `block`."""
        self._first = stream([Ready()])

    def close(self) -> None:
        """Give the shared memory back."""
        self._orders.close()

    def read(self, data: bytes) -> None:
        """Raises AssertionError, or whatever went wrong, unless the talk ends as it should."""
        kind, data = (data[0], data[1:]) if data else (0, data)
        if kind % KINDS == REPORTS:
            self._decode_reports(data)
        elif kind % KINDS == COMMANDS:
            self._obey(data)
        else:
            self._train(data, kind % KINDS == DYING, FILLS[kind // KINDS % len(FILLS)])

    def _decode_reports(self, data: bytes) -> None:
        for frame in frames(data):
            try:
                report = decode_report(frame)
            except WireError:
                continue
            assert encode(decode_report(encode(report))) == encode(report)

    def _obey(self, data: bytes) -> None:
        state = WorkerState()
        for frame in frames(data):
            try:
                command = decode_command(frame)
            except WireError:
                continue
            state.apply(command)
            if isinstance(command, StartTraining):
                try:
                    read_request(self._orders.named(command))
                except REFUSED as error:
                    encode(failure(error))

    def _train(self, data: bytes, dies: bool, fill: int | None) -> None:
        # A talk that begins as it should goes on once the order has come; any other one comes at once.
        whole = data.startswith(self._first)
        session = Session(self._first if whole else data, data[len(self._first) :] if whole else b"", fill)
        try:
            session.start(self._requests[b"GroupSnapshot.block" in data])
            session.run()
            if dies and session.worker.busy:
                session.processes[-1].die()
                session.run()
            assert not dies or not session.worker.busy
            assert len(session.ends) == (0 if session.worker.busy else 1), session.ends
        finally:
            session.worker.close()
        assert all(not process.is_alive() for process in session.processes)
        assert len(session.processes) == 1
        assert left_of(session.processes[0]) == []


def mutate_messages(data: bytes, limit: int, source: random.Random, mutate: Mutate) -> bytes:
    """A talk with messages changed, dropped, repeated, moved or cut, and the lengths still right; sometimes not even these."""
    head, found = data[:1] or b"\0", frames(data[1:])
    if not found:
        return mutate(data, limit)
    if source.random() < 0.1:
        head = bytes([source.randrange(KINDS * len(FILLS))])
    at = source.randrange(len(found))
    match source.randrange(10):
        case 0:
            del found[at]
        case 1:
            found.insert(source.randrange(len(found) + 1), found[at])
        case 2:
            found.insert(source.randrange(len(found) + 1), found.pop(at))
        case 3:
            found[at] = mutate(found[at], max(1, min(limit, 2 * len(found[at]) + 16)))
        case _:
            found[at] = _mutated(found[at], source) or mutate(found[at], max(1, min(limit, 2 * len(found[at]) + 16)))
    talk = head + b"".join(struct.pack("<I", len(frame)) + frame for frame in found)
    if source.random() < 0.05:
        cut = source.randrange(len(talk))
        talk = talk[:cut] + source.choice((b"", b"\xff\xff\xff\xff", source.randbytes(4))) + talk[cut + 4 :]
    return talk


def _mutated(frame: bytes, source: random.Random) -> bytes | None:
    try:
        document = msgspec.msgpack.decode(frame)
        for _ in range(source.choice((1, 1, 1, 2, 4))):
            document = mutate_document(document, source)
        return msgspec.msgpack.encode(document)
    except (ValueError, TypeError, OverflowError, RecursionError):
        return None
