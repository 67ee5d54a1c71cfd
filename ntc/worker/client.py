"""Training in a worker process: the part in the process, and the window's handle to it, which needs no torch and never blocks."""

import importlib
import json
import threading
import time
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from ntc.codec.encoding import EncodingChoices
from ntc.codec.model import Grouping, Pack
from ntc.codec.registry import CodecName, chosen_codec, codec_named, codec_of
from ntc.codec.textures import SourceTexture
from ntc.errors import InputError, ProcessEndedError, TrainingCancelledError
from ntc.threads import usable_cores, wait_passively
from ntc.training.compiling import CompilingAhead
from ntc.training.messages import (
    Ended,
    EndReason,
    GroupOutcome,
    GroupSnapshot,
    TrainingProgress,
    TrainingRequest,
    apply_snapshot,
    checked_request,
    ended_pack,
)
from ntc.worker.helpers import IDLE_SECONDS
from ntc.worker.process import (
    Answer,
    Cancel,
    Failed,
    Part,
    Pause,
    Paused,
    Resume,
    Resumed,
    Taken,
    WindowEnd,
    WorkerProcess,
    WorkerReport,
    lower_priority,
)
from ntc.worker.shared_arrays import Pickled, SharedBlock, inside, received

NICENESS = 19
"""Priority of a process that trains, below the window's; it starts with the window's."""
WARM_TEXELS = 128
"""Side in texels of the texture that a new process encodes for practice."""


@dataclass(frozen=True, eq=False)
class TrainingOrder:
    """A training, and where its snapshots go."""

    request: TrainingRequest
    """The request, with its dirty groups named."""
    block: str
    """Name of the shared memory of all snapshots."""
    regions: Mapping[int, int]
    """First byte of the region of each dirty group in the block."""


class _WindowHost:
    """Runs a training for the window."""

    def __init__(self, window: WindowEnd, block: SharedBlock, regions: Mapping[int, int]) -> None:
        self._window, self._block, self._regions = window, block, regions
        self._paused_seconds = 0.0
        self._unsent: TrainingProgress | None = None
        """The newest report, where the window has not yet taken the one before it."""

    def interruption(self) -> None:
        """Wait in a pause; raise TrainingCancelledError when cancelled."""
        if self._window.paused:
            began = time.monotonic()
            self._window.send(Paused())
            self._window.wait(lambda: self._window.paused)
            self._paused_seconds += time.monotonic() - began
            if not self._window.cancelled:
                self._window.send(Resumed())
        if self._window.cancelled:
            raise TrainingCancelledError

    def seconds(self) -> float:
        """Monotonic, without pauses."""
        return time.monotonic() - self._paused_seconds

    def progress(self, progress: TrainingProgress) -> None:
        """Send it; while the window has not yet taken the last one the newest is kept."""
        self._unsent = progress
        if not self._window.is_untaken(None):
            self.send_newest_progress()

    def send_newest_progress(self) -> None:
        """Send the report that was kept. At the end none follows it, and a run that is shorter than a frame has no other."""
        if self._unsent is not None:
            self._window.send_part(None, inside(self._unsent))
            self._unsent = None

    def wants_snapshot(self, group: int) -> bool:
        """Return whether the group's region is free."""
        return not self._window.is_untaken(group)

    def snapshot(self, snapshot: GroupSnapshot) -> None:
        """Write it to its region as soon as that is free, and report it."""
        group = snapshot.group
        while self._window.is_untaken(group):
            self._window.wait(lambda: self._window.is_untaken(group) and not self._window.paused)
            self.interruption()
        self._window.send_part(group, self._block.write(Pickled(snapshot), self._regions[group]))


def run_training(order: TrainingOrder | None, window: WindowEnd) -> Ended | None:
    """Train; without an order the process only gets ready for one, which takes seconds. Raises InputError, whatever it fails by."""
    if order is None:
        warm_up()
        return None
    try:
        block = SharedBlock.open(order.block)
        try:
            return _run(order.request, _WindowHost(window, block, order.regions))
        finally:
            block.close()
    except Exception as error:
        raise InputError(_one_line(error)) from error


def _run(request: TrainingRequest, host: _WindowHost) -> Ended:
    import torch

    torch.set_num_threads(max(1, usable_cores() - 1))
    lower_priority(NICENESS)
    from ntc.training.trainer import Trainer

    try:
        host.interruption()
        _compiling_ahead(request.codec.kind).wait(host.progress, host.interruption)
        ended = Trainer(request, host, snapshots=host).run()
    except TrainingCancelledError:
        ended = Ended("cancelled")
    host.send_newest_progress()
    # Plain JSON: the version of torch is of a class of torch's, which the window does not import.
    return replace(ended, record=json.loads(json.dumps(ended.record)))


