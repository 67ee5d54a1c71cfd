"""Background training as the window sees it: a handle to a process of its own. Needs no torch, and never waits."""

import multiprocessing
import time
from contextlib import suppress
from dataclasses import dataclass, replace
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from pickle import UnpicklingError

from ntc.errors import InputError
from ntc.pack import Pack
from ntc.shared_arrays import SharedBlock, without_arrays
from ntc.snapshot import GroupSnapshot, apply_snapshot, ended_pack, grey_pack
from ntc.training_checks import checked_request
from ntc.worker_messages import (
    Cancel,
    Command,
    Ended,
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
    TrainingRequest,
    WorkerProgress,
    WorkerReport,
)
from ntc.worker_process import serve

SECONDS_TO_CANCEL = 0.6
"""A process that has not obeyed by then is ended."""
SECONDS_TO_CLOSE = 0.5


@dataclass
class _Job:
    """A training under way, and what it holds."""

    request: TrainingRequest
    message: StartTraining
    input: SharedBlock
    snapshots: SharedBlock
    pack: Pack
    """What `apply_snapshot` makes of the final snapshots so far."""
    sent: bool = False
    paused: bool = False
    """As the caller wants it."""

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
    message = StartTraining(given.write(request), given.name, snapshots.name, regions)
    return _Job(request, message, given, snapshots, pack)


class TrainingWorker:
    """One training at a time in a process of its own, which is kept for the next one. Use in a `with` block, from one thread.

    `poll` must be called often (each frame): it takes in what the process says. Nothing here waits for the process, but
    `close`, for half a second at most. The process ends with this one, whatever happens to it.
    """

    def __init__(self) -> None:
        self._process: BaseProcess | None = None
        self._connection: Connection | None = None
        self._ready = False
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
        try:
            while self._connection is not None and self._connection.poll(0):
                report = self._take(self._connection.recv())
                if report is not None:
                    reports.append(report)
                if isinstance(report, GroupSnapshot):
                    break
        except (EOFError, OSError, UnpicklingError):
            # It died, perhaps in the middle of a word.
            reports += self._lost()
        if self._process is not None and not self._process.is_alive() and not self._something_left():
            reports += self._lost()
        if self._cancelled_at is not None and time.monotonic() - self._cancelled_at > SECONDS_TO_CANCEL:
            self._end_process()
            reports += self._finish(Finished("cancelled"))
        return reports

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
        context = multiprocessing.get_context("spawn")
        self._connection, other_end = context.Pipe()
        try:
            self._process = context.Process(target=serve, args=(other_end,), name="ntc-training", daemon=True)
            self._process.start()
        except OSError:
            self._process = None
            raise
        finally:
            # Held here too, the pipe would never be found closed.
            other_end.close()

    def _end_process(self) -> None:
        self._ready = False
        if self._connection is not None:
            self._connection.close()
            self._connection = None
        if self._process is not None:
            self._process.kill()
            self._process.join(SECONDS_TO_CLOSE)
            with suppress(ValueError):
                self._process.close()
            self._process = None

    def _command(self, command: Command) -> None:
        if self._job is not None and self._job.sent and self._connection is not None:
            with suppress(OSError):
                self._connection.send(command)

    def _send_start(self) -> None:
        job = self._job
        if self._ready and job is not None and not job.sent and self._connection is not None:
            with suppress(OSError):
                self._connection.send(job.message)
            job.sent = True
            if job.paused:
                self._command(Pause())

    def _something_left(self) -> bool:
        try:
            return self._connection is not None and self._connection.poll(0)
        except OSError:
            return False

    def _take(self, report: WorkerReport) -> Report | None:
        job = self._job
        if isinstance(report, Ready):
            self._ready = True
            self._send_start()
            return None
        if job is None:
            return None
        if isinstance(report, Received):
            job.input.close()
            job.snapshots.remove_name()
            return None
        if isinstance(report, WorkerProgress):
            self._command(ProgressTaken())
            return report
        if isinstance(report, GroupSnapshot):
            snapshot = job.snapshots.read(report)
            self._command(SnapshotTaken(report.group))
            if snapshot.final:
                job.pack = apply_snapshot(job.pack, snapshot)
            return snapshot
        if isinstance(report, Ended):
            pack = None
            if report.reason != "cancelled":
                pack = replace(ended_pack(job.pack, job.request.grouping), training=report.record, path=None)
            return self._finish(Finished(report.reason, report.outcomes, pack))[0]
        if isinstance(report, Failed):
            return self._finish(report)[0]
        return report

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
        self._end_process()
        if self._cancelled_at is not None:
            return self._finish(Finished("cancelled"))
        why = f"was killed by signal {-code}" if code is not None and code < 0 else f"ended with status {code}"
        return self._finish(
            Failed(f"training: its process {why}; what was shown stays, nothing else is lost: start the training again")
        )
