"""The window's handle to the training process. Needs no torch, and never blocks."""

import socket
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field, replace

from ntc.codec.model import Pack
from ntc.codec.registry import codec_of
from ntc.errors import InputError, WireError
from ntc.training.progress import Ended, TrainingProgress
from ntc.training.request import TrainingRequest, checked_request
from ntc.training.snapshot import GroupSnapshot, apply_snapshot, ended_pack
from ntc.worker.pipe import WindowEnd, framed
from ntc.worker.process import TrainingProcess, start_process
from ntc.worker.protocol import (
    Cancel,
    Command,
    Failed,
    Finished,
    Pause,
    ProgressTaken,
    Ready,
    Received,
    Report,
    Resume,
    SnapshotTaken,
    StartTraining,
    WorkerReport,
    decode_report,
    encode,
)
from ntc.worker.report_checks import check_ended, check_progress, check_snapshot, sanitize
from ntc.worker.shared_arrays import SharedBlock, without_arrays

SECONDS_TO_CANCEL = 0.6
"""After this long a process that has not cancelled its training is killed."""
SECONDS_TO_CLOSE = 0.5
SECONDS_TO_READ = 0.01
"""Longest time that one poll reads messages, however many there are."""
LONGEST_IDLE_REPORT = 1 << 16
"""Bytes: the longest report that is accepted while no training is under way."""
LONGEST_REASON = 300


@dataclass
class _Job:
    """A training under way, and its shared memory."""

    request: TrainingRequest
    message: bytes
    """The framed StartTraining message."""
    input: SharedBlock
    snapshots: SharedBlock
    pack: Pack
    """The starting pack with the final snapshots so far applied."""
    sent: bool = False
    paused: bool = False
    """Whether the caller asked for a pause."""
    final: set[int] = field(default_factory=set)
    """Groups whose final snapshot has arrived."""

    @property
    def longest_report(self) -> int:
        """Bytes. A report holds less about each texture than the request does."""
        return LONGEST_IDLE_REPORT + 8 * len(self.message)

    def release(self) -> None:
        self.input.close()
        self.snapshots.close()


def starting_pack(request: TrainingRequest) -> Pack:
    """The pack that snapshots of a training are applied to: the one it starts from, else mid-grey (codec `grid`) or the mean
    colours of textures (codec `block`)."""
    if request.start is not None:
        return request.start
    return codec_of(request.codec).starting_pack(request.textures, request.grouping, request.codec)


def _job(request: TrainingRequest) -> _Job:
    pack = starting_pack(request)
    # Codes may become larger than those that a training starts from.
    largest = (
        pack if request.start is None or pack.config.kind == "grid" else starting_pack(replace(request, start=None))
    )
    regions: dict[int, int] = {}
    size = 0
    for group in sorted(request.dirty or ()):
        regions[group] = size
        textures = tuple(t for t, g in zip(largest.textures, request.grouping.groups, strict=True) if g == group)
        size = without_arrays((textures, largest.decoders[0]), size)[2]
    given = SharedBlock.create(without_arrays(request)[2])
    try:
        snapshots = SharedBlock.create(size)
    except InputError:
        given.close()
        raise
    try:
        message = framed(encode(StartTraining(given.write(request), given.name, snapshots.name, regions)))
    except WireError as error:
        given.close()
        snapshots.close()
        raise InputError(f"training: {error}; remove that from the names or the pack's record") from error
    return _Job(request, message, given, snapshots, pack)


