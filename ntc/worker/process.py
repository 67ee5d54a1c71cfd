"""The training process: reads commands in one thread and trains in the main one. torch is imported when it is needed."""

import importlib
import multiprocessing
import os
import queue
import signal
import socket
import threading
import time
import traceback
from collections.abc import Callable
from contextlib import suppress
from typing import Protocol

import numpy as np

from ntc.codec.encoding import EncodingChoices
from ntc.codec.model import Grouping
from ntc.codec.registry import codec_named
from ntc.codec.textures import SourceTexture
from ntc.errors import InputError, TrainingCancelledError
from ntc.threads import usable_cores, wait_passively
from ntc.training.progress import Ended, TrainingProgress
from ntc.training.request import TrainingRequest, checked_request
from ntc.training.snapshot import GroupSnapshot
from ntc.worker.pipe import WorkerEnd
from ntc.worker.protocol import (
    Cancel,
    Command,
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
    WorkerReport,
    decode_command,
    encode,
)
from ntc.worker.shared_arrays import SharedBlock

NICENESS = 19
"""Priority of the process, below the window's."""
LONGEST_DETAILS = 8000
"""Characters of a traceback: its end holds the error."""
WARM_TEXELS = 128
"""Along one side of the texture that a new process encodes for practice."""
NOT_A_COMMAND = 3
"""Exit status after bytes that are not a command. The window sees it, and starts another process."""


class WorkerState:
    """What the commands so far ask for: the listening thread writes it, the training reads it."""

    def __init__(self) -> None:
        self.starts: queue.SimpleQueue[StartTraining] = queue.SimpleQueue()
        self._changed = threading.Condition()
        self._paused = self._cancelled = self._progress_open = False
        self._open_snapshots: set[int] = set()

    def apply(self, command: Command) -> None:
        """Apply a command."""
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
        """Whether training is to pause."""
        return self._paused and not self._cancelled

    @property
    def cancelled(self) -> bool:
        """Whether training is to end."""
        return self._cancelled

    def wait(self, waits: Callable[[], bool]) -> None:
        """Wait while `waits` returns True and training is not cancelled."""
        with self._changed:
            self._changed.wait_for(lambda: self._cancelled or not waits())

    def open_progress(self) -> bool:
        """Whether a report may be sent; the next one only after ProgressTaken."""
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

    def __init__(self, pipe: WorkerEnd, state: WorkerState, block: SharedBlock, start: StartTraining) -> None:
        self._pipe, self._state, self._block, self._regions = pipe, state, block, start.regions
        self._paused_seconds = 0.0
        self._unsent: TrainingProgress | None = None
        """The newest report, where the window has not yet read the one before it."""

    def interruption(self) -> None:
        """Wait in a pause; raise TrainingCancelledError when cancelled."""
        if self._state.paused:
            began = time.monotonic()
            self._pipe.send(encode(Paused()))
            self._state.wait(lambda: self._state.paused)
            self._paused_seconds += time.monotonic() - began
            if not self._state.cancelled:
                self._pipe.send(encode(Resumed()))
        if self._state.cancelled:
            raise TrainingCancelledError

    def seconds(self) -> float:
        """Monotonic, without pauses."""
        return time.monotonic() - self._paused_seconds

    def progress(self, progress: TrainingProgress) -> None:
        """Send it; while the window has not yet read the last one the newest is kept."""
        if self._state.open_progress():
            self._pipe.send(encode(progress))
            self._unsent = None
        else:
            self._unsent = progress

    def send_newest_progress(self) -> None:
        """Send the report that was kept: none follows it, and a run that is shorter than a frame has no other."""
        if self._unsent is not None:
            self._pipe.send(encode(self._unsent))
            self._unsent = None

    def wants_snapshot(self, group: int) -> bool:
        """Whether the group's region is free."""
        return not self._state.snapshot_open(group)

    def snapshot(self, snapshot: GroupSnapshot) -> None:
        """Write it to its region as soon as that is free, and report it."""
        group = snapshot.group
        while self._state.snapshot_open(group):
            self._state.wait(lambda: self._state.snapshot_open(group) and not self._state.paused)
            self.interruption()
        self._state.open_snapshot(group)
        self._pipe.send(encode(self._block.write(snapshot, self._regions[group])))


def _listen(pipe: WorkerEnd, state: WorkerState) -> None:
    status = NOT_A_COMMAND
    try:
        while True:
            state.apply(decode_command(pipe.receive()))
    except (EOFError, OSError):
        status = 0
    finally:
        # The window is gone, or done with this process, which may be anywhere in a training: exit at once. Should this thread
        # end alone, nothing would notice that the window is gone.
        os._exit(status)


