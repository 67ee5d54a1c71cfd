"""Training of the dirty groups of a request, with snapshots on the way; the others are not touched."""

import math
import time
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any, Protocol

import numpy as np
import torch
from numpy.typing import NDArray

from ntc.codec.reference import image_of_texels
from ntc.codec.textures import SourceTexture
from ntc.codec.torch_codec import TEXELS_AT_ONCE, TorchCodec
from ntc.metrics.metrics import psnr_db, psnr_of_mse
from ntc.pack.model import Decoder, EncodedTexture, Grouping, Pack
from ntc.training.batch import StepReport, TrainingCohort
from ntc.training.config import TrainingConfig
from ntc.training.encoded import encoded_texture
from ntc.training.guard import TrainingGuard
from ntc.training.progress import SECONDS_BETWEEN_REPORTS, Interruption
from ntc.training.schedule import FALL_FROM
from ntc.training.snapshot import GroupSnapshot, unchanged_groups
from ntc.training.trainer import choose_device, cohort_members, training_record
from ntc.worker.protocol import (
    Ended,
    EndReason,
    GroupOutcome,
    QualityBudget,
    StepBudget,
    TimeBudget,
    TrainingRequest,
    WorkerProgress,
)

STEPS_BEFORE_SNAPSHOT = 50
"""A picture is soon worth showing."""
LEAST_STEPS = 10
"""Before, there is nothing to see, however long steps take."""
RATE_OF_RETRAINING = 0.5
"""What all rates are multiplied by when a training goes on from a pack: full rates first undo much of what is there."""
SNAPSHOT_SHARE = 0.1
"""Snapshots take no more than this share of the time."""
SECONDS_OF_SNAPSHOTS = 0.05
"""After so much work on snapshots comes a step."""


class TrainingHost(Protocol):
    """Whoever runs a training: is told how it goes, and may hold it up."""

    def interruption(self) -> None:
        """Called many times a second; waits while training is to pause, and raises TrainingCancelledError to end it."""

    def seconds(self) -> float:
        """A clock that stands still in pauses."""

    def progress(self, progress: WorkerProgress) -> None:
        """Takes a report, or drops it."""

    def wants_snapshot(self, group: int) -> bool:
        """Whether the last snapshot of the group has been taken."""

    def snapshot(self, snapshot: GroupSnapshot) -> None:
        """Takes a snapshot; a final one as soon as there is room for it."""


def _training(request: TrainingRequest) -> TrainingConfig:
    if isinstance(request.budget, StepBudget):
        return replace(request.training, steps=request.budget.steps, epochs=None)
    return request.training


def _members(grouping: Grouping, group: int) -> tuple[int, ...]:
    return tuple(index for index, number in enumerate(grouping.groups) if number == group)


