"""Training latents and decoders of a grouping (paper, Sec. 3 and 4)."""

import platform
import sys
import time
from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
import torch

from ntc.codec.config import CodecConfig
from ntc.codec.quantize import QuantizedLatents
from ntc.codec.textures import SourceTexture
from ntc.codec.torch_codec import TorchCodec
from ntc.errors import InputError
from ntc.metrics.metrics import psnr_db
from ntc.pack.model import Adapter, Decoder, Grouping, Pack
from ntc.training.batch import TrainingCohort
from ntc.training.checkpoint import CohortProgress, TrainingState, load_state, save_state, training_settings
from ntc.training.checks import check_textures
from ntc.training.config import TrainingConfig
from ntc.training.encoded import encoded_texture
from ntc.training.guard import TrainingFailedError, TrainingGuard
from ntc.training.progress import CancelQuestion, ProgressListener, TrainingCancelledError, TrainingClock

SECONDS_BETWEEN_SAVES = 60.0


def choose_device(name: str) -> torch.device:
    """The torch device for `auto`, `cpu` or `cuda`. Raises InputError for CUDA where torch has none."""
    if name == "auto":
        return torch.device("cuda" if torch.cuda.is_available() else "cpu")
    if name == "cuda" and not torch.cuda.is_available():
        raise InputError(
            "--device cuda: this torch has no CUDA device; see README for the CUDA build, or use --device cpu"
        )
    return torch.device(name)


def cohort_members(grouping: Grouping, training: TrainingConfig, groups: Iterable[int]) -> list[list[int]]:
    """The textures of each cohort that trains `groups`."""
    chosen = sorted(set(groups))
    if training.texels_per_group is None:
        return [[index for index, group in enumerate(grouping.groups) if group in chosen]]
    return [[index for index, group in enumerate(grouping.groups) if group == number] for number in chosen]


def peak_memory_bytes(device: torch.device) -> int | None:
    """Most memory that this process has held, of the GPU for CUDA. None where the system does not say."""
    if device.type == "cuda":
        return int(torch.cuda.max_memory_allocated(device))
    try:
        import resource
    except ImportError:
        # Windows.
        return None
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return int(peak) if sys.platform == "darwin" else int(peak) * 1024


class _Training:
    """All cohorts, one after the other."""

    def __init__(
        self,
        textures: Sequence[SourceTexture],
        grouping: Grouping,
        codec: CodecConfig,
        training: TrainingConfig,
        device: torch.device,
    ) -> None:
        self.members = cohort_members(grouping, training, range(grouping.group_count))
        self._generator = torch.Generator().manual_seed(training.seed)
        self.cohorts = [
            TrainingCohort(
                [textures[i] for i in m], [grouping.groups[i] for i in m], codec, training, device, self._generator
            )
            for m in self.members
        ]
        self._progress = [CohortProgress(1.0, 0) for _ in self.cohorts]
        self._settings = training_settings(textures, grouping, codec, training)
        self._started = time.monotonic()

    @property
    def steps(self) -> int:
        """Steps of all cohorts."""
        return sum(cohort.steps for cohort in self.cohorts)

    @property
    def dropped(self) -> int:
        """Steps that were dropped because numbers were not finite."""
        return sum(progress.dropped for progress in self._progress)

    @property
    def seconds(self) -> float:
        """Trained so far."""
        return time.monotonic() - self._started

    def load(self, path: Path) -> None:
        """Go on from a state. Raises InputError for a file that is no state of this training."""
        state = load_state(path, self._settings)
        try:
            for cohort, tensors in zip(self.cohorts, state.cohorts, strict=True):
                cohort.load(tensors)
            self._generator.set_state(state.generator)
        except (KeyError, ValueError, TypeError, RuntimeError) as error:
            raise InputError(
                f"{path}: does not fit this training ({error}); remove it, or name another file"
            ) from error
        self._progress = list(state.progress)
        self._started -= state.seconds

    def save(self, path: Path) -> None:
        """Write the state. Raises InputError where it cannot be written."""
        tensors = [cohort.state() for cohort in self.cohorts]
        save_state(
            path, TrainingState(tensors, self._progress, self._generator.get_state(), self.seconds), self._settings
        )

    def _save_if_possible(self, path: Path) -> str:
        """Write the state; why not, where that fails: a disk may be full for a while only, and training need not end for it."""
        try:
            self.save(path)
        except InputError as error:
            return f"the state of the training could not be kept, it goes on ({error})"
        return ""

    def run(self, clock: TrainingClock, state: Path | None) -> None:
        """All steps that are left; the state is written now and then, and when the caller asks to stop."""
        last_save, problem = time.monotonic(), ""
        clock.skip(sum(cohort.step for cohort in self.cohorts))
        for number, cohort in enumerate(self.cohorts):
            before = self._progress[number]
            guard = TrainingGuard(cohort, before.rate_factor, before.dropped)
            while not cohort.done:
                clock.ask()
                report, note = guard.advance()
                self._progress[number] = CohortProgress(guard.rate_factor, guard.dropped)
                if report is None:
                    clock.tick(torch.tensor(torch.nan), 0, 1.0, note)
                else:
                    clock.tick(report.loss, report.texels, report.freezing, problem)
                    problem = ""
                if state is not None and time.monotonic() - last_save > SECONDS_BETWEEN_SAVES:
                    problem = self._save_if_possible(state)
                    last_save = time.monotonic()
            clock.skip(cohort.steps - cohort.step)


