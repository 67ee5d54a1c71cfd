"""Parts of training a grid: losses, steps, rates, samples and where latents start."""

import math
from dataclasses import dataclass, replace

import numpy as np
import pytest
import torch
from numpy.typing import NDArray
from torch import Tensor

from ntc.codec.grid.model import GridConfig
from ntc.codec.grid.torch_twin import AdapterStack, DecoderStack, positional_encoding, with_lod
from ntc.codec.grid.training import optimizers as decoder_loss
from ntc.codec.grid.training.config import FreezingConfig, TrainingConfig, freezing_scale, rate_scale
from ntc.codec.grid.training.data import IMAGE_DEVIATION, LATENT_SPREAD, TrainingData, image_latents, random_latents
from ntc.codec.grid.training.optimizers import BETAS, EPSILON, Adam, Muon, squared_error
from ntc.codec.latents import latent_levels
from ntc.codec.mips import linear_to_srgb, mip_chain, srgb_to_linear
from ntc.codec.textures import SourceTexture, hash_pixels
from ntc.codec.torch_texels import PyramidTable, trilinear_corners, weighted_rows
from tests.support.textures import of_pixels

CONFIG = GridConfig(hidden_width=16, adapters=True, adapter_output=True)


PLAIN = GridConfig()


@dataclass(frozen=True, eq=False)
class Problem:
    """Decoders, adapters and samples of five textures."""

    decoders: DecoderStack
    adapters: AdapterStack
    decoder: Tensor
    latents: Tensor
    known: Tensor
    targets: Tensor
    mask: Tensor

    def gradients(self, losses: Tensor, weights: Tensor) -> list[Tensor]:
        """Of the weighted losses in everything that is trained."""
        wanted = [self.latents, *self.adapters.parameters(), *self.decoders.parameters()]
        return list(torch.autograd.grad((losses * weights).sum(), wanted, allow_unused=True))


def problem(samples: int, spread: float) -> Problem:
    """Random numbers of this size."""
    generator = torch.Generator().manual_seed(samples)
    decoders = DecoderStack(CONFIG, 2, generator).double()
    adapters = AdapterStack(CONFIG, 5).double()
    with torch.no_grad():
        for values in adapters.parameters():
            values.add_(torch.randn(values.shape, generator=generator, dtype=torch.float64) * 0.3)
    latents = torch.randn(5, samples, 4, generator=generator, dtype=torch.float64) * spread
    # Channels that do not count, and others whose errors are worth more or less.
    mask = (torch.rand(5, 3, generator=generator) < 0.7).double() * torch.tensor([1.0, 1.5, 0.5]).double()
    return Problem(
        decoders,
        adapters,
        torch.tensor([0, 1, 1, 0, 1]),
        latents.requires_grad_(True),
        torch.randn(5, samples, CONFIG.decoder_inputs - 4, generator=generator, dtype=torch.float64),
        torch.rand(5, samples, 3, generator=generator, dtype=torch.float64),
        mask,
    )


@pytest.mark.parametrize("samples", [1, 7, 40])
@pytest.mark.parametrize("rows", [1, 16, 1000])
@pytest.mark.parametrize("spread", [1e-9, 1.0, 1e6])
def test_losses_and_gradients_are_those_of_autograd(
    monkeypatch: pytest.MonkeyPatch, samples: int, rows: int, spread: float
) -> None:
    monkeypatch.setattr(decoder_loss, "ROWS_AT_ONCE_CPU", rows)
    given = problem(samples, spread)
    weights = torch.linspace(0.5, 2.0, 5, dtype=torch.float64)
    inputs = torch.cat([given.latents, given.known], dim=2)
    decoded = given.decoders(inputs, given.decoder, given.adapters)
    plain = ((decoded - given.targets) * given.mask[:, None]).square().sum(dim=(1, 2))
    expected = given.gradients(plain, weights)
    layers = given.decoders.layers(given.decoder, given.adapters)
    fast = squared_error(layers, CONFIG.leaky_slope, given.latents, given.known, given.targets, given.mask)
    torch.testing.assert_close(fast, plain)
    for found, wanted in zip(given.gradients(fast, weights), expected, strict=True):
        # The decoders' hidden biases have no part where adapters have their own.
        assert (found is None) == (wanted is None)
        if wanted is not None:
            torch.testing.assert_close(found, wanted)


def test_no_gradient_is_no_step_and_a_zero_gradient_stays_finite() -> None:
    still, zero = (torch.nn.Parameter(torch.ones(2, 3, 4)) for _ in range(2))
    zero.grad = torch.zeros(2, 3, 4)
    Muon("hidden", [still, zero], 0.1).step(1.0)
    for parameter in (still, zero):
        torch.testing.assert_close(parameter.detach(), torch.ones(2, 3, 4))


