"""The training process: listens to commands in a thread, trains in the main one. torch is imported when it is needed."""

import importlib
import os
import queue
import signal
import socket
import threading
import time
import traceback
from collections.abc import Callable
from contextlib import suppress

from ntc.errors import InputError
from ntc.pack.validate import check_pack
from ntc.training.checks import checked_request
from ntc.training.snapshot import GroupSnapshot
from ntc.worker.pipe import WorkerEnd
from ntc.worker.protocol import (
    Cancel,
    Command,
    Ended,
    Failed,
    Pause,
    Paused,
    ProgressTaken,
    Ready,
    Received,
    Resume,
    Resumed,
    SnapshotTaken,
    StartTraining,
    TrainingRequest,
    WorkerProgress,
    WorkerReport,
)
from ntc.worker.shared_arrays import SharedBlock
from ntc.worker.wire import decode_command, encode

NICENESS = 19
"""The window comes first."""
LONGEST_DETAILS = 8000
"""Characters of a traceback: its end says what happened."""
NOT_A_COMMAND = 3
"""Exit status after what the window did not say. Training may hang on it: the window tells, and starts another process."""


class Switchboard:
    """What the commands say now; the listening thread writes it and the training reads it."""

    def __init__(self) -> None:
        self.starts: queue.SimpleQueue[StartTraining] = queue.SimpleQueue()
        self._changed = threading.Condition()
        self._paused = self._cancelled = self._progress_open = False
        self._open_snapshots: set[int] = set()

    def obey(self, command: Command) -> None:
        """Take a command in."""
        with self._changed:
            if isinstance(command, StartTraining):
                self._paused = self._cancelled = self._progress_open = False
                self._open_snapshots.clear()
                self.starts.put(command)
            elif isinstance(command, Pause):
                self._paused = True
            elif isinstance(command, Resume):
                self._paused = False
            elif isinstance(command, Cancel):
                self._cancelled = True
            elif isinstance(command, SnapshotTaken):
                self._open_snapshots.discard(command.group)
            elif isinstance(command, ProgressTaken):
                self._progress_open = False
            self._changed.notify_all()

    @property
    def paused(self) -> bool:
        """Whether training is to stand still."""
        return self._paused and not self._cancelled

    @property
    def cancelled(self) -> bool:
        """Whether training is to end."""
        return self._cancelled

    def wait(self, waits: Callable[[], bool]) -> None:
        """Wait as long as `waits` says, and training is not cancelled."""
        with self._changed:
            self._changed.wait_for(lambda: self._cancelled or not waits())

    def open_progress(self) -> bool:
        """Whether a report may be sent; from then on not until it is taken."""
        with self._changed:
            free, self._progress_open = not self._progress_open, True
            return free

    def snapshot_open(self, group: int) -> bool:
        """Whether the last snapshot of a group was not yet taken."""
        return group in self._open_snapshots

    def open_snapshot(self, group: int) -> None:
        """A snapshot of the group is about to be sent."""
        with self._changed:
            self._open_snapshots.add(group)


class PipeHost:
    """Runs a training for the other end of a pipe."""

    def __init__(self, pipe: WorkerEnd, board: Switchboard, block: SharedBlock, start: StartTraining) -> None:
        self._pipe, self._board, self._block, self._regions = pipe, board, block, start.regions
        self._stood = 0.0
        """Seconds in pauses."""

    def interruption(self) -> None:
        """Wait in a pause; raise TrainingCancelledError when cancelled."""
        if self._board.paused:
            began = time.monotonic()
            self._pipe.send(encode(Paused()))
            self._board.wait(lambda: self._board.paused)
            self._stood += time.monotonic() - began
            if not self._board.cancelled:
                self._pipe.send(encode(Resumed()))
        if self._board.cancelled:
            from ntc.training.progress import TrainingCancelledError

            raise TrainingCancelledError

    def seconds(self) -> float:
        """Monotonic, without pauses."""
        return time.monotonic() - self._stood

    def progress(self, progress: WorkerProgress) -> None:
        """Send it, unless the last one still waits."""
        if self._board.open_progress():
            self._pipe.send(encode(progress))

    def wants_snapshot(self, group: int) -> bool:
        """Whether the group's region is free."""
        return not self._board.snapshot_open(group)

    def snapshot(self, snapshot: GroupSnapshot) -> None:
        """Write it to its region as soon as that is free, and say so."""
        group = snapshot.group
        while self._board.snapshot_open(group):
            self._board.wait(lambda: self._board.snapshot_open(group) and not self._board.paused)
            self.interruption()
        self._board.open_snapshot(group)
        self._pipe.send(encode(self._block.write(snapshot, self._regions[group])))


