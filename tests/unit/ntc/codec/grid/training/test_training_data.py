"""Samples of textures and their targets."""

from dataclasses import dataclass

import numpy as np
import pytest
import torch

from ntc.codec.color import linear_to_srgb, srgb_to_linear
from ntc.codec.grid.model import GridConfig
from ntc.codec.grid.torch_twin import codec_features
from ntc.codec.grid.training.data import TrainingData
from ntc.codec.latents import latent_levels
from ntc.codec.mips import mip_chain
from ntc.codec.textures import SourceTexture, hash_pixels
from ntc.codec.torch_texels import PyramidTable, weighted_rows


def texture(width: int, height: int, channels: int = 3, seed: int = 0) -> SourceTexture:
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


def at_centres(samples: Drawn, width: int, height: int, level: int) -> torch.Tensor:
    """Which samples lie at texel centres of a level, and on it."""
    size = torch.tensor([max(1, width >> level), max(1, height >> level)])
    texels = samples.uv * size - 0.5
    return ((texels - texels.round()).abs() < 1e-3).all(dim=1) & (samples.lod == level)


def test_levels_are_sampled_by_their_texels_but_not_too_rarely() -> None:
    samples = sampled([texture(64, 64)], GridConfig(downscale=1))
    weights = np.array([1.0, 0.5, 0.25, 0.125, 0.0625])
    found = np.bincount(np.floor(samples.lod.numpy()).astype(int), minlength=5) / len(samples.lod)
    np.testing.assert_allclose(found, weights / weights.sum(), atol=0.01)
    assert samples.lod.max() <= 4.0


def test_half_of_the_samples_lie_at_texel_centres() -> None:
    samples = sampled([texture(64, 64)], GridConfig())
    centres = sum(int(at_centres(samples, 64, 64, level).sum()) for level in range(3))
    assert centres / len(samples.lod) == pytest.approx(0.5, abs=0.02)


def test_one_level_means_texel_centres_of_mip_0() -> None:
    samples = sampled([texture(12, 20)], GridConfig(levels=1), 500)
    assert at_centres(samples, 12, 20, 0).all()


@pytest.mark.parametrize("seed", [0, 1])
def test_targets_at_texel_centres_are_the_mips(seed: int) -> None:
    source = texture(16, 24, 4, seed)
    samples = sampled([source], GridConfig(output_channels=4, downscale=1), 4000)
    for level in range(3):
        mip = mip_chain(source.pixels, source.color_space)[level]
        chosen = at_centres(samples, 16, 24, level)
        column, row = (samples.uv[chosen] * torch.tensor([mip.shape[1], mip.shape[0]])).long().numpy().T
        assert len(column) > 20
        np.testing.assert_allclose(samples.targets[chosen].numpy() * 255.0, mip[row, column], atol=0.3)


def test_targets_between_levels_are_blended_in_linear_light() -> None:
    pixels = np.zeros((2, 2, 3), np.uint8)
    pixels[0, 0] = 255
    source = SourceTexture("corner", pixels, hash_pixels(pixels), wrap=("clamp", "clamp"))
    samples = sampled([source], GridConfig(downscale=1, levels=2), 500)
    # The pyramid of so small a texture is one level, so lod stays 0 and only u and v blend.
    assert (samples.lod == 0.0).all()
    weight = np.clip(1.5 - 2.0 * samples.uv.numpy().astype(np.float64), 0.0, 1.0).prod(axis=1)
    np.testing.assert_allclose(srgb_to_linear(samples.targets[:, 0].numpy()), weight, atol=1e-4)

    source = texture(16, 16)
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


def test_channels_that_a_texture_lacks_do_not_count() -> None:
    data = TrainingData([texture(4, 4, 1), texture(4, 4, 4)], GridConfig(output_channels=4), torch.device("cpu"))
    assert data.channel_mask.tolist() == [[1, 0, 0, 0], [1, 1, 1, 1]]


@pytest.mark.parametrize("config", [GridConfig(), GridConfig(levels=1), GridConfig(downscale=3, positional_octaves=5)])
def test_samples_bring_what_the_codec_reads_there(config: GridConfig) -> None:
    textures = [texture(64, 64), texture(17, 33, seed=1), texture(1, 1, seed=2), texture(5, 200, seed=3)]
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
        read, known = codec_features(config, latents, cells, texels, which, part.uv, part.lod)
        # Texture coordinates of centres are rounded, texel numbers are not.
        torch.testing.assert_close(weighted_rows(latents, part.index, part.weights), read, atol=2e-4, rtol=0.0)
        torch.testing.assert_close(part.known, known, atol=2e-4, rtol=0.0)