def test_adam_moves_as_the_published_algorithm_does_in_float64() -> None:
    random = np.random.default_rng(4)
    start = random.standard_normal((7, 5))
    gradients = random.standard_normal((20, 7, 5)) * np.logspace(-9, 4, 7)[:, None]
    gradients[:, 3], gradients[5:9, 4] = 0.0, 0.0
    parameter = torch.nn.Parameter(torch.from_numpy(start.astype(np.float32)))
    optimizer = Adam("part", [parameter], 0.02)
    wanted, first, second = start.copy(), np.zeros_like(start), np.zeros_like(start)
    for step, gradient in enumerate(gradients, start=1):
        rate = 0.02 * (1.0 - step / 40)
        parameter.grad = torch.from_numpy(gradient.astype(np.float32))
        optimizer.step(1.0 - step / 40)
        first = BETAS[0] * first + (1.0 - BETAS[0]) * gradient
        second = BETAS[1] * second + (1.0 - BETAS[1]) * gradient**2
        corrected = first / (1.0 - BETAS[0] ** step), second / (1.0 - BETAS[1] ** step)
        wanted -= rate * corrected[0] / (np.sqrt(corrected[1]) + EPSILON)
    np.testing.assert_allclose(parameter.detach().numpy(), wanted, rtol=2e-5, atol=2e-6)
    before = parameter.detach().clone()
    optimizer.step(0.0)
    torch.testing.assert_close(parameter.detach(), before, rtol=0, atol=0)


def test_freezing_follows_the_paper() -> None:
    freezing = FreezingConfig(start=0.5, duration=0.1)
    assert [freezing_scale(progress, freezing) for progress in (0.0, 0.3, 0.5)] == [1.0, 1.0, 1.0]
    assert [freezing_scale(progress, freezing) for progress in (0.6, 0.7, 1.0)] == [0.0, 0.0, 0.0]
    for share in (0.1, 0.25, 0.5, 0.9):
        expected = 0.5 * (1.0 + math.cos(math.pi * share))
        assert freezing_scale(0.5 + 0.1 * share, freezing) == pytest.approx(expected)
    scales = [freezing_scale(step / 1000, FreezingConfig(0.2, 0.5)) for step in range(1001)]
    assert scales == sorted(scales, reverse=True)
    at_once = FreezingConfig(start=0.5, duration=0.0)
    assert [freezing_scale(progress, at_once) for progress in (0.0, 0.49, 0.5, 1.0)] == [1.0, 1.0, 0.0, 0.0]
    assert freezing_scale(0.9, None) == 1.0


def test_rates_follow_their_schedules() -> None:
    cosine, constant = TrainingConfig(schedule="cosine"), TrainingConfig(schedule="constant")
    assert [rate_scale(progress, cosine) for progress in (0.0, 0.5, 1.0)] == pytest.approx([1.0, 0.5, 0.0])
    assert rate_scale(0.9, constant) == 1.0
    trapezoid = TrainingConfig(schedule="trapezoid")
    scales = [rate_scale(step / 1000, trapezoid) for step in range(1001)]
    assert 0.0 < scales[0] < 0.05
    assert scales[40] == scales[300] == scales[600] == 1.0
    assert scales[800] == pytest.approx(0.5)
    assert scales[1000] == 0.0
    assert scales[600:] == sorted(scales[600:], reverse=True)


def random_texture(width: int, height: int, channels: int = 3, seed: int = 0) -> SourceTexture:
    """A texture of noise."""
    pixels = np.random.default_rng(seed).integers(0, 256, (height, width, channels), np.uint8)
    return SourceTexture("noise", pixels, hash_pixels(pixels), "linear" if seed % 2 else "srgb", ("repeat", "clamp"))


@dataclass(frozen=True, eq=False)
class Drawn:
    """Samples of all parts."""

    uv: torch.Tensor
    lod: torch.Tensor
    targets: torch.Tensor


def sampled(textures: list[SourceTexture], config: GridConfig, count: int = 20_000) -> Drawn:
    """Samples of these textures."""
    everything = torch.arange(len(textures))
    data = TrainingData(textures, config, torch.device("cpu"))
    parts = data.sample(count, torch.Generator().manual_seed(0), everything)
    return Drawn(*(torch.cat([getattr(part, name) for part in parts]) for name in ("uv", "lod", "targets")))


