"""The one trainer: encodes textures from nothing, or trains groups of a pack again (paper, Sec. 3 and 4).

Groups train in batches, one after the other: all groups in one, or each group in its own. On the way a trainer reports
progress and snapshots of groups to its host, and can save its state, to continue later as if it had never been stopped.
"""

import math
import platform
import time
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any, cast

import numpy as np
import torch

from ntc.codec.device import choose_device
from ntc.codec.grid.config import GridConfig
from ntc.codec.grid.model import grid_parts
from ntc.codec.grid.start import grid_texture
from ntc.codec.grid.torch_twin import TorchGrid
from ntc.codec.grid.training.batch import StepReport, TrainingBatch
from ntc.codec.grid.training.checkpoint import BatchProgress, TrainingState, load_state, save_state, training_settings
from ntc.codec.grid.training.config import TrainingConfig
from ntc.codec.grid.training.rollback import RollbackStepper
from ntc.codec.grid.training.schedule import FALL_FROM
from ntc.codec.interruption import no_interruption
from ntc.codec.map_quality import measured_texture
from ntc.codec.model import Decoder, EncodedTexture, Grouping, Pack
from ntc.codec.psnr import mse_of_psnr, psnr_of_mse
from ntc.codec.textures import SourceTexture
from ntc.errors import InputError
from ntc.training.progress import Ended, EndReason, GroupOutcome, TrainingHost, TrainingProgress
from ntc.training.request import QualityBudget, StepBudget, TimeBudget, TrainingRequest
from ntc.training.snapshot import GroupSnapshot, unchanged_groups

SECONDS_BETWEEN_REPORTS = 0.25
SECONDS_BETWEEN_SAVES = 60.0
STEPS_BEFORE_SNAPSHOT = 50
"""The first snapshot of a batch is taken after this many steps, however little time has passed."""
LEAST_STEPS = 10
"""Minimum steps before the first snapshot, however long steps take."""
RATE_OF_RETRAINING = 0.5
"""What all rates are multiplied by when a training continues from a pack: full rates first undo much of what it holds."""
SNAPSHOT_SHARE = 0.1
"""Snapshots take no more than this share of the time."""
SECONDS_OF_SNAPSHOTS = 0.05
"""After this much work on snapshots the next step is done."""


def _batch_members(grouping: Grouping, training: TrainingConfig, groups: Iterable[int]) -> list[tuple[int, ...]]:
    """The textures of each batch that trains `groups`."""
    if training.texels_per_group is not None:
        return [grouping.members(group) for group in sorted(groups)]
    chosen = set(groups)
    return [tuple(index for index, group in enumerate(grouping.groups) if group in chosen)]


