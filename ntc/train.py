"""Training latents and decoders of a grouping (paper, Sec. 3 and 4)."""

import math
import platform
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
import torch

from ntc.codec import TorchCodec, codec_inputs, level_inputs
from ntc.config import CodecConfig
from ntc.decoder import AdapterStack, DecoderStack
from ntc.errors import InputError
from ntc.metrics import psnr_db
from ntc.muon import Muon
from ntc.pack import Adapter, Decoder, EncodedTexture, Grouping, Pack
from ntc.quantize import QuantizedLatents, quantize_latents
from ntc.schedule import freezing_scale, rate_scale
from ntc.textures import SourceTexture
from ntc.training_config import TrainingConfig
from ntc.training_data import Samples, TrainingData
from ntc.warm_start import chance_latents, image_latents

STEPS_BETWEEN_RANGES = 50
"""Steps between measurements of the latents' ranges, which set the quantisation noise."""
SECONDS_BETWEEN_REPORTS = 0.25


@dataclass(frozen=True)
class TrainingProgress:
    """One report of a training under way."""

    step: int
    steps: int
    psnr_db: float
    """Running PSNR in dB of the samples, all lods mixed, before 8-bit rounding."""
    texels_per_second: float
    seconds_left: float
    loss: float
    freezing_scale: float


class TrainingCancelledError(Exception):
    """The caller asked to stop; nothing is delivered."""


ProgressListener = Callable[[TrainingProgress], None]
CancelQuestion = Callable[[], bool]


def choose_device(name: str) -> torch.device:
    """The torch device for `auto`, `cpu` or `cuda`. Raises InputError for CUDA where torch has none."""
    if name == "auto":
        return torch.device("cuda" if torch.cuda.is_available() else "cpu")
    if name == "cuda" and not torch.cuda.is_available():
        raise InputError(
            "--device cuda: this torch has no CUDA device; see README for the CUDA build, or use --device cpu"
        )
    return torch.device(name)


class _Clock:
    """Counts the steps of all cohorts together and reports about four times a second."""

    def __init__(self, steps: int, listener: ProgressListener | None, cancelled: CancelQuestion | None) -> None:
        self._steps, self._listener, self._cancelled = steps, listener, cancelled
        self._start = self._last_report = time.monotonic()
        self._step = 0
        self._texels = 0
        self._mean_loss = math.nan

    def tick(self, loss: torch.Tensor, texels: int, scale: float) -> None:
        """Count one step. Raises TrainingCancelledError when the caller asks to stop."""
        self._step += 1
        self._texels += texels
        if self._cancelled is not None and self._cancelled():
            raise TrainingCancelledError
        now = time.monotonic()
        if self._listener is None or (now - self._last_report < SECONDS_BETWEEN_REPORTS and self._step < self._steps):
            return
        self._last_report = now
        value = float(loss)
        self._mean_loss = value if math.isnan(self._mean_loss) else 0.7 * self._mean_loss + 0.3 * value
        elapsed = max(now - self._start, 1e-6)
        self._listener(
            TrainingProgress(
                step=self._step,
                steps=self._steps,
                psnr_db=-10.0 * math.log10(max(self._mean_loss, 1e-12)),
                texels_per_second=self._texels / elapsed,
                seconds_left=elapsed / self._step * (self._steps - self._step),
                loss=value,
                freezing_scale=scale,
            )
        )


@dataclass(frozen=True, eq=False)
class _Part:
    """Parameters that are trained alike."""

    optimizer: torch.optim.Optimizer
    rate: float
    """Learning rate before any schedule."""
    freezes: bool = False
    """Whether freezing slows it down: decoders, which the textures of a group share."""
    is_latents: bool = False


