"""The trainer of all codecs: runs the work of an `ntc.codec.encoding.Encoder`, from scratch or on groups of a pack.

It sends progress and snapshots of groups to its host. It can save its state in a safetensors file and continue later: the result is
the same as without the stop (docs/explanation/training.md#interruptions).
"""

import json
import math
import threading
import time
from collections import Counter
from collections.abc import Generator, Mapping, Sequence
from contextlib import closing
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any, cast

import numpy as np
from safetensors import SafetensorError

from ntc.codec.encoding import (
    EncodedGroup,
    EncodingProgress,
    EncodingTask,
    Piece,
    QualityBudget,
    no_interruption,
)
from ntc.codec.model import CodecSettings, Decoder, EncodedTexture
from ntc.codec.quality import mse_of_psnr, psnr_of_mse
from ntc.codec.registry import codec_of
from ntc.errors import InputError
from ntc.io import file_metadata, read_file, write_bytes
from ntc.training.messages import (
    Ended,
    EndReason,
    GroupOutcome,
    GroupSnapshot,
    SnapshotReceiver,
    TrainingHost,
    TrainingProgress,
    TrainingRequest,
    unchanged_groups,
)

MEASURING = "measuring texture"
"""Phase in which results are measured; `step` then counts textures."""
SECONDS_BETWEEN_REPORTS = 0.25
SECONDS_BETWEEN_SAVES = 60.0
SNAPSHOT_SHARE = 0.1
"""Largest share of the time that snapshots may take."""
SECONDS_OF_SNAPSHOTS = 0.05
"""Seconds of work on snapshots after which training continues with its next piece of work."""