class Trainer:
    """Trains the dirty groups of a request that `ntc.training.request.checked_request` returned."""

    def __init__(self, request: TrainingRequest, host: TrainingHost, state: Path | None = None) -> None:
        """With `state` the training continues from that file, where it exists, and writes it every minute.

        Raises InputError for a device that is missing, and for a file that is not a state of this training.
        """
        self._request, self._host, self._state_path = request, host, state
        self._training = request.training
        if isinstance(request.budget, StepBudget):
            self._training = replace(request.training, steps=request.budget.steps, epochs=None)
        self._device = choose_device(self._training.device)
        self._dirty = sorted(request.dirty or ())
        grouping, textures = request.grouping, request.textures
        self._members = _batch_members(grouping, self._training, self._dirty)
        self._generator = torch.Generator().manual_seed(self._training.seed)
        # A state can be saved between two steps only, so a step whose state may be saved is not interrupted.
        interruption = host.interruption if state is None else no_interruption
        self._batches = [
            TrainingBatch(
                [textures[i] for i in members],
                [grouping.groups[i] for i in members],
                cast(GridConfig, request.codec),
                self._training,
                self._device,
                self._generator,
                interruption,
            )
            for members in self._members
        ]
        rate = 1.0
        if request.start is not None:
            rate = RATE_OF_RETRAINING
            for members, batch in zip(self._members, self._batches, strict=True):
                _start_at(batch, members, request.start, grouping)
        self._batch_progress = [BatchProgress(rate, 0) for _ in self._batches]
        self._planned = [batch.steps for batch in self._batches]
        self._versions: Counter[int] = Counter()
        self._texels = 0
        self._seconds_before = 0.0
        """Trained before the state was saved that this training continues."""
        if state is not None and state.exists():
            self._load(state)
        self._steps_before = sum(batch.step for batch in self._batches)
        self._began = self._last_report = self._last_save = host.seconds()
        self._next_snapshot = self._began + request.seconds_between_snapshots
        self._waiting: list[int] = []
        """Groups of which a snapshot is due."""

    def _settings(self) -> dict[str, Any]:
        request = self._request
        return training_settings(request.textures, request.grouping, cast(GridConfig, request.codec), request.training)

    def _load(self, path: Path) -> None:
        state = load_state(path, self._settings())
        try:
            for batch, tensors in zip(self._batches, state.batches, strict=True):
                batch.load(tensors)
            self._generator.set_state(state.generator)
        except (KeyError, ValueError, TypeError, RuntimeError) as error:
            raise InputError(
                f"{path}: does not fit this training ({error}); remove it, or name another file"
            ) from error
        self._batch_progress = list(state.progress)
        self._seconds_before = state.seconds

    def save(self, path: Path) -> None:
        """Write the state, between two steps. Raises InputError where it cannot be written."""
        tensors = [batch.state() for batch in self._batches]
        seconds = self._seconds_before + self._host.seconds() - self._began
        save_state(
            path, TrainingState(tensors, self._batch_progress, self._generator.get_state(), seconds), self._settings()
        )

    def _save_if_due(self) -> str:
        """Write the state once a minute. Returns why it failed, where it did: the disk may be full for a while only."""
        if self._state_path is None or self._host.seconds() - self._last_save <= SECONDS_BETWEEN_SAVES:
            return ""
        self._last_save = self._host.seconds()
        try:
            self.save(self._state_path)
        except InputError as error:
            return f"the state of the training could not be saved, training continues ({error})"
        return ""

    def run(self) -> Ended:
        """Train to the end; the host gets a final snapshot of each group. Raises what the host's `interruption` raises,
        and TrainingFailedError when numbers overflow again and again."""
        self._began = self._last_report = self._host.seconds()
        self._next_snapshot = self._began + self._request.seconds_between_snapshots
        for number in range(len(self._batches)):
            self._train_batch(number)
        outcomes = tuple(outcome for number in range(len(self._batches)) for outcome in self._end_batch(number))
        return Ended(self._reason(outcomes), outcomes, self._record())

    def _train_batch(self, number: int) -> None:
        batch, before = self._batches[number], self._batch_progress[number]
        stepper = RollbackStepper(batch, before.rate_factor, before.dropped)
        began = self._host.seconds()
        had_snapshot = False
        while not batch.done:
            self._host.interruption()
            report, note = stepper.advance()
            self._batch_progress[number] = BatchProgress(stepper.rate_factor, stepper.dropped)
            self._texels += 0 if report is None else report.texels
            now = self._host.seconds()
            self._plan(number, now - began)
            note = note or self._save_if_due()
            if note or batch.done or now - self._last_report >= SECONDS_BETWEEN_REPORTS:
                self._last_report = now
                self._plan_by_quality(number)
                self._host.progress(self._progress(number, now, report, note))
            early = not had_snapshot and batch.step >= STEPS_BEFORE_SNAPSHOT
            due = now >= self._next_snapshot and batch.step >= LEAST_STEPS
            if not self._waiting and (early or due) and not batch.done:
                had_snapshot = True
                self._waiting = list(batch.decoder_numbers)
            if self._waiting:
                self._send_snapshots(number)
        self._waiting = []

    def _plan(self, number: int, seconds: float) -> None:
        """With a budget of time the share of steps done is the share of time used."""
        if not isinstance(self._request.budget, TimeBudget):
            return
        batch = self._batches[number]
        budget = self._request.budget.seconds * self._planned[number] / sum(self._planned)
        if seconds < budget:
            batch.plan(max(batch.step + 1, math.ceil(batch.step * budget / max(seconds, 1e-6))))
        else:
            batch.plan(batch.step)

    def _plan_by_quality(self, number: int) -> None:
        """With a budget of quality the rates fall once it is reached."""
        budget, batch = self._request.budget, self._batches[number]
        if not isinstance(budget, QualityBudget) or batch.step >= FALL_FROM * batch.steps:
            return
        mean = float(np.mean(batch.running_losses))
        if mean <= 10.0 ** (-budget.psnr_db / 10.0):
            batch.plan(min(batch.steps, math.ceil(batch.step / FALL_FROM)))

    def _progress(self, number: int, now: float, report: StepReport | None, note: str) -> TrainingProgress:
        done = sum(batch.steps for batch in self._batches[:number]) + self._batches[number].step
        steps = sum(batch.steps for batch in self._batches[: number + 1]) + sum(self._planned[number + 1 :])
        elapsed = max(now - self._began, 1e-6)
        left = elapsed / max(1, done - self._steps_before) * (steps - done)
        if isinstance(self._request.budget, TimeBudget):
            left = self._request.budget.seconds - elapsed
        by_group: dict[int, list[float]] = {}
        by_texture: dict[int, float] = {}
        for members, batch in zip(self._members[: number + 1], self._batches, strict=False):
            for index, loss in zip(members, batch.running_losses, strict=True):
                if math.isfinite(loss):
                    by_group.setdefault(self._request.grouping.groups[index], []).append(loss)
                    by_texture[index] = -10.0 * math.log10(max(loss, 1e-12))
        return TrainingProgress(
            step=done,
            steps=steps,
            seconds_left=max(0.0, left),
            elapsed_seconds=elapsed,
            losses={group: float(np.mean(values)) for group, values in sorted(by_group.items())},
            psnr_db=by_texture,
            freezing_scale=1.0 if report is None else report.freezing,
            ktexels_per_second=self._texels / elapsed / 1e3,
            note=note,
        )

    def _send_snapshots(self, number: int) -> None:
        """Send the snapshots that are due, until the next step is; skip groups whose last one was not yet taken."""
        began = time.perf_counter()
        ready = [group for group in self._waiting if self._host.wants_snapshot(group)]
        for snapshot in self._snapshots(number, tuple(ready)):
            ready.remove(snapshot.group)
            self._host.snapshot(snapshot)
            if time.perf_counter() - began > SECONDS_OF_SNAPSHOTS:
                break
        self._waiting = ready
        spent = time.perf_counter() - began
        pause = max(self._request.seconds_between_snapshots, spent / SNAPSHOT_SHARE)
        self._next_snapshot = self._host.seconds() + pause

    def _snapshots(self, number: int, groups: Sequence[int]) -> Iterator[GroupSnapshot]:
        batch, members = self._batches[number], self._members[number]
        if not groups:
            return
        decoders, adapters = batch.stored_decoders(), batch.adapters()
        for group in groups:
            rows = [row for row, index in enumerate(members) if self._request.grouping.groups[index] == group]
            encoded = tuple(
                grid_texture(self._request.textures[members[row]], group, latents, adapters[row] if adapters else None)
                for row, latents in zip(rows, batch.rounded_now(rows), strict=True)
            )
            decoder = decoders[batch.decoder_numbers.index(group)]
            self._versions[group] += 1
            indices = tuple(members[row] for row in rows)
            yield GroupSnapshot(self._versions[group], group, indices, encoded, decoder)

    def _end_batch(self, number: int) -> Iterator[GroupOutcome]:
        """Measure each group and send its final snapshot: what it was before, where training found nothing better."""
        request = self._request
        start = request.start
        old_numbers = {} if start is None else unchanged_groups(start.grouping, request.grouping)
        for found in self._snapshots(number, self._batches[number].decoder_numbers):
            sources = [request.textures[index] for index in found.members]
            new = self._measured(found.textures, found.decoder, sources)
            after = _mean_square(new)
            final = replace(found, textures=new, final=True)
            before = None
            if start is not None and found.group in old_numbers:
                old = tuple(start.textures[index] for index in found.members)
                decoder = grid_parts(start).decoders[old_numbers[found.group]]
                before = _mean_square(self._measured(old, decoder, sources))
                if after > before:
                    final = replace(final, textures=tuple(replace(t, group=found.group) for t in old), decoder=decoder)
            self._host.snapshot(final)
            before_db = None if before is None else psnr_of_mse(before)
            kept_old = before is not None and after > before
            yield GroupOutcome(found.group, before_db, psnr_of_mse(after), kept_old)

    def _measured(
        self, textures: Sequence[EncodedTexture], decoder: Decoder, sources: Sequence[SourceTexture]
    ) -> tuple[EncodedTexture, ...]:
        """The textures with the PSNR in dB of their mip 0 over 8-bit values."""
        own = tuple(replace(texture, group=0) for texture in textures)
        pack = Pack(self._request.codec, Grouping("single", (0,) * len(own)), own, (decoder,))
        codec = TorchGrid(pack, self._device, self._host.interruption)
        return tuple(
            measured_texture(texture, codec.decode_image(index), source.pixels)
            for index, (texture, source) in enumerate(zip(textures, sources, strict=True))
        )

    def _reason(self, outcomes: Sequence[GroupOutcome]) -> EndReason:
        budget = self._request.budget
        if not isinstance(budget, QualityBudget):
            return "done"
        errors = []
        for outcome in outcomes:
            kept = outcome.before_db if outcome.kept_old and outcome.before_db is not None else outcome.after_db
            errors += [mse_of_psnr(kept)] * len(self._request.grouping.members(outcome.group))
        return "target reached" if psnr_of_mse(float(np.mean(errors))) >= budget.psnr_db else "target not reached"

    def _record(self) -> Mapping[str, Any]:
        """What a pack records of its training; a pack that was trained again keeps its first record."""
        record = {
            **{key: value for key, value in asdict(self._training).items() if key != "device"},
            "steps": sum(batch.steps for batch in self._batches),
            "dropped_steps": sum(progress.dropped for progress in self._batch_progress),
            "converged_textures": sum(batch.converged for batch in self._batches),
            "device": str(self._device),
            "torch": torch.__version__,
            "numpy": np.__version__,
            "python": platform.python_version(),
        }
        if self._request.start is None:
            return record
        return {**self._request.start.training, "retrained": {**record, "groups": self._dirty}}


def _mean_square(textures: Sequence[EncodedTexture]) -> float:
    """Mean over textures of their mean square errors in 8-bit steps squared, from their PSNRs."""
    return float(np.mean([mse_of_psnr(t.psnr_db) for t in textures if t.psnr_db is not None]))


def _start_at(batch: TrainingBatch, members: Sequence[int], start: Pack, grouping: Grouping) -> None:
    """All textures continue from their latents and adapters, and each group from the decoder that most of its textures have.

    The others' latents were made for another decoder, but are still a better start than none: new groups ended 0.6 dB
    higher after 400 steps than with those textures started afresh, and 1.2 dB higher than with all of them started afresh.
    """
    decoders = []
    for group in batch.decoder_numbers:
        counts = Counter(start.grouping.groups[index] for index in members if grouping.groups[index] == group)
        decoders.append(grid_parts(start).decoders[counts.most_common(1)[0][0]])
    batch.start_at([start.textures[index] for index in members], decoders)
