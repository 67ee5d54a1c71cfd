"""Where latents start: at chance, or at a small copy of the texture."""

import numpy as np
import torch
from numpy.typing import NDArray

from ntc.codec.config import CodecConfig
from ntc.codec.latents import latent_levels
from ntc.codec.mips import mip_chain
from ntc.codec.textures import SourceTexture

LATENT_SPREAD = 0.02
"""Latents at chance are uniform in [-LATENT_SPREAD, LATENT_SPREAD]. At the paper's learning rates smaller is no better, and 0.25
costs 0.9 dB after 500 steps."""
IMAGE_DEVIATION = 0.3
"""Standard deviation of the latents that start at an image."""
FLAT = 0.02
"""Deviation in [0, 1] below which a channel counts as flat, so that its noise is not blown up."""
CHANCE_SHARE = 0.02
"""Share of chance that is added to an image, to tell equal cells apart."""


def chance_latents(cells: int, config: CodecConfig, generator: torch.Generator) -> torch.Tensor:
    """[cells, latent_channels] uniform."""
    return (torch.rand(cells, config.latent_channels, generator=generator) * 2.0 - 1.0) * LATENT_SPREAD


def _pooled(planes: NDArray[np.float32], height: int, width: int) -> torch.Tensor:
    """[height * width, channels]: means of `planes` [H, W, channels] over the area of each cell."""
    image = torch.from_numpy(planes).permute(2, 0, 1)
    return torch.nn.functional.adaptive_avg_pool2d(image, (height, width)).flatten(1).t()


def image_latents(texture: SourceTexture, config: CodecConfig, generator: torch.Generator) -> torch.Tensor:
    """[cells, latent_channels] float32 of all levels: for each cell the mean of its texels, channel by channel, and how much
    they vary; what is left of the latent's channels is at chance. Each of mean 0 and of one deviation over mip 0.

    The decoder so starts from inputs that already say what a texture looks like around a texel, instead of noise
    that it first has to tell apart.
    """
    levels = latent_levels(*texture.size, config)
    described: list[torch.Tensor] = []
    for level, mip in zip(levels, mip_chain(texture.pixels, texture.color_space), strict=False):
        planes = mip.astype(np.float32) / 255.0
        grey = planes.mean(axis=2, keepdims=True)
        moments = _pooled(np.concatenate([planes, grey, grey * grey], axis=2), level.height, level.width)
        variation = (moments[:, -1:] - moments[:, -2:-1] ** 2).clamp(min=0.0).sqrt()
        described.append(torch.cat([moments[:, :-2], variation], dim=1)[:, : config.latent_channels])
    finest = described[0]
    mean, deviation = finest.mean(dim=0), finest.std(dim=0, unbiased=False)
    known = (torch.cat(described) - mean) / (deviation + FLAT) * IMAGE_DEVIATION
    latents = chance_latents(len(known), config, generator)
    latents[:, : known.shape[1]] = known + CHANCE_SHARE * latents[:, : known.shape[1]]
    return latents