class TrainingWorker:
    """Runs one training at a time in a separate process, which is kept for the next one. Use in a `with` block, from one thread.

    `poll` must be called often (each frame): it reads the reports of the process. Only `close` waits for the process, for half
    a second at most. The process ends with this one, however this one ends. An invalid message ends the process, and the
    training under way with Failed.
    """

    def __init__(self, launch: Callable[[socket.socket], TrainingProcess] = start_process) -> None:
        """`launch` starts a process that serves the socket it is given, and raises OSError where it cannot."""
        self._launch = launch
        self._process: TrainingProcess | None = None
        self._pipe: WindowEnd | None = None
        self._ready = False
        self._all_read = False
        """Whether all bytes received so far have been read."""
        self._job: _Job | None = None
        self._cancelled_at: float | None = None
        self._ended: list[Report] = []

    def __enter__(self) -> "TrainingWorker":
        return self

    def __exit__(self, *_exception: object) -> None:
        self.close()

    @property
    def busy(self) -> bool:
        """Whether a training is under way; its last report is Finished or Failed."""
        return self._job is not None

    @property
    def process_id(self) -> int | None:
        """Id of the training process; None while there is none."""
        return None if self._process is None else self._process.pid

    def warm_up(self) -> None:
        """Start the process ahead of a training, so that it has imported torch by then. No effect where it runs already or
        cannot be started; `start` reports why."""
        try:
            self._start_process()
        except OSError:
            self._end_process()

    def start(self, request: TrainingRequest) -> TrainingRequest:
        """Start a training; returns the request with its dirty groups named. Raises InputError for what cannot be trained, for
        a training under way, and where there is no shared memory or no process to be had."""
        if self._job is not None:
            raise InputError("training: another one is under way; cancel it first")
        request = checked_request(request)
        job = _job(request)
        try:
            self._start_process()
        except OSError as error:
            job.release()
            self._end_process()
            raise InputError(
                f"training: no process can be started ({error.strerror or error}); close others"
            ) from error
        self._job = job
        self._cancelled_at = None
        self._send_start()
        return request

    def poll(self) -> list[Report]:
        """The reports since the last call, oldest first, with one snapshot at most: further ones follow in the next calls,
        so that no call takes long. Arrays of snapshots are copies."""
        reports, self._ended = self._ended, []
        # Checked first: what a process sent before its end is still read.
        lives = self._process is not None and self._process.is_alive()
        try:
            self._read_reports(reports)
            if self._process is not None and not lives and self._all_read:
                reports += self._lost()
        except (EOFError, OSError):
            # It ended, perhaps in the middle of a message.
            reports += self._lost()
        except (ValueError, MemoryError) as error:
            reports += self._invalid(error)
        if self._cancelled_at is not None and time.monotonic() - self._cancelled_at > SECONDS_TO_CANCEL:
            self._end_process()
            reports += self._finish(Finished("cancelled"))
        return reports

    def _read_reports(self, reports: list[Report]) -> None:
        """Append new reports to `reports`, up to a snapshot or for SECONDS_TO_READ. Raises EOFError or OSError when the
        process is gone, ValueError for an invalid message."""
        self._all_read = False
        end = time.monotonic() + SECONDS_TO_READ
        while self._pipe is not None and time.monotonic() < end:
            self._pipe.flush()
            message = self._pipe.receive(LONGEST_IDLE_REPORT if self._job is None else self._job.longest_report)
            if message is None:
                self._all_read = True
                return
            report = self._take(decode_report(message))
            if report is not None:
                reports.append(report)
            if isinstance(report, GroupSnapshot):
                return

    def pause(self) -> None:
        """Pause the training; a Paused report follows. No effect while no training is under way."""
        self._set_paused(True)

    def resume(self) -> None:
        """Continue after a pause; a Resumed report follows."""
        self._set_paused(False)

    def _set_paused(self, paused: bool) -> None:
        if self._job is not None:
            self._job.paused = paused
            self._command(Pause() if paused else Resume())

    def cancel(self) -> None:
        """End the training; Finished follows within a second. The caller may keep snapshots that it got."""
        if self._job is None or self._cancelled_at is not None:
            return
        self._cancelled_at = time.monotonic()
        self._command(Cancel())
        if not self._ready:
            # The process is still starting: there is nothing to wait for.
            self._end_process()
            self._ended += self._finish(Finished("cancelled"))

    def close(self) -> None:
        """End the process and release its shared memory; may be called again."""
        self._finish(Finished("cancelled"))
        self._end_process()
        self._ended = []

    def _start_process(self) -> None:
        if self._process is not None and self._process.is_alive():
            return
        self._end_process()
        own, other = socket.socketpair()
        self._pipe = WindowEnd(own)
        try:
            self._process = self._launch(other)
        finally:
            # An open copy in this process would hide that the other end was closed.
            other.close()

    def _end_process(self) -> None:
        self._ready = False
        if self._pipe is not None:
            self._pipe.close()
            self._pipe = None
        if self._process is not None:
            self._process.kill()
            self._process.join(SECONDS_TO_CLOSE)
            with suppress(ValueError):
                self._process.close()
            self._process = None

    def _command(self, command: Command) -> None:
        if self._job is not None and self._job.sent and self._pipe is not None:
            self._pipe.send(framed(encode(command)))

    def _send_start(self) -> None:
        job = self._job
        if self._ready and job is not None and not job.sent and self._pipe is not None:
            job.sent = True
            self._pipe.send(job.message)
            if job.paused:
                self._command(Pause())

    def _take(self, report: WorkerReport) -> Report | None:
        """The report as the caller gets it, or None. Raises ValueError for one that does not fit the training."""
        job = self._job
        if isinstance(report, Ready):
            if self._ready:
                raise WireError("it reported Ready twice")
            self._ready = True
            self._send_start()
            return None
        if job is None or not job.sent:
            raise WireError(f"{type(report).__name__} before there is a training")
        if isinstance(report, Received):
            job.input.close()
            job.snapshots.remove_name()
            return None
        if isinstance(report, TrainingProgress):
            check_progress(report, job.request)
            self._command(ProgressTaken())
            return report
        if isinstance(report, GroupSnapshot):
            snapshot = job.snapshots.read(report)
            check_snapshot(snapshot, job.request)
            self._command(SnapshotTaken(report.group))
            if snapshot.final:
                job.pack = apply_snapshot(job.pack, snapshot)
                job.final.add(snapshot.group)
            return snapshot
        if isinstance(report, Ended):
            return self._finish(Finished(report.reason, report.outcomes, self._pack_of(report, job)))[0]
        if isinstance(report, Failed):
            return self._finish(sanitize(report))[0]
        return report

    def _pack_of(self, ended: Ended, job: _Job) -> Pack | None:
        check_ended(ended, job.request)
        if ended.reason == "cancelled":
            if self._cancelled_at is None:
                raise WireError("it reported a cancelled training that was not cancelled")
            return None
        missing = (job.request.dirty or frozenset()) - job.final
        if missing:
            raise WireError(f"it ended without a final snapshot of group {min(missing)}")
        return replace(ended_pack(job.pack, job.request.grouping), training=ended.record, path=None)

    def _finish(self, last: Finished | Failed) -> list[Report]:
        """End the training under way with `last`, and release its memory; no report without a training."""
        job, self._job, self._cancelled_at = self._job, None, None
        if job is None:
            return []
        job.release()
        return [last]

    def _lost(self) -> list[Report]:
        process = self._process
        if process is None:
            return []
        process.join(SECONDS_TO_CLOSE)
        code = process.exitcode
        if code is None:
            return self._failed("closed its pipe")
        return self._failed(f"was killed by signal {-code}" if code < 0 else f"ended with status {code}")

    def _invalid(self, error: Exception) -> list[Report]:
        reason = str(error)[:LONGEST_REASON] or type(error).__name__
        return self._failed(f"sent an invalid message ({reason}), and was ended")

    def _failed(self, why: str) -> list[Report]:
        """End the process, and with it the training under way."""
        self._end_process()
        if self._cancelled_at is not None:
            return self._finish(Finished("cancelled"))
        line = f"training: its process {why}; open packs are unchanged; start the training again"
        return self._finish(sanitize(Failed(line)))
