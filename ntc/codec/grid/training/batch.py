"""A batch of groups: latents, decoders and adapters that are trained together, one step at a time (docs/explanation/training.md)."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import accumulate

import numpy as np
import torch
from torch import Tensor

from ntc.codec.encoding import Interruption, no_interruption
from ntc.codec.grid.model import Adapter, GridConfig, GridDecoder, GridTexture
from ntc.codec.grid.tensors import QuantizedLatents, quantize_latents
from ntc.codec.grid.torch_twin import AdapterStack, DecoderStack
from ntc.codec.grid.training.config import TrainingConfig, freezing_scale, rate_scale
from ntc.codec.grid.training.data import LatentTable, Samples, TrainingData, image_latents, random_latents
from ntc.codec.grid.training.optimizers import optimizer_parts, squared_error
from ntc.codec.textures import SourceTexture
from ntc.errors import NotFiniteError

STEPS_BETWEEN_RANGES = 50
"""Steps between measurements of the latents' ranges, which set the quantisation noise."""
NOISE = 0.6
"""Width of the quantisation noise in quantisation steps. It is less than 1 because up to eight rounded cells are blended, and their
errors partly cancel."""
LOSS_MEMORY = 0.95
"""Decay of the running loss of a texture per step."""


@dataclass(frozen=True, eq=False)
class RandomStreams:
    """Random numbers of a training, all from its seed.

    Latents and samples do not depend on how many decoders there are: trainings of one seed that differ in their grouping alone start
    from the same latents and see the same samples in the same order.
    """

    samples: torch.Generator
    """Start of the latents, samples and quantisation noise."""
    decoders: torch.Generator
    """Start of the decoders."""

    @classmethod
    def of_seed(cls, seed: int) -> "RandomStreams":
        """Return the streams of a seed."""
        (other,) = np.random.SeedSequence(seed).generate_state(1)
        return cls(torch.Generator().manual_seed(int(other)), torch.Generator().manual_seed(seed))


@dataclass(frozen=True, eq=False)
class StepReport:
    """The result of a training step."""

    loss: Tensor
    """Mean square error of the samples."""
    texels: int
    """Number of samples."""
    freezing: float
    """Scale of the decoders' updates, 1 to 0."""


def _side_by_side(flat: Sequence[Tensor], textures: int) -> Tensor:
    """Return [T, N, ...]: the samples of all parts, each [T n, ...], side by side for each texture."""
    rows = [values.view(textures, -1, values.shape[1]) for values in flat]
    return torch.cat(rows, dim=1) if len(rows) > 1 else rows[0]


