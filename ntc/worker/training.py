"""Training in a worker process: what the process calls, and the host that talks to the window. torch is imported when it is needed."""

import importlib
import json
import time
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from ntc.codec.encoding import EncodingChoices
from ntc.codec.model import Grouping
from ntc.codec.registry import chosen_codec, codec_named
from ntc.codec.textures import SourceTexture
from ntc.errors import InputError, TrainingCancelledError
from ntc.threads import usable_cores, wait_passively
from ntc.training.messages import Ended, GroupSnapshot, TrainingProgress, TrainingRequest
from ntc.worker.process import Paused, Resumed, WindowEnd, lower_priority
from ntc.worker.shared_arrays import Pickled, SharedBlock, inside

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
        _warm_up()
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
        ended = Trainer(request, host).run()
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


def _warm_up() -> None:
    """Import what trains, and encode a texture: what torch does for the first time takes a second."""
    wait_passively()
    # An error is reported when a training imports it again.
    with suppress(Exception):
        from ntc.training.encode import encode_chosen

        noise = np.random.default_rng(0).integers(0, 256, (WARM_TEXELS, WARM_TEXELS, 3), np.uint8)
        textures, grouping = [SourceTexture("noise", noise, "")], Grouping("single", (0,))
        encode_chosen(textures, grouping, codec_named(chosen_codec(EncodingChoices())), EncodingChoices())
        importlib.import_module("ntc.training.trainer")