class Retraining:
    """The training of a request whose dirty groups are named (`ntc.training.checks.checked_request`)."""

    def __init__(self, request: TrainingRequest, host: TrainingHost) -> None:
        self._request, self._host = request, host
        self._training = _training(request)
        self._device = choose_device(self._training.device)
        self._dirty = sorted(request.dirty or ())
        grouping, textures = request.grouping, request.textures
        self._members = cohort_members(grouping, self._training, self._dirty)
        generator = torch.Generator().manual_seed(self._training.seed)
        self._cohorts = [
            TrainingCohort(
                [textures[i] for i in members],
                [grouping.groups[i] for i in members],
                request.codec,
                self._training,
                self._device,
                generator,
                host.interruption,
            )
            for members in self._members
        ]
        if request.start is not None:
            for members, cohort in zip(self._members, self._cohorts, strict=True):
                _start_at(cohort, members, request.start, grouping)
        self._planned = [cohort.steps for cohort in self._cohorts]
        self._versions = dict.fromkeys(self._dirty, 0)
        self._dropped = 0
        self._texels = 0
        self._began = self._last_report = host.seconds()
        self._next_snapshot = self._began + request.seconds_between_snapshots
        self._waiting: list[int] = []
        """Groups of which a snapshot is due."""

    def run(self) -> Ended:
        """Train to the end. Raises what the host's `interruption` raises, and TrainingFailedError when numbers blow up."""
        self._began = self._last_report = self._host.seconds()
        self._next_snapshot = self._began + self._request.seconds_between_snapshots
        for number in range(len(self._cohorts)):
            self._train_cohort(number)
        outcomes = tuple(outcome for number in range(len(self._cohorts)) for outcome in self._end_cohort(number))
        return Ended(self._reason(outcomes), outcomes, self._record())

    def _train_cohort(self, number: int) -> None:
        cohort = self._cohorts[number]
        guard = TrainingGuard(cohort, 1.0 if self._request.start is None else RATE_OF_RETRAINING)
        began = self._host.seconds()
        shown = False
        while not cohort.done:
            self._host.interruption()
            report, note = guard.advance()
            self._texels += 0 if report is None else report.texels
            now = self._host.seconds()
            self._plan(number, now - began)
            if note or cohort.done or now - self._last_report >= SECONDS_BETWEEN_REPORTS:
                self._last_report = now
                self._plan_by_quality(number)
                self._host.progress(self._progress(number, now, report, note))
            early = not shown and cohort.step >= STEPS_BEFORE_SNAPSHOT
            due = now >= self._next_snapshot and cohort.step >= LEAST_STEPS
            if not self._waiting and (early or due) and not cohort.done:
                shown = True
                self._waiting = list(cohort.decoder_numbers)
            if self._waiting:
                self._send_snapshots(number)
        self._waiting = []
        self._dropped += guard.dropped

    def _plan(self, number: int, seconds: float) -> None:
        """With a budget of time the share of steps done is the share of time gone."""
        if not isinstance(self._request.budget, TimeBudget):
            return
        cohort = self._cohorts[number]
        budget = self._request.budget.seconds * self._planned[number] / sum(self._planned)
        if seconds < budget:
            cohort.plan(max(cohort.step + 1, math.ceil(cohort.step * budget / max(seconds, 1e-6))))
        else:
            cohort.plan(cohort.step)

    def _plan_by_quality(self, number: int) -> None:
        """With a budget of quality the rates fall once it is reached."""
        budget, cohort = self._request.budget, self._cohorts[number]
        if not isinstance(budget, QualityBudget) or cohort.step >= FALL_FROM * cohort.steps:
            return
        mean = float(np.mean(cohort.running_losses))
        if mean <= 10.0 ** (-budget.psnr_db / 10.0):
            cohort.plan(min(cohort.steps, math.ceil(cohort.step / FALL_FROM)))

    def _progress(self, number: int, now: float, report: StepReport | None, note: str) -> WorkerProgress:
        done = sum(cohort.steps for cohort in self._cohorts[:number]) + self._cohorts[number].step
        steps = sum(cohort.steps for cohort in self._cohorts[: number + 1]) + sum(self._planned[number + 1 :])
        elapsed = max(now - self._began, 1e-6)
        budget = self._request.budget
        left = budget.seconds - elapsed if isinstance(budget, TimeBudget) else elapsed / max(1, done) * (steps - done)
        by_group: dict[int, list[float]] = {}
        by_texture: dict[int, float] = {}
        for members, cohort in zip(self._members[: number + 1], self._cohorts, strict=False):
            for index, loss in zip(members, cohort.running_losses, strict=True):
                if math.isfinite(loss):
                    by_group.setdefault(self._request.grouping.groups[index], []).append(loss)
                    by_texture[index] = -10.0 * math.log10(max(loss, 1e-12))
        return WorkerProgress(
            step=done,
            of=steps,
            eta_seconds=max(0.0, left),
            elapsed_seconds=elapsed,
            losses={group: float(np.mean(values)) for group, values in sorted(by_group.items())},
            psnr_db=by_texture,
            freezing_scale=1.0 if report is None else report.freezing,
            ktexels_per_second=self._texels / elapsed / 1e3,
            note=note,
        )

    def _send_snapshots(self, number: int) -> None:
        """Those that are due, until the next step is; skips groups whose last one nobody has taken."""
        began = time.perf_counter()
        ready = [group for group in self._waiting if self._host.wants_snapshot(group)]
        self._waiting = []
        for snapshot in self._snapshots(number, ready):
            ready.remove(snapshot.group)
            self._host.snapshot(snapshot)
            if time.perf_counter() - began > SECONDS_OF_SNAPSHOTS:
                break
        self._waiting = ready
        spent = time.perf_counter() - began
        pause = max(self._request.seconds_between_snapshots, spent / SNAPSHOT_SHARE)
        self._next_snapshot = self._host.seconds() + pause

    def _snapshots(self, number: int, groups: Sequence[int]) -> Iterator[GroupSnapshot]:
        cohort, members = self._cohorts[number], self._members[number]
        if not groups:
            return
        decoders, adapters = cohort.stored_decoders(), cohort.adapters()
        for group in tuple(groups):
            places = [place for place, index in enumerate(members) if self._request.grouping.groups[index] == group]
            encoded = tuple(
                encoded_texture(
                    self._request.textures[members[place]], group, latents, adapters[place] if adapters else None
                )
                for place, latents in zip(places, cohort.rounded_now(places), strict=True)
            )
            decoder = decoders[cohort.decoder_numbers.index(group)]
            indices = tuple(members[place] for place in places)
            yield GroupSnapshot(self._next_version(group), group, indices, encoded, decoder)

    def _next_version(self, group: int) -> int:
        self._versions[group] += 1
        return self._versions[group]

    def _end_cohort(self, number: int) -> Iterator[GroupOutcome]:
        cohort, request = self._cohorts[number], self._request
        start = request.start
        old_numbers = {} if start is None else unchanged_groups(start.grouping, request.grouping)
        for found in self._snapshots(number, cohort.decoder_numbers):
            sources = [request.textures[index] for index in found.members]
            new = self._measured(found.textures, found.decoder, sources)
            after = mean_square(new)
            final = replace(found, textures=new, final=True)
            before = None
            if start is not None and found.group in old_numbers:
                old = tuple(start.textures[index] for index in found.members)
                decoder = start.decoders[old_numbers[found.group]]
                before = mean_square(self._measured(old, decoder, sources))
                if after > before:
                    final = replace(final, textures=tuple(replace(t, group=found.group) for t in old), decoder=decoder)
            self._host.snapshot(final)
            before_db = None if before is None else psnr_of_mse(before)
            yield GroupOutcome(
                found.group, before_db, psnr_of_mse(after), kept_old=before is not None and after > before
            )

    def _measured(
        self, textures: Sequence[EncodedTexture], decoder: Decoder, sources: Sequence[SourceTexture]
    ) -> tuple[EncodedTexture, ...]:
        """The textures with the PSNR of their mip 0."""
        own = tuple(replace(texture, group=0) for texture in textures)
        pack = Pack(self._request.codec, Grouping("single", (0,) * len(own)), own, (decoder,))
        codec = TorchCodec(pack, self._device)
        found = []
        for index, (texture, source) in enumerate(zip(textures, sources, strict=True)):
            pixels = _decoded(pack, index, codec, self._host.interruption)
            found.append(replace(texture, psnr_db=psnr_db(pixels, source.pixels)))
        return tuple(found)

    def _reason(self, outcomes: Sequence[GroupOutcome]) -> EndReason:
        budget = self._request.budget
        if not isinstance(budget, QualityBudget):
            return "done"
        errors = []
        for outcome in outcomes:
            kept = outcome.before_db if outcome.kept_old and outcome.before_db is not None else outcome.after_db
            errors += [_mean_square(kept)] * len(_members(self._request.grouping, outcome.group))
        return "target reached" if psnr_of_mse(float(np.mean(errors))) >= budget.psnr_db else "target not reached"

    def _record(self) -> Mapping[str, Any]:
        record = training_record(self._training, self._device, self._cohorts, self._dropped)
        start = self._request.start
        if start is None:
            return record
        return {**start.training, "retrained": {**record, "groups": self._dirty}}