class _Cohort:
    """Textures whose decoders are trained side by side: all of them, or one group."""

    def __init__(
        self,
        textures: Sequence[SourceTexture],
        groups: Sequence[int],
        config: CodecConfig,
        training: TrainingConfig,
        device: torch.device,
        generator: torch.Generator,
    ) -> None:
        self._config, self._training, self._generator = config, training, generator
        self.data = TrainingData(textures, config, device)
        self.decoder_numbers = sorted(set(groups))
        self._decoder_of = torch.tensor([self.decoder_numbers.index(group) for group in groups], device=device)
        self.decoders = DecoderStack(config, len(self.decoder_numbers), generator).to(device)
        self.adapters = AdapterStack(config, len(textures)).to(device) if config.adapters else None
        self.latents = torch.nn.Parameter(self._start(textures).to(device))
        self.per_texture = (
            training.texels_per_texture
            if training.texels_per_group is None
            else max(1, math.ceil(training.texels_per_group / len(textures)))
        )
        if training.steps is not None:
            self.steps = training.steps
        else:
            samples = (training.epochs or 0.0) * sum(self.data.texel_counts)
            self.steps = max(1, math.ceil(samples / (self.per_texture * len(textures))))
        self._rounded: list[QuantizedLatents] | None = None

    def _start(self, textures: Sequence[SourceTexture]) -> torch.Tensor:
        if self._training.latent_start == "image":
            return torch.cat([image_latents(texture, self._config, self._generator) for texture in textures])
        return chance_latents(sum(self.data.cell_counts), self._config, self._generator)

    def _ranges(self) -> tuple[torch.Tensor, torch.Tensor]:
        """Smallest and largest latent [T, channels] of every texture."""
        pieces = torch.split(self.latents.detach().t().contiguous(), self.data.cell_counts, dim=1)
        bounds = [torch.aminmax(piece, dim=1) for piece in pieces]
        return torch.stack([low for low, _ in bounds]), torch.stack([high for _, high in bounds])

    def quantized(self) -> list[QuantizedLatents]:
        """The latents of each texture, rounded."""
        if self._rounded is None:
            low, high = (bound.cpu().numpy() for bound in self._ranges())
            pieces = torch.split(self.latents.detach().cpu(), self.data.cell_counts)
            self._rounded = [quantize_latents(p.numpy(), low[i], high[i]) for i, p in enumerate(pieces)]
        return self._rounded

    def _round_for_good(self) -> None:
        values = np.concatenate([quantized.values() for quantized in self.quantized()]).astype(np.float32)
        with torch.no_grad():
            self.latents.copy_(torch.from_numpy(values))
        self.latents.requires_grad_(False)

    def train(self, clock: _Clock) -> None:
        """Run all steps."""
        training = self._training
        optimizers = self._optimizers()
        first_rounded = self.steps - math.floor(self.steps * training.rounded_share)
        noise_step = torch.zeros(0)
        for step in range(self.steps):
            progress = step / self.steps
            if step == first_rounded:
                self._round_for_good()
            if step % STEPS_BETWEEN_RANGES == 0 and step < first_rounded:
                low, high = self._ranges()
                noise_step = (high - low) / 255.0
            freezing = freezing_scale(progress, training.freezing)
            for part in optimizers:
                part.optimizer.zero_grad(set_to_none=True)
            loss = self._loss(noise_step if step < first_rounded else None)
            loss.backward()
            for part in optimizers:
                scale = rate_scale(progress, training) * (freezing if part.freezes else 1.0)
                part.optimizer.param_groups[0]["lr"] = part.rate * scale
                # Adam would go on by its momentum where nothing is left to learn from.
                if scale > 0.0 and not (part.is_latents and step >= first_rounded):
                    part.optimizer.step()
            clock.tick(loss.detach(), self.per_texture * self.data.count, freezing)

    def _optimizers(self) -> list[_Part]:
        training = self._training
        hidden = list(self.decoders.weights[:-1]) if training.hidden_optimizer == "muon" else []
        others = [p for p in self.decoders.parameters() if not any(p is matrix for matrix in hidden)]

        def adam(parameters: Sequence[torch.Tensor], rate: float) -> torch.optim.Optimizer:
            return torch.optim.Adam(parameters, lr=rate, fused=True)

        parts = [
            _Part(adam([self.latents], training.latent_rate), training.latent_rate, is_latents=True),
            _Part(adam(others, training.decoder_rate), training.decoder_rate, freezes=True),
        ]
        if hidden:
            parts.append(_Part(Muon(hidden, training.hidden_rate), training.hidden_rate, freezes=True))
        if self.adapters is not None:
            specialised = list(self.adapters.parameters())
            parts.append(_Part(adam(specialised, training.decoder_rate), training.decoder_rate))
        return parts

    def _inputs(self, samples: Samples) -> torch.Tensor:
        """[T N, decoder_inputs] of the samples."""
        parts = []
        for first, end, inputs in (
            (0, samples.centres, level_inputs),
            (samples.centres, samples.per_texture, codec_inputs),
        ):
            if first == end:
                continue
            texture, uv, lod = (samples.columns(v, first, end) for v in (samples.texture, samples.uv, samples.lod))
            at = lod.long() if inputs is level_inputs else lod
            made = inputs(self._config, self.latents, self.data.cells, self.data.texels, texture, uv, at)
            parts.append(made.view(self.data.count, end - first, -1))
        return torch.cat(parts, dim=1).flatten(0, 1)

    def _loss(self, noise_step: torch.Tensor | None) -> torch.Tensor:
        samples = self.data.sample(self.per_texture, self._generator)
        inputs = self._inputs(samples)
        if noise_step is not None:
            channels = self._config.latent_channels
            # Rounding moves each of the up to eight blended cells by up to half a step, so the blend by less than that.
            noise = torch.rand(len(inputs), channels, generator=self._generator).to(inputs.device) - 0.5
            noise = noise * noise_step[samples.texture] * 0.6
            inputs = torch.cat([inputs[:, :channels] + noise, inputs[:, channels:]], dim=1)
        decoded = self.decoders(inputs.view(self.data.count, self.per_texture, -1), self._decoder_of, self.adapters)
        difference = (decoded - samples.targets.view_as(decoded)) * self.data.channel_mask[:, None, :]
        return difference.square().sum() / (self.data.channel_mask.sum() * self.per_texture)


