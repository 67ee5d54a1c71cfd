"""Trainings that take turns: several groupings of the same textures improve together, each with a quality after seconds.

Each training runs for a slice of time and then waits for the others. Its result is the one that it has alone: turns change when a
step is done, not what it computes.
"""

import time
from collections.abc import Generator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ntc.codec.encoding import CancelQuestion
from ntc.codec.model import CodecSettings, Decoder, EncodedTexture, Pack
from ntc.codec.quality import PsnrSummary, psnr_db
from ntc.codec.reference import decode_texels
from ntc.codec.textures import SourceTexture
from ntc.errors import TrainingCancelledError
from ntc.training.messages import Ended, GroupSnapshot, TrainingProgress, TrainingRequest, checked_request
from ntc.training.trainer import MEASURING, Trainer

SLICE_SECONDS = 0.5
SAMPLED_TEXELS = 1024
"""Texels of each texture on which the curve of a training is measured."""
CURVE_RATIO = 1.5
"""Ratio of the times of two neighbouring points of a curve."""


@dataclass(frozen=True)
class CurvePoint:
    """Quality of a training at one moment."""

    step: int
    """Steps done; of a codec that is encoded in closed form, textures done."""
    seconds: float
    """Time of this training in seconds; the turns of others are not counted."""
    psnr_db: float
    """Mean over textures of the PSNR in dB on `SampledTexels`, over 8-bit values."""


@dataclass(frozen=True, eq=False)
class SampledTexels:
    """A fixed sample of texel centres of mip 0 of each texture, the same for all trainings that are compared."""

    uv: tuple[NDArray[np.float64], ...]
    """[N, 2] texture coordinates, by texture."""
    values: tuple[NDArray[np.uint8], ...]
    """[N, channels] values of the originals there, by texture."""

    @classmethod
    def of(cls, textures: Sequence[SourceTexture], count: int = SAMPLED_TEXELS) -> "SampledTexels":
        """Return `count` texels of each texture, chosen by a fixed seed."""
        random = np.random.default_rng(0)
        places, values = [], []
        for texture in textures:
            width, height = texture.size
            x, y = random.integers(0, width, count), random.integers(0, height, count)
            places.append(np.stack([(x + 0.5) / width, (y + 0.5) / height], axis=-1))
            values.append(texture.pixels[y, x])
        return cls(tuple(places), tuple(values))

    def mean_psnr_db(self, pack: Pack) -> float:
        """Return the mean over textures of the PSNR in dB of `pack` on these texels, decoded in float64."""
        qualities = []
        for index, (uv, values) in enumerate(zip(self.uv, self.values, strict=True)):
            decoded = decode_texels(pack, index, uv, np.zeros(len(uv)))
            qualities.append(psnr_db(np.rint(decoded * 255.0).astype(np.uint8), values))
        summary = PsnrSummary.of(qualities)
        return 0.0 if summary is None else summary.mean_db


class TrainingInTurns:
    """One of several trainings: runs for a slice when it is asked to, and knows its result so far."""

    def __init__(
        self, request: TrainingRequest, sample: SampledTexels, cancelled: CancelQuestion, state: Path | None = None
    ) -> None:
        """`cancelled` is asked within slices. With `state` the training continues from that file (`Trainer`).

        Raises InputError for what cannot be trained, and for a file that is not a state of this training.
        """
        self.request = checked_request(replace(request, seconds_between_snapshots=0.0))
        self.curve: list[CurvePoint] = []
        self.latest: TrainingProgress | None = None
        """Last report of the training; None before it has begun."""
        self.ended: Ended | None = None
        """Outcome of the training; None while it is under way."""
        self._sample, self._cancelled = sample, cancelled
        self._seconds = 0.0
        """Seconds of the slices before this one."""
        self._slice_began: float | None = None
        self._textures: dict[int, EncodedTexture] = {}
        self._decoders: dict[int, Decoder] = {}
        self._settings: CodecSettings | None = None
        self._step = 0
        """Steps done, or textures encoded."""
        self._stale = set(range(self.request.grouping.group_count))
        """Groups without a snapshot since the last point of the curve."""
        self._next_point = 0.0
        self._trainer = Trainer(self.request, self, state, self)
        self._pieces: Generator[None, None, Ended] = self._trainer.pieces()

    # The training's host and receiver of snapshots (`ntc.training.messages`).

    def interruption(self) -> None:
        """End the training where it is cancelled."""
        if self._cancelled():
            raise TrainingCancelledError

    def seconds(self) -> float:
        """Return the time of this training in seconds: the sum of its slices."""
        since = 0.0 if self._slice_began is None else time.monotonic() - self._slice_began
        return self._seconds + since

    def progress(self, progress: TrainingProgress) -> None:
        """Take a report."""
        self.latest = progress
        if progress.work != MEASURING:
            self._step = progress.step

    def wants_snapshot(self, group: int) -> bool:
        """Return whether a point of the curve is due that lacks this group."""
        return group in self._stale and self.seconds() >= self._next_point

    def snapshot(self, snapshot: GroupSnapshot) -> None:
        """Take a group as it is now."""
        self._textures.update(zip(snapshot.members, snapshot.textures, strict=True))
        self._decoders[snapshot.group] = snapshot.decoder
        self._settings = snapshot.settings or self._settings
        self._stale.discard(snapshot.group)

    # Turns.

    def pack(self) -> Pack:
        """Return the result so far. Raises ValueError before the first point of the curve."""
        if not self.curve:
            raise ValueError("no result yet")
        return self._pack()

    def _pack(self) -> Pack:
        grouping = self.request.grouping
        textures = tuple(self._textures[index] for index in range(len(self.request.textures)))
        decoders = tuple(self._decoders[group] for group in range(grouping.group_count))
        record = {} if self.ended is None else self.ended.record
        return Pack(self._settings or self._trainer.settings, grouping, textures, decoders, record)

    def run_slice(self, seconds: float = SLICE_SECONDS) -> None:
        """Train for so many seconds, one piece of work at least, or to the end; then add a point to the curve where one is due.

        Raises TrainingCancelledError, TrainingFailedError when numbers overflow again and again, and what the codec's work raises.
        """
        self._slice_began = began = time.monotonic()
        try:
            next(self._pieces)
            while time.monotonic() - began < seconds:
                next(self._pieces)
        except StopIteration as end:
            self.ended = end.value
        finally:
            self._seconds, self._slice_began = self.seconds(), None
        if not self._stale or self.ended is not None:
            self._stale = set(range(self.request.grouping.group_count))
            self._next_point = CURVE_RATIO * self._seconds
            self.curve.append(CurvePoint(self._step, self._seconds, self._sample.mean_psnr_db(self._pack())))

    def save(self, state: Path) -> None:
        """Write the state of the training, between two slices. Raises InputError where it cannot be written."""
        self._trainer.save(state)