class TrainingBatch:
    """Latents, decoders and adapters of the textures of a batch while they are trained."""

    def __init__(
        self,
        textures: Sequence[SourceTexture],
        groups: Sequence[int],
        config: GridConfig,
        training: TrainingConfig,
        device: torch.device,
        random: RandomStreams,
        interruption: Interruption = no_interruption,
    ) -> None:
        self._config, self._training, self._generator = config, training, random.samples
        self._interruption = interruption
        self._data = TrainingData(textures, config, device, interruption)
        self._first_cells = [0, *accumulate(self._data.cell_counts)][:-1]
        self.decoder_numbers = sorted(set(groups))
        self._decoder_of = torch.tensor([self.decoder_numbers.index(group) for group in groups], device=device)
        self.decoders = DecoderStack(config, len(self.decoder_numbers), random.decoders).to(device)
        self._adapters = AdapterStack(config, len(textures)).to(device) if config.adapters else None
        self._table = LatentTable(self._start(textures).to(device))
        self._parts = optimizer_parts(self._table.values, self.decoders, self._adapters, training)
        self.per_texture = (
            training.texels_per_texture
            if training.texels_per_group is None
            else max(1, math.ceil(training.texels_per_group / len(textures)))
        )
        if training.steps is not None:
            self.steps = training.steps
        else:
            samples = (training.epochs or 0.0) * sum(self._data.texel_counts)
            self.steps = max(1, math.ceil(samples / (self.per_texture * len(textures))))
        self.step = 0
        """Steps done."""
        self._noise_step = torch.zeros(len(textures), config.latent_channels, device=device)
        self._running = torch.full((len(textures),), math.nan, device=device)
        self._trained = torch.ones(len(textures), dtype=torch.bool, device=device)
        self._rounded: list[QuantizedLatents] | None = None

    def _start(self, textures: Sequence[SourceTexture]) -> Tensor:
        if self._training.latent_start == "image":
            latents = []
            for texture in textures:
                self._interruption()
                latents.append(image_latents(texture, self._config, self._generator))
            return torch.cat(latents)
        return random_latents(sum(self._data.cell_counts), self._config, self._generator)

    def plan(self, steps: int) -> None:
        """Change the planned number of steps during training; rates and rounding follow. It cannot fall below the steps done."""
        self.steps = max(steps, self.step, 1)

    def start_at(self, textures: Sequence[GridTexture | None], decoders: Sequence[GridDecoder | None]) -> None:
        """Load latents, adapters and weights of a pack, before the first step: `textures` in the order of this batch, `decoders` in
        that of `decoder_numbers`. None leaves a texture or decoder as it is."""
        with torch.no_grad():
            for texture, encoded, first, cells in zip(
                range(len(textures)), textures, self._first_cells, self._data.cell_counts, strict=True
            ):
                if encoded is None:
                    continue
                values = QuantizedLatents(encoded.latents, encoded.scale, encoded.offset).values()
                self._table.values[first : first + cells] = torch.from_numpy(values.astype(np.float32)).to(self._device)
                if self._adapters is not None and encoded.adapter is not None:
                    self._adapters.set(texture, encoded.adapter)
            for number, decoder in enumerate(decoders):
                if decoder is not None:
                    self.decoders.set(number, decoder)
                    self._share_output(number, textures)

    def _share_output(self, number: int, textures: Sequence[GridTexture | None]) -> None:
        """Move the mean of the adapters' output layers into decoder `number`; adapters hold the differences."""
        if self._adapters is None or not self._adapters.output:
            return
        members = (self._decoder_of == number).cpu()
        known = torch.tensor([encoded is not None for encoded in textures]) & members
        if not bool(known.any()):
            return
        for outputs, shared in zip(
            self._adapters.output, (self.decoders.weights[-1], self.decoders.biases[-1]), strict=True
        ):
            shared[number] = outputs[known].mean(dim=0)
            outputs[known] -= shared[number]

    @property
    def _device(self) -> torch.device:
        return self._table.values.device

    @property
    def _clip(self) -> float | None:
        # With 8 bits, 256 steps are fine enough even if outliers widen the range.
        return self._training.latent_clip if self._config.latent_bits < 8 else None

    @property
    def done(self) -> bool:
        """True if the batch has no steps left."""
        return self.step >= self.steps or not bool(self._trained.any())

    @property
    def converged(self) -> int:
        """Number of textures that stopped training because they had converged."""
        return int((~self._trained).sum())

    def _ranges(self, textures: Sequence[int]) -> tuple[Tensor, Tensor]:
        """Return the smallest and the largest latent, [T, channels] each, of `textures`; outliers are clipped."""
        lows, highs = [], []
        clip = self._clip
        for texture in textures:
            self._interruption()
            piece = self._piece(texture).t().contiguous()
            low, high = torch.aminmax(piece, dim=1)
            if clip is not None:
                variance, mean = torch.var_mean(piece, dim=1, correction=0)
                reach = clip * variance.sqrt()
                low, high = torch.maximum(low, mean - reach), torch.minimum(high, mean + reach)
            lows.append(low)
            highs.append(high)
        return torch.stack(lows), torch.stack(highs)

    def _piece(self, texture: int) -> Tensor:
        """Return the latents of a texture, [cells, channels]."""
        first = self._first_cells[texture]
        return self._table.values.detach()[first : first + self._data.cell_counts[texture]]

    def _measure_ranges(self) -> None:
        low, high = self._ranges(range(self._data.count))
        self._noise_step = (high - low) / self._config.largest_stored
        if self._clip is not None:
            for texture in range(self._data.count):
                self._interruption()
                piece = self._piece(texture)
                torch.clamp(piece, low[texture], high[texture], out=piece)

    def quantized(self) -> list[QuantizedLatents]:
        """Return the latents of each texture, rounded for good: later calls return the same."""
        if self._rounded is None:
            self._rounded = self.rounded_now(range(self._data.count))
        return self._rounded

    def rounded_now(self, textures: Sequence[int]) -> list[QuantizedLatents]:
        """Return the latents of `textures` as they would be stored if training ended now; training is not affected."""
        if self._rounded is not None:
            return [self._rounded[texture] for texture in textures]
        rounded = []
        for texture in textures:
            low, high = (bound[0].cpu().numpy() for bound in self._ranges([texture]))
            values = self._piece(texture).cpu().numpy()
            rounded.append(quantize_latents(values, low, high, self._config.largest_stored))
        return rounded

    def stored_decoders(self) -> tuple[GridDecoder, ...]:
        """Return the decoders as packs store them: the output layer is 0 if adapters hold one."""
        decoders = self.decoders.export()
        if not self._config.adapter_output:
            return decoders
        return tuple(
            GridDecoder(
                (*decoder.weights[:-1], np.zeros_like(decoder.weights[-1])),
                (*decoder.biases[:-1], np.zeros_like(decoder.biases[-1])),
            )
            for decoder in decoders
        )

    @property
    def running_losses(self) -> list[float]:
        """Running mean square error of the samples of each texture, all lods together; NaN before the first step."""
        return [float(loss) for loss in self._running.cpu()]

    def adapters(self) -> tuple[Adapter, ...]:
        """Return the adapter of each texture; empty if the codec has none."""
        return () if self._adapters is None else self._adapters.export(self.decoders, self._decoder_of)

    def _round_finally(self) -> None:
        values = np.concatenate([quantized.values() for quantized in self.quantized()]).astype(np.float32)
        with torch.no_grad():
            self._table.values.copy_(torch.from_numpy(values))

    def advance(self, rate_factor: float) -> StepReport:
        """Do one training step at `rate_factor` times the scheduled rates.

        Raises NotFiniteError, before any parameter has changed, if the loss or a gradient is not finite.
        """
        # One step: sample texels, read and blend latents, add noise for rounding, decode, and compare with the targets. Gradients
        # then go to latents, decoders and adapters. Uniform noise in place of rounding keeps the loss differentiable (Balle et al.
        # 2017, "End-to-end optimized image compression"). In the last steps latents are rounded, and only decoders and adapters
        # are trained. docs/explanation/training.md gives the recipe.
        first_rounded = self.steps - math.floor(self.steps * self._training.rounded_share)
        rounded = self._rounded is not None or self.step >= first_rounded
        if rounded and self._rounded is None:
            self._round_finally()
        if self.step % STEPS_BETWEEN_RANGES == 0 and not rounded:
            self._measure_ranges()
        chosen = torch.nonzero(self._trained).flatten()
        freezing = freezing_scale(self.step / self.steps, self._training.freezing)
        scale = rate_scale(self.step / self.steps, self._training) * rate_factor
        for part in self._parts:
            part.clear_gradients()
        parts = self._data.sample(self.per_texture, self._generator, chosen)
        self._interruption()
        read = _side_by_side([self._table.read(part.index, part.weights) for part in parts], len(chosen))
        read.requires_grad_(not rounded)
        losses = self._losses(chosen, parts, read, None if rounded else self._noise_step)
        used = self._data.channel_mask[chosen].square().sum() * self.per_texture
        loss = (losses * self._weights(chosen)).sum() / used
        torch.autograd.backward(loss)
        self._interruption()
        if read.grad is not None:
            pieces = torch.split(read.grad, [len(part.lod) // len(chosen) for part in parts], dim=1)
            self._table.set_gradient(
                (part.index, part.weights, piece.flatten(0, 1)) for part, piece in zip(parts, pieces, strict=True)
            )
        self._interruption()
        self._check(loss)
        frozen = self._frozen_rows() if len(chosen) < len(self._trained) else []
        for part in self._parts[1:] if rounded else self._parts:
            self._interruption()
            part.step(scale * (freezing if part.freezes else 1.0))
        for parameter, rows, values in frozen:
            parameter.data[rows] = values
        self._remember(chosen, losses.detach())
        self.step += 1
        if self.step % STEPS_BETWEEN_RANGES == 0:
            self._drop_converged()
        return StepReport(loss.detach(), self.per_texture * len(chosen), freezing)

    def _check(self, loss: Tensor) -> None:
        """Raise NotFiniteError if the loss or a gradient is not finite: then its sum is NaN or infinite."""
        sums = [loss.detach()]
        sums += [p.grad.sum() for part in self._parts for p in part.parameters if p.grad is not None]
        if not bool(torch.isfinite(torch.stack(sums)).all()):
            raise NotFiniteError

    def _weights(self, chosen: Tensor) -> Tensor:
        """Return [T]: the weight of each texture's loss, 1 on average."""
        running = self._running[chosen]
        if self._training.balance == 0.0 or bool(torch.isnan(running).any()):
            return torch.ones_like(running)
        weights = (running.mean() / running.clamp(min=1e-9)) ** self._training.balance
        return weights / weights.mean()

    def _remember(self, chosen: Tensor, losses: Tensor) -> None:
        share = losses / (self._data.channel_mask[chosen].square().sum(dim=1) * self.per_texture)
        before = self._running[chosen]
        self._running[chosen] = torch.where(
            torch.isnan(before), share, LOSS_MEMORY * before + (1.0 - LOSS_MEMORY) * share
        )

    def _drop_converged(self) -> None:
        if self._training.converged_db is None:
            return
        # The loss is NaN before the first step; then the comparison is false.
        good = self._running < 10.0 ** (-self._training.converged_db / 10.0)
        for group in range(len(self.decoder_numbers)):
            members = self._decoder_of == group
            if bool(good[members].all()):
                self._trained[members] = False

    def _frozen_rows(self) -> list[tuple[Tensor, Tensor, Tensor]]:
        """Return (parameter, rows, values) of textures that stopped training, to restore after the step: momentum changes them."""
        textures = ~self._trained
        decoders = torch.ones(len(self.decoder_numbers), dtype=torch.bool, device=textures.device)
        decoders[self._decoder_of[self._trained]] = False
        cells = torch.repeat_interleave(textures, torch.tensor(self._data.cell_counts, device=textures.device))
        owners = [([self._table.values], cells), (list(self.decoders.parameters()), decoders)]
        if self._adapters is not None:
            owners.append((list(self._adapters.parameters()), textures))
        return [(p, rows, p.data[rows]) for parameters, rows in owners for p in parameters]

    def _losses(self, chosen: Tensor, parts: Sequence[Samples], latents: Tensor, noise_step: Tensor | None) -> Tensor:
        """Return [T]: the sum of squared errors of each texture's samples, decoded from blended `latents` [T, N, channels]."""
        known = _side_by_side([part.known for part in parts], len(chosen))
        targets = _side_by_side([part.targets for part in parts], len(chosen))
        if noise_step is not None:
            every = (self._data.count, *latents.shape[1:])
            noise = torch.empty(every).uniform_(-0.5, 0.5, generator=self._generator).to(latents.device)[chosen]
            latents = latents + noise * (noise_step[chosen] * NOISE).unsqueeze(1)
        some = chosen if len(chosen) < self._data.count else None
        layers = self.decoders.layers(self._decoder_of[chosen], self._adapters, some)
        mask = self._data.channel_mask[chosen]
        return squared_error(layers, self._config.leaky_slope, latents, known, targets, mask, self._interruption)

    def state(self) -> dict[str, Tensor]:
        """Return all tensors that the next step depends on, by name, without the random generator. They are not copies."""
        tensors = {
            "step": torch.tensor(self.step),
            "noise_step": self._noise_step,
            "running": self._running,
            "trained": self._trained,
        }
        for part in self._parts:
            tensors.update(part.state())
        if self._rounded is not None:
            tensors["rounded.stored"] = torch.from_numpy(np.concatenate([q.stored for q in self._rounded]))
            tensors["rounded.scale"] = torch.from_numpy(np.stack([q.scale for q in self._rounded]))
            tensors["rounded.offset"] = torch.from_numpy(np.stack([q.offset for q in self._rounded]))
        return tensors

    def load(self, state: Mapping[str, Tensor]) -> None:
        """Copy a state into this batch. Raises KeyError or ValueError for the state of another training."""
        for part in self._parts:
            part.load(state)
        self.step = int(state["step"])
        for current, name in ((self._noise_step, "noise_step"), (self._running, "running"), (self._trained, "trained")):
            if state[name].shape != current.shape:
                raise ValueError(f"{name} is {list(state[name].shape)}, expected {list(current.shape)}")
        self._noise_step, self._running, self._trained = (
            state[name].clone().to(self._table.values.device) for name in ("noise_step", "running", "trained")
        )
        self._rounded = None
        if "rounded.stored" in state:
            stored, scale, offset = (state[f"rounded.{part}"].cpu() for part in ("stored", "scale", "offset"))
            pieces = torch.split(stored, self._data.cell_counts)
            self._rounded = [
                QuantizedLatents(piece.numpy().copy(), scale[i].numpy().copy(), offset[i].numpy().copy())
                for i, piece in enumerate(pieces)
            ]