def _cohorts(textures: Sequence[SourceTexture], grouping: Grouping, training: TrainingConfig) -> list[list[int]]:
    if training.texels_per_group is None:
        return [list(range(len(textures)))]
    return [
        [index for index, group in enumerate(grouping.groups) if group == number]
        for number in range(grouping.group_count)
    ]


def _record(training: TrainingConfig, device: torch.device, seconds: float, steps: int) -> dict[str, Any]:
    record = {key: value for key, value in asdict(training).items() if key != "device"}
    return {
        **record,
        "steps": steps,
        "device": str(device),
        "seconds": round(seconds, 1),
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


def _check(textures: Sequence[SourceTexture], grouping: Grouping, codec: CodecConfig) -> None:
    if not textures:
        raise InputError("there is no texture to train")
    if len(grouping.groups) != len(textures) or set(grouping.groups) != set(range(grouping.group_count)):
        raise InputError(f"grouping {grouping.name}: needs a group for each texture, numbered from 0 without gaps")
    for texture in textures:
        channels = texture.pixels.shape[2]
        if channels > codec.output_channels:
            raise InputError(
                f"{texture.name}: has {channels} channels; set codec.output_channels to at least that, "
                f"not {codec.output_channels}"
            )


def train(
    textures: Sequence[SourceTexture],
    grouping: Grouping,
    codec: CodecConfig,
    training: TrainingConfig,
    progress: ProgressListener | None = None,
    cancelled: CancelQuestion | None = None,
) -> Pack:
    """Train a pack for `textures` in the groups of `grouping`. On one CPU the same seed gives the same pack.

    Raises InputError for a device that is not there and for textures or groups that do not fit,
    TrainingCancelledError when `cancelled` says so.
    """
    _check(textures, grouping, codec)
    device = choose_device(training.device)
    generator = torch.Generator().manual_seed(training.seed)
    started = time.monotonic()
    members = _cohorts(textures, grouping, training)
    cohorts = [
        _Cohort([textures[i] for i in m], [grouping.groups[i] for i in m], codec, training, device, generator)
        for m in members
    ]
    clock = _Clock(sum(cohort.steps for cohort in cohorts), progress, cancelled)
    decoders: dict[int, Decoder] = {}
    latents: dict[int, QuantizedLatents] = {}
    adapters: dict[int, Adapter] = {}
    for member, cohort in zip(members, cohorts, strict=True):
        cohort.train(clock)
        decoders.update(zip(cohort.decoder_numbers, cohort.decoders.export(), strict=True))
        latents.update(zip(member, cohort.quantized(), strict=True))
        if cohort.adapters is not None:
            adapters.update(zip(member, cohort.adapters.export(), strict=True))
    encoded = tuple(
        EncodedTexture(
            name=texture.name,
            pixel_hash=texture.pixel_hash,
            width=texture.size[0],
            height=texture.size[1],
            channels=texture.pixels.shape[2],
            color_space=texture.color_space,
            wrap=texture.wrap,
            category=texture.category,
            group=grouping.groups[index],
            latents=latents[index].stored,
            scale=latents[index].scale,
            offset=latents[index].offset,
            adapter=adapters.get(index),
        )
        for index, texture in enumerate(textures)
    )
    record = _record(training, device, time.monotonic() - started, sum(cohort.steps for cohort in cohorts))
    ordered = tuple(decoders[number] for number in range(grouping.group_count))
    return with_psnr(Pack(codec, grouping, encoded, ordered, record), textures, device)
