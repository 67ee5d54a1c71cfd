"""Encoder of codec `grid`: trains the groups of a task (paper, Sec. 3 and 4; docs/explanation/training.md).

Either one batch trains all groups, or each group has a batch and batches train one after the other. A step whose numbers are not
finite is dropped: the batch returns to its last good state, and all learning rates are halved.
"""

import math
import platform
from collections import Counter
from collections.abc import Generator, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, replace
from typing import Any, cast

import numpy as np
import torch
from torch import Tensor

from ntc.codec.encoding import (
    EncodedGroup,
    Encoder,
    EncodingProgress,
    EncodingTask,
    Piece,
    QualityBudget,
    StepBudget,
    TimeBudget,
)
from ntc.codec.grid.model import GridConfig, GridParts, GridTexture, grid_parts
from ntc.codec.grid.tensors import grid_texture
from ntc.codec.grid.torch_twin import TorchGrid
from ntc.codec.grid.training.batch import RandomStreams, StepReport, TrainingBatch
from ntc.codec.grid.training.config import FALL_FROM, TrainingConfig
from ntc.codec.model import Decoder, EncodedTexture, Grouping, Pack
from ntc.codec.quality import measured_texture
from ntc.errors import NotFiniteError, TrainingFailedError
from ntc.torch_device import choose_device

STEPS_BETWEEN_COPIES = 50
"""Steps between copies of the good state."""
MOST_DROPPED_IN_A_ROW = 3
"""Dropped steps in a row that end training."""
RATE_AFTER_DROP = 0.5
"""Factor of all rates after a dropped step."""


class RollbackStepper:
    """Runs the steps of a batch, and returns to a copy of its last good state after a step that is not finite."""

    def __init__(self, batch: TrainingBatch, rate_factor: float = 1.0, dropped: int = 0) -> None:
        self._batch = batch
        self.rate_factor = rate_factor
        """Factor of all rates, in addition to the schedule."""
        self.dropped = dropped
        """Number of steps dropped so far."""
        self._in_a_row = 0
        self._good_state: dict[str, Tensor] = {}
        self._copy_state()

    def _copy_state(self) -> None:
        self._good_state = {name: value.clone() for name, value in self._batch.state().items()}

    def advance(self) -> tuple[StepReport | None, str]:
        """Do one step. Return (report, note for the log); the report is None if the step was dropped.

        Raises TrainingFailedError after MOST_DROPPED_IN_A_ROW dropped steps in a row. The batch then has its last good state.
        """
        batch = self._batch
        if batch.step % STEPS_BETWEEN_COPIES == 0 and not self._in_a_row:
            self._copy_state()
        try:
            report = batch.advance(self.rate_factor)
        except NotFiniteError:
            return None, self._drop()
        self._in_a_row = 0
        return report, ""

    def _drop(self) -> str:
        batch, step = self._batch, self._batch.step
        batch.load(self._good_state)
        good = batch.step
        self.dropped += 1
        self._in_a_row += 1
        if self._in_a_row >= MOST_DROPPED_IN_A_ROW:
            raise TrainingFailedError(
                f"training: loss or gradients were not finite in {MOST_DROPPED_IN_A_ROW} steps in a row, the last at step {step}; "
                "lower the learning rates, or look for a damaged texture"
            )
        self.rate_factor *= RATE_AFTER_DROP
        # A dropped step counts as done, so training takes as many steps as planned.
        batch.step = step + 1
        return (
            f"step {step}: loss or gradients are not finite; dropped, back to the state of step {good}, "
            f"rates lowered to {self.rate_factor:g} of the schedule"
        )


SECONDS_BETWEEN_PLANS = 0.25
"""Seconds between checks of a quality budget."""
STEPS_BEFORE_SNAPSHOT = 50
"""Steps after which the first snapshot is sent at once: the picture is recognisable then."""
LEAST_STEPS = 10
"""Steps before which no snapshot is sent, however long they take."""
PASSES_OF_TRAINING = 3.0
"""Work of a trained sample, in decodes of a texel: forwards, backwards, and the update of latents."""
RATE_OF_RETRAINING = 0.5
"""Factor of all rates when training continues from a pack. Full rates would first raise its error."""


