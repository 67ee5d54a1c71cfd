"""Background training as the window sees it: a handle to a process of its own. Needs no torch, and never waits."""

import socket
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field, replace

from ntc.errors import InputError, WireError
from ntc.pack.model import Pack
from ntc.training.progress import Ended, TrainingProgress
from ntc.training.request import TrainingRequest, checked_request
from ntc.training.snapshot import GroupSnapshot, apply_snapshot, ended_pack, grey_pack
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
"""A process that has not obeyed by then is ended."""
SECONDS_TO_CLOSE = 0.5
SECONDS_TO_LISTEN = 0.01
"""A process that talks without end is not listened to for longer at once."""
LONGEST_IDLE_REPORT = 1 << 16
"""Bytes, without a training."""
LONGEST_REASON = 300


@dataclass
class _Job:
    """A training under way, and what it holds."""

    request: TrainingRequest
    message: bytes
    """The StartTraining, as it goes through the pipe."""
    input: SharedBlock
    snapshots: SharedBlock
    pack: Pack
    """What `apply_snapshot` makes of the final snapshots so far."""
    sent: bool = False
    paused: bool = False
    """As the caller wants it."""
    final: set[int] = field(default_factory=set)
    """Groups whose last snapshot has come."""

    @property
    def longest_report(self) -> int:
        """Bytes. A report says less of each texture than the request and the names of its fields."""
        return LONGEST_IDLE_REPORT + 8 * len(self.message)

    def release(self) -> None:
        self.input.close()
        self.snapshots.close()


def starting_pack(request: TrainingRequest) -> Pack:
    """The pack that snapshots of a training are applied to: the one it starts from, or mid-grey."""
    return request.start or grey_pack(request.textures, request.grouping, request.codec)


def _job(request: TrainingRequest) -> _Job:
    pack = starting_pack(request)
    regions: dict[int, int] = {}
    size = 0
    for group in sorted(request.dirty or ()):
        regions[group] = size
        textures = tuple(t for t, g in zip(pack.textures, request.grouping.groups, strict=True) if g == group)
        size = without_arrays((textures, pack.decoders[0]), size)[2]
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
    """One training at a time in a process of its own, which is kept for the next one. Use in a `with` block, from one thread.

    `poll` must be called often (each frame): it takes in what the process says. Nothing here waits for the process, but
    `close`, for half a second at most. The process ends with this one, whatever happens to it; and whatever it sends, nothing
    but reports comes of it: what makes no sense ends the process, and the training under way with Failed.
    """

    def __init__(self, launch: Callable[[socket.socket], TrainingProcess] = start_process) -> None:
        """`launch` starts a process that serves the socket it is given, and raises OSError where it cannot."""
        self._launch = launch
        self._process: TrainingProcess | None = None
        self._pipe: WindowEnd | None = None
        self._ready = False
        self._silent = False
        """Whether all that the process said so far was heard."""
        self._job: _Job | None = None
        self._cancelled_at: float | None = None
        self._ended: list[Report] = []

    def __enter__(self) -> "TrainingWorker":
        return self

    def __exit__(self, *_exception: object) -> None:
        self.close()

    @property
    def busy(self) -> bool:
        """Whether a training is under way; it then ends with Finished or Failed."""
        return self._job is not None

    @property
    def process_id(self) -> int | None:
        """Of the process, where there is one."""
        return None if self._process is None else self._process.pid

    def warm_up(self) -> None:
        """Start the process ahead of a training, so that it has torch when that begins. Without effect where it runs, and
        where it cannot be started: `start` says why."""
        try:
            self._start_process()
        except OSError:
            self._end_process()

    def start(self, request: TrainingRequest) -> TrainingRequest:
        """Begin a training; returns the request with its dirty groups named. Raises InputError for what cannot be trained,
        for a training under way, and where there is no room in shared memory or for a process."""
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
        """What has happened since the last call, oldest first, with one snapshot at most: further ones come with the next
        calls, so that none takes long. Snapshots are copies, to be kept as long as needed."""
        reports, self._ended = self._ended, []
        # Asked first: what a process said before its end is still heard.
        lives = self._process is not None and self._process.is_alive()
        try:
            self._listen(reports)
            if self._process is not None and not lives and self._silent:
                reports += self._lost()
        except (EOFError, OSError):
            # It died, perhaps in the middle of a word.
            reports += self._lost()
        except (ValueError, MemoryError) as error:
            reports += self._nonsense(error)
        if self._cancelled_at is not None and time.monotonic() - self._cancelled_at > SECONDS_TO_CANCEL:
            self._end_process()
            reports += self._finish(Finished("cancelled"))
        return reports

    def _listen(self, reports: list[Report]) -> None:
        """Add what has come to `reports`, up to a snapshot or for SECONDS_TO_LISTEN. Raises EOFError or OSError when the
        process is gone, ValueError when it makes no sense."""
        self._silent = False
        end = time.monotonic() + SECONDS_TO_LISTEN
        while self._pipe is not None and time.monotonic() < end:
            self._pipe.flush()
            message = self._pipe.receive(LONGEST_IDLE_REPORT if self._job is None else self._job.longest_report)
            if message is None:
                self._silent = True
                return
            report = self._take(decode_report(message))
            if report is not None:
                reports.append(report)
            if isinstance(report, GroupSnapshot):
                return

    def pause(self) -> None:
        """Stand still; Paused follows. Without effect when nothing is under way."""
        self._set_paused(True)

    def resume(self) -> None:
        """Go on; Resumed follows."""
        self._set_paused(False)

    def _set_paused(self, paused: bool) -> None:
        if self._job is not None:
            self._job.paused = paused
            self._command(Pause() if paused else Resume())

    def cancel(self) -> None:
        """End the training; Finished follows within a second. Snapshots that were taken are the caller's to keep or drop."""
        if self._job is None or self._cancelled_at is not None:
            return
        self._cancelled_at = time.monotonic()
        self._command(Cancel())
        if not self._ready:
            # It is still starting, and holds nothing yet.
            self._end_process()
            self._ended += self._finish(Finished("cancelled"))

    def close(self) -> None:
        """End the process and give everything back; may be called again."""
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
            # Held here too, the pipe would never be found closed.
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
        """What the caller gets to see of a report. Raises ValueError for one that cannot be true."""
        job = self._job
        if isinstance(report, Ready):
            if self._ready:
                raise WireError("it starts twice")
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
                raise WireError("it ended what nobody cancelled")
            return None
        missing = (job.request.dirty or frozenset()) - job.final
        if missing:
            raise WireError(f"it ended without group {min(missing)}")
        return replace(ended_pack(job.pack, job.request.grouping), training=ended.record, path=None)

    def _finish(self, last: Finished | Failed) -> list[Report]:
        """The last report of the training under way, whose memory is given back; none without a training."""
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

    def _nonsense(self, error: Exception) -> list[Report]:
        reason = str(error)[:LONGEST_REASON] or type(error).__name__
        return self._failed(f"sent what makes no sense ({reason}), and was ended")

    def _failed(self, why: str) -> list[Report]:
        """End the process, and with it the training under way."""
        self._end_process()
        if self._cancelled_at is not None:
            return self._finish(Finished("cancelled"))
        line = f"training: its process {why}; what was shown stays, nothing else is lost: start the training again"
        return self._finish(sanitize(Failed(line)))