class Trainer:
    """Trains the dirty groups of a request that `ntc.training.messages.checked_request` returned."""

    def __init__(
        self,
        request: TrainingRequest,
        host: TrainingHost,
        state: Path | None = None,
        snapshots: SnapshotReceiver | None = None,
    ) -> None:
        """Prepare a training. `state` is a file to continue from, if it exists, and to save the state to every minute. `snapshots`
        receives groups while they are trained and when they end; without it, `finished` has those that have ended.

        Raises InputError for a device that is missing, and for a file that is not a state of this training.
        """
        self._request, self._host, self._snapshots, self._state_path = request, host, snapshots, state
        self.finished: dict[int, EncodedGroup] = {}
        """Groups that have ended, by number; empty where `snapshots` takes them."""
        self._groups = tuple(sorted(request.dirty or ()))
        self._lock = threading.RLock()
        self._last_report = math.inf
        """Time of the last report; nothing is reported before `run`."""
        task = EncodingTask(
            request.textures,
            request.grouping,
            request.codec,
            request.training,
            self._groups,
            request.budget,
            request.start,
            host.seconds,
            # A state can be saved only between two pieces of work. So with `state`, no piece is interrupted.
            self._interruption if state is None else no_interruption,
        )
        self._encoder = codec_of(request.codec).encoder(task)
        if state is not None and state.exists():
            self._load(state)
        start = request.start
        self._old_numbers = {} if start is None else unchanged_groups(start.grouping, request.grouping)
        self._versions: Counter[int] = Counter()
        self._outcomes: dict[int, GroupOutcome] = {}
        self._waiting: list[int] = []
        """Groups whose snapshot is due."""
        self._shown: tuple[int, ...] = ()
        """Groups of the latest snapshots."""
        self._share = 0.0
        """Progress in the last report."""
        self._to_measure = self._measured_members()
        """Textures whose quality will be measured; one that is measured twice appears twice."""
        self._measured = 0
        """Number of textures in `_to_measure` that were measured."""
        self._is_measuring = False
        self._began = self._last_save = host.seconds()
        self._next_snapshot = self._began

    def _measured_members(self) -> tuple[int, ...]:
        """Return the textures to measure: the results of training, and the old textures of the same groups."""
        members = [self._request.grouping.members(group) for group in self._groups]
        old = [each for group, each in zip(self._groups, members, strict=True) if group in self._old_numbers]
        trained = members if codec_of(self._request.codec).trains else []
        return tuple(index for each in (*trained, *old) for index in each)

    @property
    def settings(self) -> CodecSettings:
        """Settings of the resulting pack."""
        return self._encoder.settings

    def _state_settings(self) -> dict[str, Any]:
        """Return the settings that a saved state must share with this training."""
        import torch

        request = self._request
        return {
            "codec": asdict(cast(Any, request.codec)),
            "training": asdict(cast(Any, request.training)),
            "groups": list(request.grouping.groups),
            "textures": [[t.pixel_hash, *t.size, t.color_space, *t.wrap] for t in request.textures],
            "torch": torch.__version__,
        }

    def _load(self, path: Path) -> None:
        """Load a state that was saved with the same settings. Raises InputError for any other file."""
        from safetensors.torch import load

        try:
            data = read_file(path)
            tensors = load(data)
            saved = json.loads(file_metadata(data)[METADATA_KEY])["settings"]
            known = json.loads(json.dumps(self._state_settings()))
            other = sorted(key for key in known if saved.get(key) != known[key])
        except (SafetensorError, OSError, ValueError, KeyError, TypeError, AttributeError) as error:
            raise InputError(f"{path}: is not the state of a training ({error}); {REMEDY}") from error
        if other:
            raise InputError(f"{path}: is the state of another training (it differs in {', '.join(other)}); {REMEDY}")
        try:
            self._encoder.load(tensors)
        except (KeyError, ValueError, TypeError, RuntimeError) as error:
            raise InputError(f"{path}: does not fit this training ({error}); {REMEDY}") from error

    def save(self, path: Path) -> None:
        """Write the state to `path`; call it only between two pieces of work. Raises InputError if it cannot be written."""
        from safetensors.torch import save

        copies = {name: value.detach().cpu().contiguous().clone() for name, value in self._encoder.state().items()}
        write_bytes(path, save(copies, metadata={METADATA_KEY: json.dumps({"settings": self._state_settings()})}))

    def _save_if_due(self) -> str:
        """Write the state once a minute. Return a note if that fails; training continues, because a full disk may have room later."""
        if self._state_path is None or self._host.seconds() - self._last_save <= SECONDS_BETWEEN_SAVES:
            return ""
        self._last_save = self._host.seconds()
        try:
            self.save(self._state_path)
        except InputError as error:
            return f"the state of the training could not be saved, training continues ({error})"
        return ""

    def run(self) -> Ended:
        """Train to the end. The host gets a final snapshot of each group.

        Raises what the host's `interruption` and the codec's work raise.
        """
        pieces = self.pieces()
        while True:
            try:
                next(pieces)
            except StopIteration as end:
                ended: Ended = end.value
                return ended

    def pieces(self) -> Generator[None, None, Ended]:
        """Train as `run` does, piece by piece: trainings that take turns are asked for a few pieces each."""
        self._began = self._last_save = self._last_report = self._host.seconds()
        self._next_snapshot = self._began + self._request.seconds_between_snapshots
        with closing(self._encoder.pieces()) as pieces:
            while True:
                if self._state_path is not None:
                    self._host.interruption()
                piece = next(pieces, None)
                if piece is None:
                    break
                self._report(piece.note or self._save_if_due(), is_last=bool(piece.ended))
                self._take_snapshots(piece)
                for encoded in self._encoder.encoded(piece.ended):
                    self._end_group(encoded)
                yield
        self._report("", is_last=True)
        outcomes = tuple(self._outcomes[group] for group in self._groups)
        return Ended(self._reason(outcomes), outcomes, self._record())

    def _interruption(self) -> None:
        """Let the host pause or cancel within a piece of work, from any thread, and report progress."""
        with self._lock:
            self._host.interruption()
            self._report("", is_last=False)

    def _report(self, note: str, is_last: bool) -> None:
        """Report progress, if the last report is old enough, or if there is a note or an end."""
        with self._lock:
            now = self._host.seconds()
            if not note and not is_last and now - self._last_report < SECONDS_BETWEEN_REPORTS:
                return
            self._last_report = now
            self._host.progress(self._progress(self._encoder.figures(), now, note))

    def _progress(self, figures: EncodingProgress, now: float, note: str) -> TrainingProgress:
        if self._to_measure:
            texels = [math.prod(self._request.textures[index].size) for index in self._to_measure]
            done = figures.share * figures.passes + sum(texels[: self._measured])
            figures = replace(figures, share=done / (figures.passes + sum(texels)))
        if self._is_measuring:
            count = len(self._to_measure)
            figures = replace(figures, work=MEASURING, step=self._measured + 1, steps=count)
        # The planned work may grow, but reported progress never falls.
        self._share = max(self._share, min(figures.share, 1.0))
        elapsed = max(now - self._began, 1e-6)
        return TrainingProgress(**{**vars(figures), "share": self._share}, elapsed_seconds=elapsed, note=note)

    def _take_snapshots(self, piece: Piece) -> None:
        """Send the snapshots that are due, within SECONDS_OF_SNAPSHOTS. Groups whose last one was not yet taken are skipped."""
        if self._snapshots is None or not piece.groups:
            self._waiting = []
            return
        is_first = piece.is_first and self._shown != piece.groups
        if not self._waiting and (is_first or self._host.seconds() >= self._next_snapshot):
            self._waiting, self._shown = list(piece.groups), piece.groups
        if not self._waiting:
            return
        began = time.perf_counter()
        ready = [group for group in self._waiting if self._snapshots.wants_snapshot(group)]
        for encoded in self._encoder.encoded(tuple(ready)):
            ready.remove(encoded.group)
            self._send(self._snapshots, encoded, final=False)
            if time.perf_counter() - began > SECONDS_OF_SNAPSHOTS:
                break
        self._waiting = ready
        pause = max(self._request.seconds_between_snapshots, (time.perf_counter() - began) / SNAPSHOT_SHARE)
        self._next_snapshot = self._host.seconds() + pause

    def _send(self, snapshots: SnapshotReceiver, encoded: EncodedGroup, final: bool) -> None:
        self._versions[encoded.group] += 1
        version = self._versions[encoded.group]
        other = None if self.settings == self._request.codec else self.settings
        snapshots.snapshot(
            GroupSnapshot(version, encoded.group, encoded.members, encoded.textures, encoded.decoder, final, other)
        )

    def _end_group(self, encoded: EncodedGroup) -> None:
        """Measure a group and hand on its final state: the better one of the result and the old group."""
        textures, decoder, start, before = encoded.textures, encoded.decoder, self._request.start, None
        keeps_old = False
        if any(texture.psnr_db is None for texture in textures):
            textures = self._measure(textures, decoder, encoded.members)
        after = _mean_square(textures)
        if start is not None and encoded.group in self._old_numbers:
            old_decoder = start.decoders[self._old_numbers[encoded.group]]
            old = self._measure(tuple(start.textures[index] for index in encoded.members), old_decoder, encoded.members)
            before = _mean_square(old)
            keeps_old = after > before and not self._encoder.replaces
            if keeps_old:
                decoder, textures = old_decoder, tuple(replace(texture, group=encoded.group) for texture in old)
        textures = tuple(replace(texture, group=encoded.group) for texture in textures)
        result = replace(encoded, textures=textures, decoder=decoder)
        if self._snapshots is None:
            self.finished[encoded.group] = result
        else:
            self._send(self._snapshots, result, final=True)
        before_db = None if before is None else psnr_of_mse(before)
        self._outcomes[encoded.group] = GroupOutcome(encoded.group, before_db, psnr_of_mse(after), keeps_old)

    def _measure(
        self, textures: Sequence[EncodedTexture], decoder: Decoder, members: Sequence[int]
    ) -> tuple[EncodedTexture, ...]:
        """Return `textures` with the measured quality of their mip 0."""
        measured: list[EncodedTexture] = []
        self._is_measuring = True
        for texture, index in zip(textures, members, strict=True):
            self._report("", is_last=False)
            measured += self._encoder.measured((texture,), decoder, (index,))
            self._measured += 1
        self._is_measuring = False
        return tuple(measured)

    def _reason(self, outcomes: Sequence[GroupOutcome]) -> EndReason:
        budget = self._request.budget
        if not isinstance(budget, QualityBudget):
            return "done"
        errors = []
        for outcome in outcomes:
            final_db = outcome.before_db if outcome.rejected and outcome.before_db is not None else outcome.after_db
            errors += [mse_of_psnr(final_db)] * len(self._request.grouping.members(outcome.group))
        return "target reached" if psnr_of_mse(float(np.mean(errors))) >= budget.psnr_db else "target not reached"

    def _record(self) -> Mapping[str, Any]:
        """Return the training record for the pack. A retrained pack keeps its first record and adds the new one."""
        record = self._encoder.record()
        if self._request.start is None:
            return record
        return {**self._request.start.training, "retrained": {**record, "groups": list(self._groups)}}


def _mean_square(textures: Sequence[EncodedTexture]) -> float:
    """Return the mean of the textures' mean square errors, in squared 8-bit steps, from their PSNRs."""
    return float(np.mean([mse_of_psnr(texture.psnr_db) for texture in textures if texture.psnr_db is not None]))


METADATA_KEY = "ntc_training"
REMEDY = "remove it, or name another file"
