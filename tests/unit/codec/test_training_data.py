"""Samples of textures and their targets."""

import numpy as np
import pytest
import torch

from ntc.color import linear_to_srgb, srgb_to_linear
from ntc.config import CodecConfig
from ntc.mips import mip_chain
from ntc.textures import SourceTexture, hash_pixels
from ntc.training_data import Samples, TrainingData


def texture(width: int, height: int, channels: int = 3, seed: int = 0) -> SourceTexture:
    """A texture of noise."""
    pixels = np.random.default_rng(seed).integers(0, 256, (height, width, channels), np.uint8)
    return SourceTexture("noise", pixels, hash_pixels(pixels), "linear" if seed % 2 else "srgb", ("repeat", "clamp"))


def sampled(textures: list[SourceTexture], config: CodecConfig, count: int = 20_000) -> Samples:
    """Samples of these textures."""
    everything = torch.arange(len(textures))
    return TrainingData(textures, config, torch.device("cpu")).sample(
        count, torch.Generator().manual_seed(0), everything
    )


def at_centres(samples: Samples, width: int, height: int, level: int) -> torch.Tensor:
    """Which samples lie at texel centres of a level, and on it."""
    size = torch.tensor([max(1, width >> level), max(1, height >> level)])
    texels = samples.uv * size - 0.5
    return ((texels - texels.round()).abs() < 1e-3).all(dim=1) & (samples.lod == level)


def test_levels_are_sampled_by_their_texels_but_not_too_rarely() -> None:
    samples = sampled([texture(64, 64)], CodecConfig(downscale=1))
    weights = np.array([1.0, 0.25, 0.0625, 0.02, 0.02])
    found = np.bincount(np.floor(samples.lod.numpy()).astype(int), minlength=5) / len(samples.lod)
    np.testing.assert_allclose(found, weights / weights.sum(), atol=0.01)
    assert samples.lod.max() <= 4.0


def test_half_of_the_samples_lie_at_texel_centres() -> None:
    samples = sampled([texture(64, 64)], CodecConfig())
    centres = sum(int(at_centres(samples, 64, 64, level).sum()) for level in range(3))
    assert centres / len(samples.lod) == pytest.approx(0.5, abs=0.02)


def test_one_level_means_texel_centres_of_mip_0() -> None:
    samples = sampled([texture(12, 20)], CodecConfig(levels=1), 500)
    assert at_centres(samples, 12, 20, 0).all()


@pytest.mark.parametrize("seed", [0, 1])
def test_targets_at_texel_centres_are_the_mips(seed: int) -> None:
    source = texture(16, 24, 4, seed)
    samples = sampled([source], CodecConfig(output_channels=4, downscale=1), 4000)
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
    samples = sampled([source], CodecConfig(downscale=1, levels=2), 500)
    # The pyramid of so small a texture is one level, so lod stays 0 and only u and v blend.
    assert (samples.lod == 0.0).all()
    weight = np.clip(1.5 - 2.0 * samples.uv.numpy().astype(np.float64), 0.0, 1.0).prod(axis=1)
    np.testing.assert_allclose(srgb_to_linear(samples.targets[:, 0].numpy()), weight, atol=1e-4)

    source = texture(16, 16)
    samples = sampled([source], CodecConfig(downscale=1), 2000)
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
    data = TrainingData([texture(4, 4, 1), texture(4, 4, 4)], CodecConfig(output_channels=4), torch.device("cpu"))
    assert data.channel_mask.tolist() == [[1, 0, 0, 0], [1, 1, 1, 1]]