def _one_line(error: BaseException) -> str:
    text = " ".join(str(error).split())
    if isinstance(error, InputError):
        return text
    if isinstance(error, MemoryError) or "out of memory" in text or "allocate memory" in text:
        return f"training: there is not enough memory ({text or 'MemoryError'}); train fewer or smaller textures"
    return f"training: {type(error).__name__}: {text}"


@cache
def _compiling_ahead(codec: CodecName) -> CompilingAhead:
    """Return the compiling of a codec's encoder, which begins once in a process."""
    return CompilingAhead(codec_named(codec))


def warm_up() -> None:
    """Import what trains, and encode a texture: what torch does for the first time takes a second. Where the encoder is to be compiled
    first, that goes on when this returns."""
    wait_passively()
    # An error is reported when a training imports it again.
    with suppress(Exception):
        importlib.import_module("ntc.training.trainer")
        from ntc.training.encode import encode_chosen

        name = chosen_codec(EncodingChoices())
        if not _compiling_ahead(name).wait_loaded():
            return
        noise = np.random.default_rng(0).integers(0, 256, (WARM_TEXELS, WARM_TEXELS, 3), np.uint8)
        encode_chosen(
            [SourceTexture("noise", noise, "")], Grouping("single", (0,)), codec_named(name), EncodingChoices()
        )


SECONDS_TO_CANCEL = 0.6
"""After this long a process that has not cancelled its training is killed."""


@dataclass(frozen=True, eq=False)
class Finished:
    """The training is over."""

    reason: EndReason
    outcomes: tuple[GroupOutcome, ...] = ()
    pack: Pack | None = None
    """The trained pack; None when the training was cancelled."""


Report = Paused | Resumed | TrainingProgress | GroupSnapshot | Finished | Failed
"""Reports that the window gets."""


def starting_pack(request: TrainingRequest) -> Pack:
    """Return the pack that snapshots of a training are applied to: the one it starts from, else mid-grey (codec `grid`) or the mean
    colours of textures (codec `block`)."""
    if request.start is not None:
        return request.start
    return codec_of(request.codec).starting_pack(request.textures, request.grouping, request.codec)


def _regions(request: TrainingRequest, start: Pack) -> tuple[Mapping[int, int], int]:
    """Return the first byte of the region for snapshots of each dirty group, and the bytes of all regions."""
    # Codes may become larger than those that a training starts from.
    largest = start if request.start is None else starting_pack(replace(request, start=None))
    regions, size = dict[int, int](), 0
    for group in sorted(request.dirty or ()):
        regions[group] = size
        textures = [t for t, own in zip(largest.textures, request.grouping.groups, strict=True) if own == group]
        size += sum(Pickled(part).size for part in (*textures, largest.decoders[group]))
    return regions, size


@dataclass(eq=False)
class _Training:
    """A training under way."""

    request: TrainingRequest
    snapshots: SharedBlock