def training_record(
    training: TrainingConfig, device: torch.device, cohorts: Sequence[TrainingCohort], dropped: int
) -> dict[str, Any]:
    """What a pack says of its training, in which `dropped` steps were not done."""
    record = {key: value for key, value in asdict(training).items() if key != "device"}
    return {
        **record,
        "steps": sum(cohort.steps for cohort in cohorts),
        "dropped_steps": dropped,
        "converged_textures": sum(cohort.converged for cohort in cohorts),
        "device": str(device),
        "torch": torch.__version__,
        "numpy": np.__version__,
        "python": platform.python_version(),
    }


def with_psnr(pack: Pack, textures: Sequence[SourceTexture], device: torch.device) -> Pack:
    """`pack` with the PSNR in dB of each texture's mip 0 over 8-bit values, against `textures` in the same order."""
    codec = TorchCodec(pack, device)
    measured = tuple(
        replace(encoded, psnr_db=psnr_db(codec.decode_image(index), source.pixels))
        for index, (encoded, source) in enumerate(zip(pack.textures, textures, strict=True))
    )
    return replace(pack, textures=measured)


def _pack(textures: Sequence[SourceTexture], grouping: Grouping, codec: CodecConfig, run: _Training) -> Pack:
    decoders: dict[int, Decoder] = {}
    latents: dict[int, QuantizedLatents] = {}
    adapters: dict[int, Adapter] = {}
    for member, cohort in zip(run.members, run.cohorts, strict=True):
        latents.update(zip(member, cohort.quantized(), strict=True))
        if codec.adapters:
            adapters.update(zip(member, cohort.adapters(), strict=True))
        decoders.update(zip(cohort.decoder_numbers, cohort.stored_decoders(), strict=True))
    encoded = tuple(
        encoded_texture(texture, grouping.groups[index], latents[index], adapters.get(index))
        for index, texture in enumerate(textures)
    )
    return Pack(codec, grouping, encoded, tuple(decoders[number] for number in range(grouping.group_count)))


def train(
    textures: Sequence[SourceTexture],
    grouping: Grouping,
    codec: CodecConfig,
    training: TrainingConfig,
    progress: ProgressListener | None = None,
    cancelled: CancelQuestion | None = None,
    state: Path | None = None,
    rescue: Path | None = None,
) -> Pack:
    """Train a pack for `textures` in the groups of `grouping`. On one CPU the same seed gives the same pack.

    With `state` a training that was stopped goes on where it was, and ends as if it had never been stopped: the file is
    written every minute where that is possible, when `cancelled` says so and when numbers blow up, and removed at the end.
    Without it, the state of a training whose numbers blow up is written to `rescue`.

    Raises InputError for a device that is not there, for textures or groups that do not fit and for a state of another
    training, TrainingFailedError when numbers blow up for good, TrainingCancelledError when `cancelled` says so.
    """
    check_textures(textures, grouping, codec)
    device = choose_device(training.device)
    run = _Training(textures, grouping, codec, training, device)
    if state is not None and state.exists():
        run.load(state)
    try:
        run.run(TrainingClock(run.steps, progress, cancelled), state)
    except TrainingCancelledError:
        if state is not None:
            run.save(state)
        raise
    except TrainingFailedError as error:
        kept = state or rescue
        if kept is None:
            raise
        run.save(kept)
        raise TrainingFailedError(f"{error}; the last good state is in {kept}") from error
    pack = replace(
        _pack(textures, grouping, codec, run), training=training_record(training, device, run.cohorts, run.dropped)
    )
    measured = with_psnr(pack, textures, device)
    if state is not None:
        with suppress(OSError):
            state.unlink(missing_ok=True)
    return measured
