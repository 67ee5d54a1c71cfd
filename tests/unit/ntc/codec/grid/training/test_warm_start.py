"""Where latents start."""

import numpy as np
import pytest
import torch

from ntc.codec.grid.model import GridConfig
from ntc.codec.grid.training.data import IMAGE_DEVIATION, LATENT_SPREAD, image_latents, random_latents
from ntc.codec.latents import latent_cell_count, latent_levels
from ntc.codec.textures import SourceTexture


def generator() -> torch.Generator:
    return torch.Generator().manual_seed(0)


def of(pixels: np.ndarray) -> SourceTexture:
    return SourceTexture("t", pixels, "0")


def test_chance_is_uniform() -> None:
    latents = random_latents(5000, GridConfig(), generator())
    assert latents.shape == (5000, 4)
    assert latents.abs().max() <= LATENT_SPREAD
    assert latents.std() == pytest.approx(LATENT_SPREAD / np.sqrt(3.0), rel=0.05)


@pytest.mark.parametrize("channels", [1, 2, 3, 4])
@pytest.mark.parametrize("latent_channels", [4, 8])
@pytest.mark.parametrize("size", [(64, 64), (1, 1), (5, 37), (256, 4), (1, 4096)])
def test_any_texture_gives_finite_latents(size: tuple[int, int], channels: int, latent_channels: int) -> None:
    config = GridConfig(latent_channels=latent_channels, output_channels=4)
    for pixels in (
        np.random.default_rng(0).integers(0, 256, (*size, channels), np.uint8),
        np.zeros((*size, channels), np.uint8),
    ):
        latents = image_latents(of(pixels), config, generator())
        assert latents.shape == (latent_cell_count(size[1], size[0], config), latent_channels)
        assert bool(torch.isfinite(latents).all())
        assert latents.abs().max() < 20.0


def test_latents_are_a_small_copy_of_the_texture() -> None:
    ramp = np.repeat(np.linspace(0, 255, 64).astype(np.uint8)[None, :, None], 64, axis=0)
    pixels = np.concatenate([ramp, 255 - ramp, np.zeros_like(ramp)], axis=2)
    latents = image_latents(of(pixels), GridConfig(), generator()).numpy()
    levels = latent_levels(64, 64, GridConfig())
    for level in levels[:3]:
        cells = latents[level.first_cell : level.first_cell + level.cells].reshape(level.height, level.width, 4)
        assert (np.diff(cells[..., 0].mean(axis=0)) > 0.0).all()
        assert (np.diff(cells[..., 1].mean(axis=0)) < 0.0).all()
    assert latents[:256, 0].std() == pytest.approx(IMAGE_DEVIATION, rel=0.15)


def test_the_last_channel_says_where_there_is_detail() -> None:
    pixels = np.full((64, 64, 3), 128, np.uint8)
    pixels[:, 32:] = np.random.default_rng(0).integers(0, 256, (64, 32, 1), np.uint8)
    cells = image_latents(of(pixels), GridConfig(), generator()).numpy()[:256].reshape(16, 16, 4)
    assert cells[:, 9:, 3].mean() > cells[:, :7, 3].mean() + IMAGE_DEVIATION