def _listen(pipe: WorkerEnd, board: Switchboard) -> None:
    status = NOT_A_COMMAND
    try:
        while True:
            board.obey(decode_command(pipe.receive()))
    except (EOFError, OSError):
        status = 0
    finally:
        # The other process is gone, or done with this one. Training may be anywhere: leave without further ado. Nothing may
        # end this thread alone, for then nobody would notice that the window is gone.
        os._exit(status)


def read_request(start: StartTraining) -> TrainingRequest:
    """What is to be trained, with its arrays. Raises OSError, ValueError or InputError for what cannot be."""
    given = SharedBlock.open(start.input_block)
    try:
        request = given.read(start.request)
    finally:
        given.close()
    if request.start is not None:
        check_pack(request.start)
    request = checked_request(request)
    missing = (request.dirty or frozenset()) - start.regions.keys()
    if missing:
        raise ValueError(f"there is no room for snapshots of group {min(missing)}")
    return request


def train_as_told(pipe: WorkerEnd, board: Switchboard, start: StartTraining) -> WorkerReport:
    """One training; returns how it ended. Raises whatever makes it impossible, and OSError when the window is gone."""
    request = read_request(start)
    block = SharedBlock.open(start.snapshot_block)
    try:
        pipe.send(encode(Received()))
        host = PipeHost(pipe, board, block, start)
        # Importing torch takes seconds, in which commands are already listened to.
        import torch

        from ntc.training.progress import TrainingCancelledError
        from ntc.training.retrain import Retraining

        torch.set_num_threads(max(1, _cores() - 1))
        _yield_to_others()
        try:
            host.interruption()
            return Retraining(request, host).run()
        except TrainingCancelledError:
            return Ended("cancelled")
    finally:
        block.close()


def _yield_to_others() -> None:
    """Lower this process's priority, once."""
    if hasattr(os, "nice"):
        os.nice(max(0, NICENESS - os.nice(0)))


def _cores() -> int:
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def _one_line(error: BaseException) -> str:
    text = " ".join(str(error).split())
    if isinstance(error, InputError):
        return text
    if isinstance(error, MemoryError) or "out of memory" in text or "allocate memory" in text:
        return f"training: there is not enough memory ({text or 'MemoryError'}); train fewer or smaller textures"
    return f"training: {type(error).__name__}: {text}"


def _import_training() -> None:
    # What is wrong with it is said when the training imports it.
    with suppress(Exception):
        importlib.import_module("ntc.training.retrain")


def failure(error: Exception) -> Failed:
    """What is said of a training that ended with an exception."""
    details = traceback.format_exc()[-LONGEST_DETAILS:]
    # File names may hold what is no Unicode.
    line, details = (text.encode("utf-8", "replace").decode() for text in (_one_line(error), details))
    return Failed(line[:LONGEST_DETAILS], details)


def serve(end: socket.socket) -> None:
    """The process: trains what it is told to, one after the other, until the other end of the pipe closes."""
    # Ctrl-C in a terminal reaches this process too; the other one decides what it means.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    pipe, board = WorkerEnd(end), Switchboard()
    threading.Thread(target=_listen, args=(pipe, board), daemon=True).start()
    with suppress(BrokenPipeError, ConnectionResetError):
        pipe.send(encode(Ready()))
        # Importing takes seconds, in which a request may be prepared elsewhere, or be on its way.
        threading.Thread(target=_import_training, daemon=True).start()
        while True:
            start = board.starts.get()
            try:
                last = encode(train_as_told(pipe, board, start))
            except (BrokenPipeError, ConnectionResetError):
                raise
            except Exception as error:
                last = encode(failure(error))
            pipe.send(last)
    os._exit(0)
