"""Encoding in codec `block` for a host: what `ntc.training.trainer` is for codec `grid`. Groups from nothing, or of a pack again.

Stages come from `ntc.codec.block.encoding.stages`. A host gets a snapshot of each group as soon as it is encoded, and whenever it has
become better.
"""

import math
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any, cast

import numpy as np

from ntc.codec.block.config import BlockConfig
from ntc.codec.block.encoding.stages import BlockGroup, BlockStage, encoding_record, encoding_stages
from ntc.codec.block.model import BlockDecoder, BlockTexture, block_parts
from ntc.codec.block.reference import decode_image
from ntc.codec.map_quality import measured_texture
from ntc.codec.psnr import mse_of_psnr, psnr_of_mse
from ntc.training.progress import Ended, EndReason, GroupOutcome, TrainingHost, TrainingProgress
from ntc.training.request import QualityBudget, StepBudget, TimeBudget, TrainingRequest
from ntc.training.snapshot import GroupSnapshot, unchanged_groups

SECONDS_BETWEEN_REPORTS = 0.1
HIGHEST_PSNR_DB = 120.0
"""What is reported of textures that are exact: curves have no room for infinity."""


class BlockTrainer:
    """Encodes the dirty groups of a request. The host's `interruption` is asked between two textures."""

    def __init__(self, request: TrainingRequest, host: TrainingHost) -> None:
        """`request` comes from `checked_request`."""
        self._request, self._host = request, host
        self._codec = cast(BlockConfig, request.codec)
        self._dirty = sorted(request.dirty or ())
        start = request.start
        self._old_numbers = {} if start is None else unchanged_groups(start.grouping, request.grouping)
        self._versions: Counter[int] = Counter()
        self._unsent: dict[int, BlockGroup] = {}
        """By group: its latest state, where the host has not yet got that as its final one."""
        self._outcomes: dict[int, GroupOutcome] = {}
        self._began = host.seconds()
        self._last_report = -math.inf

    def run(self) -> Ended:
        """Encode to the end; the host gets a final snapshot of each group. Raises what the host's `interruption` raises."""
        request = self._request
        self._began = self._host.seconds()
        # The smallest groups first: so the first picture is there at once, and the others change while the largest are encoded.
        order = sorted(self._dirty, key=lambda group: self._texels(request.grouping.members(group)))
        stages = encoding_stages(request.textures, request.grouping, self._codec, request.training.seed, order)
        for stage in stages:
            self._host.interruption()
            if stage.changed is not None:
                self._take(stage.changed)
            last = self._is_last(stage)
            self._report(stage, last)
            if last:
                break
        for state in list(self._unsent.values()):
            self._end_group(state)
        outcomes = tuple(self._outcomes[group] for group in self._dirty)
        return Ended(self._reason(outcomes), outcomes, self._record())

    def _take(self, state: BlockGroup) -> None:
        self._unsent[state.group] = state
        if state.final:
            self._end_group(state)
        elif self._host.wants_snapshot(state.group):
            self._send(state, state.textures, state.decoder, final=False)

    def _send(self, state: BlockGroup, textures: tuple[BlockTexture, ...], decoder: BlockDecoder, final: bool) -> None:
        self._versions[state.group] += 1
        version = self._versions[state.group]
        self._host.snapshot(GroupSnapshot(version, state.group, state.members, textures, decoder, final))

    def _end_group(self, state: BlockGroup) -> None:
        """Send the final snapshot of a group: what it was before, where nothing better was found."""
        del self._unsent[state.group]
        start, textures, decoder = self._request.start, state.textures, state.decoder
        after, before = _mean_square(textures), None
        if start is not None and state.group in self._old_numbers:
            old_decoder = block_parts(start).decoders[self._old_numbers[state.group]]
            old = tuple(self._measured(start.textures[index], index, old_decoder) for index in state.members)
            before = _mean_square(old)
            if after > before:
                textures, decoder = tuple(replace(texture, group=state.group) for texture in old), old_decoder
        self._send(state, textures, decoder, final=True)
        before_db = None if before is None else psnr_of_mse(before)
        kept_old = before is not None and after > before
        self._outcomes[state.group] = GroupOutcome(state.group, before_db, psnr_of_mse(after), kept_old)

    def _measured(self, texture: BlockTexture, index: int, decoder: BlockDecoder) -> BlockTexture:
        """`texture` with the PSNR in dB of its mip 0 over 8-bit values."""
        self._host.interruption()
        pixels = self._request.textures[index].pixels
        decoded = decode_image(texture, decoder, self._codec)
        return measured_texture(texture, decoded[..., texture.places(self._codec)], pixels)

    def _is_last(self, stage: BlockStage) -> bool:
        """Whether the budget is spent. All groups are encoded once, whatever the budget."""
        budget = self._request.budget
        if stage.done < stage.total or budget is None:
            return False
        if isinstance(budget, StepBudget):
            return stage.done >= budget.steps
        if isinstance(budget, TimeBudget):
            return self._host.seconds() - self._began >= budget.seconds
        return _mean_psnr_db(list(stage.psnr_db.values())) >= budget.psnr_db

    def _report(self, stage: BlockStage, last: bool) -> None:
        now = self._host.seconds()
        if not (last or stage.done == stage.total) and now - self._last_report < SECONDS_BETWEEN_REPORTS:
            return
        self._last_report = now
        request, elapsed = self._request, max(now - self._began, 1e-6)
        by_group: dict[int, list[float]] = {}
        for index, decibels in stage.psnr_db.items():
            by_group.setdefault(request.grouping.groups[index], []).append(mse_of_psnr(decibels) / 255.0**2)
        self._host.progress(
            TrainingProgress(
                step=stage.done,
                steps=stage.total,
                seconds_left=elapsed * (stage.total - stage.done) / max(1, stage.done),
                elapsed_seconds=elapsed,
                losses={group: float(np.mean(values)) for group, values in sorted(by_group.items())},
                psnr_db={index: min(decibels, HIGHEST_PSNR_DB) for index, decibels in stage.psnr_db.items()},
                freezing_scale=1.0,
                ktexels_per_second=self._texels(stage.psnr_db) / elapsed / 1e3,
            )
        )

    def _texels(self, indices: Iterable[int]) -> int:
        sizes = [self._request.textures[index].size for index in indices]
        return sum(width * height for width, height in sizes)

    def _reason(self, outcomes: Sequence[GroupOutcome]) -> EndReason:
        budget = self._request.budget
        if not isinstance(budget, QualityBudget):
            return "done"
        reached = []
        for outcome in outcomes:
            kept = outcome.before_db if outcome.kept_old and outcome.before_db is not None else outcome.after_db
            reached += [kept] * self._request.grouping.groups.count(outcome.group)
        return "target reached" if _mean_psnr_db(reached) >= budget.psnr_db else "target not reached"

    def _record(self) -> Mapping[str, Any]:
        """What the pack records; one that was encoded again keeps its first record."""
        record = encoding_record(self._codec, self._request.training.seed)
        if self._request.start is None:
            return record
        return {**self._request.start.training, "retrained": {**record, "groups": self._dirty}}


def _mean_square(textures: Sequence[BlockTexture]) -> float:
    """Mean over textures of their mean square errors in 8-bit steps squared, from their PSNRs."""
    return float(np.mean([mse_of_psnr(texture.psnr_db) for texture in textures if texture.psnr_db is not None]))


def _mean_psnr_db(psnrs_db: Sequence[float]) -> float:
    return psnr_of_mse(float(np.mean([mse_of_psnr(value) for value in psnrs_db])))