def read_request(start: StartTraining) -> TrainingRequest:
    """The request of a command, with copies of its arrays. Raises OSError, ValueError or InputError where it cannot be trained."""
    given = SharedBlock.open(start.input_block)
    try:
        request = given.read(start.request)
    finally:
        given.close()
    request = checked_request(request)
    missing = (request.dirty or frozenset()) - start.regions.keys()
    if missing:
        raise ValueError(f"no region is given for snapshots of group {min(missing)}")
    return request


def run_job(pipe: WorkerEnd, state: WorkerState, start: StartTraining) -> WorkerReport:
    """One training; returns how it ended. Raises whatever it fails by, and OSError when the window is gone."""
    request = read_request(start)
    block = SharedBlock.open(start.snapshot_block)
    try:
        pipe.send(encode(Received()))
        host = PipeHost(pipe, state, block, start)
        # Importing torch takes seconds, in which commands are already listened to.
        import torch

        torch.set_num_threads(max(1, usable_cores() - 1))
        _yield_to_others()
        try:
            host.interruption()
            ended = _trained(request, host)
        except TrainingCancelledError:
            ended = Ended("cancelled")
        host.send_newest_progress()
        return ended
    finally:
        block.close()


def _trained(request: TrainingRequest, host: PipeHost) -> Ended:
    from ntc.training.trainer import Trainer

    return Trainer(request, host).run()


def _yield_to_others() -> None:
    """Lower this process's priority, once."""
    if hasattr(os, "nice"):
        os.nice(max(0, NICENESS - os.nice(0)))


def _one_line(error: BaseException) -> str:
    text = " ".join(str(error).split())
    if isinstance(error, InputError):
        return text
    if isinstance(error, MemoryError) or "out of memory" in text or "allocate memory" in text:
        return f"training: there is not enough memory ({text or 'MemoryError'}); train fewer or smaller textures"
    return f"training: {type(error).__name__}: {text}"


def _warm_up() -> None:
    """Import what trains, and encode a texture: what torch does for the first time takes a second."""
    # An error is reported when a training imports it again.
    with suppress(Exception):
        from ntc.training.encode import encode_chosen

        noise = np.random.default_rng(0).integers(0, 256, (WARM_TEXELS, WARM_TEXELS, 3), np.uint8)
        encode_chosen(
            [SourceTexture("noise", noise, "")], Grouping("single", (0,)), codec_named("block"), EncodingChoices()
        )
        importlib.import_module("ntc.training.trainer")


def failure(error: Exception) -> Failed:
    """The report of a training that ended with `error`, which is being handled."""
    details = traceback.format_exc()[-LONGEST_DETAILS:]
    # File names may hold what is not Unicode.
    line, details = (text.encode("utf-8", "replace").decode() for text in (_one_line(error), details))
    return Failed(line[:LONGEST_DETAILS], details)


def serve(end: socket.socket) -> None:
    """The main function of the process: runs trainings, one after the other, until the other end of the pipe closes."""
    # Ctrl-C in a terminal reaches this process too; the window decides what it means.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    wait_passively()
    pipe, state = WorkerEnd(end), WorkerState()
    threading.Thread(target=_listen, args=(pipe, state), daemon=True).start()
    with suppress(BrokenPipeError, ConnectionResetError):
        pipe.send(encode(Ready()))
        # It takes seconds, in which a request may be prepared elsewhere, or be on its way.
        warming = threading.Thread(target=_warm_up, daemon=True)
        warming.start()
        while True:
            start = state.starts.get()
            # It sets the number of torch's threads too.
            warming.join()
            try:
                last = encode(run_job(pipe, state, start))
            except (BrokenPipeError, ConnectionResetError):
                raise
            except Exception as error:  # noqa: BLE001  Whatever fails is reported; the process stays for the next training.
                last = encode(failure(error))
            pipe.send(last)
    os._exit(0)


class TrainingProcess(Protocol):
    """What the client needs of a process: `multiprocessing.Process`, or a substitute in tests."""

    @property
    def pid(self) -> int | None:
        """The process id."""

    @property
    def exitcode(self) -> int | None:
        """None while it is alive; negative: the signal that killed it."""

    def is_alive(self) -> bool:
        """Whether it is alive."""

    def kill(self) -> None:
        """Kill it."""

    def join(self, timeout: float | None = None) -> None:
        """Wait for its end, at most `timeout` seconds."""

    def close(self) -> None:
        """Release its resources. Raises ValueError while it is alive."""


def start_process(end: socket.socket) -> TrainingProcess:
    """A process that serves the other end of the pipe and ends with this one. Raises OSError where none can be started."""
    process = multiprocessing.get_context("spawn").Process(target=serve, args=(end,), name="ntc-training", daemon=True)
    process.start()
    return process