def test_targets_between_levels_are_blended_in_linear_light() -> None:
    pixels = np.zeros((2, 2, 3), np.uint8)
    pixels[0, 0] = 255
    source = replace(of_pixels(pixels), wrap=("clamp", "clamp"))
    samples = sampled([source], GridConfig(downscale=1, levels=2), 500)
    # The pyramid of so small a texture is one level, so lod stays 0 and only u and v blend.
    assert (samples.lod == 0.0).all()
    weight = np.clip(1.5 - 2.0 * samples.uv.numpy().astype(np.float64), 0.0, 1.0).prod(axis=1)
    np.testing.assert_allclose(srgb_to_linear(samples.targets[:, 0].numpy()), weight, atol=1e-4)

    source = random_texture(16, 16)
    samples = sampled([source], GridConfig(downscale=1), 2000)
    chain = mip_chain(source.pixels, "srgb")
    for sample in np.nonzero(samples.lod.numpy() % 1.0 > 0.1)[0][:200]:
        lod, uv = float(samples.lod[sample]), samples.uv[sample].numpy().astype(np.float64)
        blend = np.zeros(3)
        for level, share in ((int(lod), 1.0 - lod % 1.0), (int(lod) + 1, lod % 1.0)):
            linear, side = srgb_to_linear(chain[level] / 255.0), 16 >> level
            x, y = uv * side - 0.5
            for dx in (0, 1):
                for dy in (0, 1):
                    column, row = int(np.floor(x)) + dx, int(np.floor(y)) + dy
                    near = (1.0 - abs(x - column)) * (1.0 - abs(y - row))
                    blend += share * near * linear[min(max(row, 0), side - 1), column % side]
        np.testing.assert_allclose(samples.targets[sample].numpy(), linear_to_srgb(blend), atol=1e-3)


@pytest.mark.parametrize("config", [GridConfig(), GridConfig(levels=1), GridConfig(downscale=3, positional_octaves=5)])
def test_samples_bring_what_the_codec_reads_there(config: GridConfig) -> None:
    textures = [
        random_texture(64, 64),
        random_texture(17, 33, seed=1),
        random_texture(1, 1, seed=2),
        random_texture(5, 200, seed=3),
    ]
    chosen = torch.tensor([3, 1, 0, 2])
    cpu = torch.device("cpu")
    data = TrainingData(textures, config, cpu)
    parts = data.sample(300, torch.Generator().manual_seed(1), chosen)
    assert len(parts) == (1 if config.levels == 1 else 2)
    latents = torch.randn(sum(data.cell_counts), 4, generator=torch.Generator().manual_seed(2))
    pyramids = [latent_levels(*source.size, config) for source in textures]
    repeats = [(True, False)] * 4
    cells = PyramidTable.of([[(lv.width, lv.height) for lv in levels] for levels in pyramids], repeats, cpu)
    texels = PyramidTable.of(
        [[(lv.texel_width, lv.texel_height) for lv in levels] for levels in pyramids], repeats, cpu
    )
    for part in parts:
        which = chosen.repeat_interleave(len(part.lod) // 4)
        index, weights = trilinear_corners(cells, which, part.uv, part.lod)
        waves = positional_encoding(texels, which, part.uv, part.lod, config.positional_octaves)
        # Texture coordinates of centres are rounded, texel numbers are not.
        read = weighted_rows(latents, index, weights)
        torch.testing.assert_close(weighted_rows(latents, part.index, part.weights), read, atol=2e-4, rtol=0.0)
        torch.testing.assert_close(part.known, with_lod(waves, part.lod, config), atol=2e-4, rtol=0.0)


def first_latents(pixels: NDArray[np.uint8], config: GridConfig = PLAIN) -> torch.Tensor:
    """[cells, channels] where training on `pixels` begins."""
    return image_latents(of_pixels(pixels), config, torch.Generator().manual_seed(0))


def test_latents_are_a_small_copy_of_the_texture_or_uniform() -> None:
    by_chance = random_latents(5000, GridConfig(), torch.Generator().manual_seed(0))
    assert by_chance.shape == (5000, 4)
    assert by_chance.abs().max() <= LATENT_SPREAD
    assert by_chance.std() == pytest.approx(LATENT_SPREAD / np.sqrt(3.0), rel=0.05)
    ramp = np.repeat(np.linspace(0, 255, 64).astype(np.uint8)[None, :, None], 64, axis=0)
    pixels = np.concatenate([ramp, 255 - ramp, np.zeros_like(ramp)], axis=2)
    latents = first_latents(pixels).numpy()
    levels = latent_levels(64, 64, GridConfig())
    for level in levels[:3]:
        cells = latents[level.first_cell : level.first_cell + level.cells].reshape(level.height, level.width, 4)
        assert (np.diff(cells[..., 0].mean(axis=0)) > 0.0).all()
        assert (np.diff(cells[..., 1].mean(axis=0)) < 0.0).all()
    assert latents[:256, 0].std() == pytest.approx(IMAGE_DEVIATION, rel=0.15)
