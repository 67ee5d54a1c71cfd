"""Short trainings in another process, and what may be left of it."""

import multiprocessing
import os
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, fields, is_dataclass, replace
from pathlib import Path

import numpy as np
import torch

from ntc.codec.block.config import BlockConfig, BlockOptions
from ntc.codec.grid.model import GridConfig
from ntc.codec.grid.training.config import TrainingConfig
from ntc.codec.model import Grouping, Pack
from ntc.codec.textures import SourceTexture
from ntc.training.encode import encode_textures
from ntc.training.messages import TrainingRequest
from ntc.worker.client import Finished, Report, TrainingWorker
from ntc.worker.process import Failed
from ntc.worker.shared_arrays import PREFIX
from tests.support.textures import texture

CODEC = GridConfig(hidden_width=16, latent_channels=8, latent_bits=4, adapters=True, adapter_output=True)
TEXTURES = (texture(32, 32), texture(33, 18, seed=1), texture(64, 64, seed=2), texture(16, 16, 1, seed=3))
GROUPS = Grouping("random", (0, 1, 0, 1))
SHORT = TrainingConfig(steps=120, texels_per_texture=64, device="cpu", seed=5)
ENDLESS = replace(SHORT, steps=10**7)
FROM_NOTHING = TrainingRequest(TEXTURES, GROUPS, CODEC, SHORT)
BLOCK_CODEC = BlockConfig(coefficients=24, modes=8)
BLOCK_OPTIONS = BlockOptions(SHORT.seed, groups_apart=True)
BLOCKS_FROM_NOTHING = TrainingRequest(TEXTURES, GROUPS, BLOCK_CODEC, BLOCK_OPTIONS)
LARGE = TrainingRequest(
    tuple(texture(256, 256, seed=seed) for seed in range(6)),
    Grouping("random", (0, 1) * 3),
    CODEC,
    replace(ENDLESS, texels_per_texture=8192),
)
"""A step takes a large part of a second."""
MANY_BLOCKS = TrainingRequest((texture(128, 128),) * 300, Grouping("random", (0, 1) * 150), BLOCK_CODEC, BLOCK_OPTIONS)
"""Takes many seconds."""
LONGEST_WAIT = 200.0
"""Seconds. A process that trains has the lowest priority: beside others it takes far longer than alone."""


@dataclass(frozen=True, eq=False)
class CodecCase:
    """Settings of a codec for the tests of background training."""

    from_nothing: TrainingRequest
    """Four small textures in two groups."""
    endless: TrainingRequest
    trained: Pack
    """What `from_nothing` gives without a process."""


@contextmanager
def threads(count: int) -> Iterator[None]:
    """So many threads of torch."""
    before = torch.get_num_threads()
    torch.set_num_threads(count)
    try:
        yield
    finally:
        torch.set_num_threads(before)


def until(worker: TrainingWorker, kind: type | tuple[type, ...], seconds: float = LONGEST_WAIT) -> list[Report]:
    """Reports up to and with the first of a kind."""
    reports: list[Report] = []
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        reports += worker.poll()
        if any(isinstance(report, kind) for report in reports):
            return reports
        time.sleep(0.002)
    raise AssertionError(f"no {kind} within {seconds} s; came: {[type(report).__name__ for report in reports]}")


def finished(worker: TrainingWorker, request: TrainingRequest) -> tuple[Finished, list[Report]]:
    """A whole training."""
    worker.start(request)
    reports = until(worker, (Finished, Failed))
    assert isinstance(reports[-1], Finished), reports[-1]
    return reports[-1], reports


def pack_of(end: Finished) -> Pack:
    """The pack that a training ended with."""
    assert end.pack is not None
    return end.pack


def blocks(process: int | None = None) -> list[str]:
    """Names of the shared memory that a process has created, this one unless another is named, and that still has a name."""
    folder, owner = Path("/dev/shm"), process or os.getpid()
    return sorted(path.name for path in folder.glob(f"{PREFIX}{owner}-*")) if folder.is_dir() else []


def array_bytes(value: object) -> list[bytes]:
    """The bytes of all arrays within the tuples and dataclasses of a value, in their order."""
    if isinstance(value, np.ndarray):
        return [value.tobytes()]
    if is_dataclass(value):
        value = tuple(getattr(value, field.name) for field in fields(value))
    return [found for part in value for found in array_bytes(part)] if isinstance(value, tuple) else []


def lives(process: int) -> bool:
    """Return whether there is a process with this id."""
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    return True


def ends(process: int) -> bool:
    """Return whether a killed process ends. On a busy machine that takes a while."""
    end = time.monotonic() + LONGEST_WAIT
    while lives(process) and time.monotonic() < end:
        # Asking for the children also takes note of those that have ended.
        multiprocessing.active_children()
        time.sleep(0.02)
    return not lives(process)


def processor_seconds(process: int) -> float:
    """Processor time that a process has used; 0 where the system does not say."""
    path = Path(f"/proc/{process}/stat")
    if not path.exists():
        return 0.0
    fields = path.read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def encoded_by_group(textures: Sequence[SourceTexture], grouping: Grouping, config: BlockConfig, seed: int) -> Pack:
    """Return the groups that codec block encodes in this process, one by one."""
    return encode_textures(textures, grouping, config, BlockOptions(seed, groups_apart=True))