class TrainingWorker:
    """Runs one training at a time in a separate process. Use in a `with` block, from one thread.

    The process waits for the next training, and ends when none begins for a while: it holds hundreds of megabytes.

    `poll` must be called often (each frame): it takes the reports of the process. Only `close` waits for the process, for half
    a second at most. The process ends with this one, however this one ends.
    """

    def __init__(self, idle_seconds: float = IDLE_SECONDS) -> None:
        """Make it without a process, which ends `idle_seconds` after the last training."""
        self._idle_seconds = idle_seconds
        self._idle: threading.Timer | None = None
        """Timer that ends the process."""
        self._process: WorkerProcess | None = None
        self._warming = False
        """True if the process is still importing what trains."""
        self._training: _Training | None = None
        self.pack: Pack | None = None
        """The pack that the latest training started from, with the snapshots that have been reported."""
        self._cancelled_at: float | None = None
        self._ended: list[Report] = []

    def __enter__(self) -> "TrainingWorker":
        return self

    def __exit__(self, *_exception: object) -> None:
        self.close()

    @property
    def busy(self) -> bool:
        """True if a training is under way; its last report is Finished or Failed."""
        return self._training is not None

    @property
    def process_id(self) -> int | None:
        """Id of the training process; None while there is none."""
        return None if self._process is None else self._process.pid

    def warm_up(self) -> None:
        """Start the process ahead of a training, so that it has imported torch by then. No effect where it runs already or
        cannot be started; `start` reports why."""
        try:
            self._started()
        except OSError:
            self._end_process()

    def start(self, request: TrainingRequest) -> TrainingRequest:
        """Start a training; returns the request with its dirty groups named. Raises InputError for what cannot be trained, for
        a training under way, and where there is no shared memory or no process to be had."""
        if self._training is not None:
            raise InputError("training: another one is under way; cancel it first")
        request = checked_request(request)
        pack = starting_pack(request)
        regions, size = _regions(request, pack)
        snapshots = SharedBlock.create(size)
        try:
            self._started().call(TrainingOrder(request, snapshots.name, regions))
        except InputError:
            snapshots.close()
            raise
        except OSError as error:
            snapshots.close()
            self._end_process()
            raise InputError(
                f"training: cannot start a process ({error.strerror or error}); close other programs"
            ) from error
        self._training, self.pack, self._cancelled_at = _Training(request, snapshots), pack, None
        return request

    def poll(self) -> list[Report]:
        """Return the reports since the last call, oldest first, with one snapshot at most: further ones follow in the next calls, so
        that no call takes long. Arrays of snapshots are copies."""
        reports, self._ended = self._ended, []
        try:
            while self._process is not None and not (reports and isinstance(reports[-1], GroupSnapshot)):
                report = self._process.receive()
                if report is None:
                    break
                reports += self._taken(report)
        except ProcessEndedError as error:
            reports += self._lost(str(error))
        if self._cancelled_at is not None and time.monotonic() - self._cancelled_at > SECONDS_TO_CANCEL:
            self._end_process()
            reports += self._finish(Finished("cancelled"))
        return reports

    def pause(self) -> None:
        """Pause the training; a Paused report follows. No effect while no training is under way."""
        self._send(Pause())

    def resume(self) -> None:
        """Continue after a pause; a Resumed report follows."""
        self._send(Resume())

    def cancel(self) -> None:
        """End the training; Finished follows within a second. The caller may keep snapshots that it got."""
        if self._training is None or self._cancelled_at is not None:
            return
        self._cancelled_at = time.monotonic()
        self._send(Cancel())
        if self._warming:
            # The process is still starting: there is nothing to wait for.
            self._end_process()
            self._ended += self._finish(Finished("cancelled"))

    def close(self) -> None:
        """End the process and release its shared memory; may be called again."""
        self._finish(Finished("cancelled"))
        self._end_process()
        self._ended = []

    def _stay(self) -> None:
        """Keep the process from ending by the timer."""
        if self._idle is not None:
            self._idle.cancel()
            self._idle.join()
            self._idle = None

    def _started(self) -> WorkerProcess:
        self._stay()
        if self._process is None or not self._process.is_alive:
            self._end_process()
            self._process = WorkerProcess(run_training, "ntc-training")
            self._process.call(None)
            self._warming = True
        return self._process

    def _end_process(self) -> None:
        self._stay()
        self._warming = False
        if self._process is not None:
            self._process.end()
            self._process = None

    def _send(self, command: Pause | Resume | Cancel | Taken) -> None:
        if self._training is not None and self._process is not None:
            self._process.send(command)

    def _taken(self, report: WorkerReport) -> list[Report]:
        """Return the report in the form that the caller gets, or nothing."""
        training = self._training
        if self._warming and isinstance(report, Answer | Failed):
            self._warming = False
            return []
        if training is None:
            return []
        match report:
            case Part():
                part: TrainingProgress | GroupSnapshot = training.snapshots.read(report.value)
                self._send(Taken(report.key))
                if isinstance(part, GroupSnapshot):
                    assert self.pack is not None
                    self.pack = apply_snapshot(self.pack, part)
                return [part]
            case Answer():
                ended: Ended = received(report.value)
                return self._finish(Finished(ended.reason, ended.outcomes, self._ended_pack(ended, training.request)))
            case Failed():
                return self._finish(report)
            case Paused() | Resumed():
                return [report]
        return []

    def _finish(self, last: Finished | Failed) -> list[Report]:
        """End the training under way with `last`, and release its memory; no report without a training."""
        training, self._training, self._cancelled_at = self._training, None, None
        if training is None:
            return []
        training.snapshots.close()
        if self._process is not None:
            self._idle = threading.Timer(self._idle_seconds, self._process.end)
            self._idle.daemon = True
            self._idle.start()
        return [last]

    def _lost(self, how: str) -> list[Report]:
        """Report the end of a process that was not asked to end, and so of the training under way."""
        self._end_process()
        if self._cancelled_at is not None:
            return self._finish(Finished("cancelled"))
        return self._finish(Failed(f"training: its process {how}; open packs are unchanged; start the training again"))

    def _ended_pack(self, ended: Ended, request: TrainingRequest) -> Pack | None:
        if ended.reason == "cancelled" or self.pack is None:
            return None
        return replace(ended_pack(self.pack, request.grouping), training=ended.record, path=None)