def _batch_members(grouping: Grouping, training: TrainingConfig, groups: Iterable[int]) -> list[tuple[int, ...]]:
    """Return the textures of each batch that trains `groups`."""
    if training.texels_per_group is not None:
        return [grouping.members(group) for group in sorted(groups)]
    chosen = set(groups)
    return [tuple(index for index, group in enumerate(grouping.groups) if group in chosen)]


class GridEncoder(Encoder):
    """Trains the groups of a task. A piece of work is one training step."""

    def __init__(self, task: EncodingTask) -> None:
        """Prepare the batches of `task`. Raises InputError for a device that is missing."""
        self._task, self.settings = task, task.settings
        self._config = cast(GridConfig, task.settings)
        training = cast(TrainingConfig, task.options)
        if isinstance(task.budget, StepBudget):
            training = replace(training, steps=task.budget.steps, epochs=None)
        self._training = training
        self._device = choose_device(training.device)
        grouping, textures = task.grouping, task.textures
        self._members = _batch_members(grouping, training, task.groups)
        self._random = RandomStreams.of_seed(training.seed)
        self._batches = [
            TrainingBatch(
                [textures[i] for i in members],
                [grouping.groups[i] for i in members],
                self._config,
                training,
                self._device,
                self._random,
                task.interruption,
            )
            for members in self._members
        ]
        rate = 1.0
        if task.start is not None:
            rate = RATE_OF_RETRAINING
            for members, batch in zip(self._members, self._batches, strict=True):
                _start_at(batch, members, grid_parts(task.start), task.start.grouping, grouping)
        self._rates = [rate for _ in self._batches]
        self._dropped = [0 for _ in self._batches]
        self._planned = [batch.steps for batch in self._batches]
        self._number = 0
        """Number of the batch that is being trained."""
        self._report: StepReport | None = None
        self._texels = 0
        self._last_plan = task.seconds()

    def pieces(self) -> Generator[Piece]:
        """Train step by step. Raises TrainingFailedError after several steps in a row that are not finite."""
        self._last_plan = self._task.seconds()
        for number, batch in enumerate(self._batches):
            self._number = number
            stepper = RollbackStepper(batch, self._rates[number], self._dropped[number])
            began = self._task.seconds()
            while not batch.done:
                self._report, note = stepper.advance()
                self._rates[number], self._dropped[number] = stepper.rate_factor, stepper.dropped
                self._texels += 0 if self._report is None else self._report.texels
                self._plan(number, self._task.seconds() - began, is_noted=bool(note))
                shown = () if batch.done or batch.step < LEAST_STEPS else tuple(batch.decoder_numbers)
                yield Piece(shown, batch.step >= STEPS_BEFORE_SNAPSHOT, note=note)
            yield Piece(ended=tuple(batch.decoder_numbers))

    def _plan(self, number: int, seconds: float, is_noted: bool) -> None:
        """Plan the number of steps of a batch. Time budget: the share of steps done equals the share of time used. Quality budget: the
        final fall of the rates starts when the quality is reached."""
        batch, budget = self._batches[number], self._task.budget
        if isinstance(budget, TimeBudget):
            batch_seconds = budget.seconds * self._planned[number] / sum(self._planned)
            if seconds < batch_seconds:
                batch.plan(max(batch.step + 1, math.ceil(batch.step * batch_seconds / max(seconds, 1e-6))))
            else:
                batch.plan(batch.step)
        if isinstance(budget, QualityBudget) and batch.step < FALL_FROM * batch.steps:
            now = self._task.seconds()
            if is_noted or batch.done or now - self._last_plan >= SECONDS_BETWEEN_PLANS:
                self._last_plan = now
                if float(np.mean(batch.running_losses)) <= 10.0 ** (-budget.psnr_db / 10.0):
                    batch.plan(min(batch.steps, math.ceil(batch.step / FALL_FROM)))

    def figures(self) -> EncodingProgress:
        number = self._number
        done = sum(batch.steps for batch in self._batches[:number]) + self._batches[number].step
        steps = sum(batch.steps for batch in self._batches[: number + 1]) + sum(self._planned[number + 1 :])
        by_group: dict[int, list[float]] = {}
        by_texture: dict[int, float] = {}
        for members, batch in zip(self._members[: number + 1], self._batches, strict=False):
            for index, loss in zip(members, batch.running_losses, strict=True):
                if math.isfinite(loss):
                    by_group.setdefault(self._task.grouping.groups[index], []).append(loss)
                    by_texture[index] = -10.0 * math.log10(max(loss, 1e-12))
        return EncodingProgress(
            share=done / max(1, steps),
            passes=0.0 if self._report is None else PASSES_OF_TRAINING * steps * self._report.texels,
            step=done,
            steps=steps,
            texels=self._texels,
            losses={group: float(np.mean(values)) for group, values in sorted(by_group.items())},
            psnr_db=by_texture,
            freezing_scale=1.0 if self._report is None else self._report.freezing,
        )

    def encoded(self, groups: Sequence[int]) -> Iterator[EncodedGroup]:
        for members, batch in zip(self._members, self._batches, strict=True):
            in_batch = [group for group in groups if group in batch.decoder_numbers]
            if not in_batch:
                continue
            decoders, adapters = batch.stored_decoders(), batch.adapters()
            for group in in_batch:
                rows = [row for row, index in enumerate(members) if self._task.grouping.groups[index] == group]
                textures = tuple(
                    grid_texture(self._task.textures[members[row]], group, latents, adapters[row] if adapters else None)
                    for row, latents in zip(rows, batch.rounded_now(rows), strict=True)
                )
                decoder = decoders[batch.decoder_numbers.index(group)]
                yield EncodedGroup(group, tuple(members[row] for row in rows), textures, decoder)

    def measured(
        self, textures: Sequence[EncodedTexture], decoder: Decoder, members: Sequence[int]
    ) -> tuple[EncodedTexture, ...]:
        alone = tuple(replace(texture, group=0) for texture in textures)
        pack = Pack(self._config, Grouping("single", (0,) * len(alone)), alone, (decoder,))
        twin = TorchGrid(pack, self._device, self._task.interruption)
        return tuple(
            measured_texture(texture, twin.decode_image(number), self._task.textures[index].pixels)
            for number, (texture, index) in enumerate(zip(textures, members, strict=True))
        )

    def record(self) -> dict[str, Any]:
        return {
            **{key: value for key, value in asdict(self._training).items() if key != "device"},
            "steps": sum(batch.steps for batch in self._batches),
            "dropped_steps": sum(self._dropped),
            "converged_textures": sum(batch.converged for batch in self._batches),
            "device": str(self._device),
            "torch": torch.__version__,
            "numpy": np.__version__,
            "python": platform.python_version(),
        }

    def state(self) -> dict[str, Tensor]:
        tensors = {
            f"{number}/{name}": value
            for number, batch in enumerate(self._batches)
            for name, value in batch.state().items()
        }
        tensors["generator"] = self._random.samples.get_state()
        tensors["rates"] = torch.tensor(self._rates, dtype=torch.float64)
        tensors["dropped"] = torch.tensor(self._dropped)
        return tensors

    def load(self, state: Mapping[str, Tensor]) -> None:
        for number, batch in enumerate(self._batches):
            prefix = f"{number}/"
            batch.load({name[len(prefix) :]: value for name, value in state.items() if name.startswith(prefix)})
        self._random.samples.set_state(state["generator"])
        rates, dropped = state["rates"].tolist(), state["dropped"].tolist()
        if len(rates) != len(self._batches) or len(dropped) != len(self._batches):
            raise ValueError(f"it has {len(rates)} batches, not {len(self._batches)}")
        self._rates, self._dropped = rates, dropped


def _start_at(
    batch: TrainingBatch, members: Sequence[int], start: GridParts, before: Grouping, grouping: Grouping
) -> None:
    """Load `start` into `batch`: each texture's latents and adapter, and for each group the decoder that most of its textures had.

    Textures that had another decoder also start from their old latents. After 400 steps, new groups were 0.6 dB better than if those
    textures started again, and 1.2 dB better than if all textures did.
    """
    decoders = []
    for group in batch.decoder_numbers:
        counts = Counter(before.groups[index] for index in members if grouping.groups[index] == group)
        decoders.append(start.decoders[counts.most_common(1)[0][0]])
    textures: list[GridTexture | None] = [start.textures[index] for index in members]
    batch.start_at(textures, decoders)