def _decoded(pack: Pack, index: int, codec: TorchCodec, interruption: Interruption) -> NDArray[np.uint8]:
    """Mip 0 of a texture, decoded in the same pieces as by `TorchCodec.decode_image`."""

    def decode(texture: int, uv: NDArray[Any], lod: NDArray[Any]) -> NDArray[np.float32]:
        parts = []
        for start in range(0, len(uv), TEXELS_AT_ONCE):
            interruption()
            piece = slice(start, start + TEXELS_AT_ONCE)
            parts.append(codec.decode_texels(texture, uv[piece], lod[piece]))
        return np.concatenate(parts)

    return image_of_texels(pack, index, 0, decode)


def _mean_square(psnr: float) -> float:
    """In 8-bit steps squared."""
    return float(255.0**2 * 10.0 ** (-psnr / 10.0))


def mean_square(textures: Sequence[EncodedTexture]) -> float:
    """Mean over textures of their mean square errors in 8-bit steps squared, from their PSNRs."""
    return float(np.mean([_mean_square(t.psnr_db) for t in textures if t.psnr_db is not None]))


def _start_at(cohort: TrainingCohort, members: Sequence[int], start: Pack, grouping: Grouping) -> None:
    """All textures go on from their latents and adapters, and each group from the decoder that most of its textures have.

    The others' latents were made for another decoder, but are still a better start than none: groups made anew ended 0.6 dB
    higher after 400 steps than with those textures begun afresh, and 1.2 dB higher than with all of them.
    """
    home = {}
    for group in cohort.decoder_numbers:
        counts = Counter(start.grouping.groups[index] for index in members if grouping.groups[index] == group)
        home[group] = counts.most_common(1)[0][0]
    decoders = [start.decoders[home[group]] for group in cohort.decoder_numbers]
    cohort.start_at([start.textures[index] for index in members], decoders)
