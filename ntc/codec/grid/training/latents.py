"""Latents under training: their start (random, or a small copy of the texture), blended reads and the gradient of reads."""

from collections.abc import Iterable

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from ntc.codec.grid.config import GridConfig
from ntc.codec.latents import latent_levels
from ntc.codec.mips import mip_chain
from ntc.codec.textures import SourceTexture

LATENT_SPREAD = 0.02
"""Random latents are uniform in [-LATENT_SPREAD, LATENT_SPREAD]. At the paper's learning rates smaller is no better, and 0.25
costs 0.9 dB after 500 steps."""
IMAGE_DEVIATION = 0.3
"""Standard deviation of the latents that start at an image."""
FLAT = 0.02
"""Deviation in [0, 1] below which a channel counts as flat, so that its noise is not blown up."""
RANDOM_SHARE = 0.02
"""Share of random numbers that is added to an image, so that equal cells differ."""


def random_latents(cells: int, config: GridConfig, generator: torch.Generator) -> Tensor:
    """[cells, latent_channels] uniform."""
    return (torch.rand(cells, config.latent_channels, generator=generator) * 2.0 - 1.0) * LATENT_SPREAD


def _pooled(planes: NDArray[np.float32], height: int, width: int) -> Tensor:
    """[height * width, channels]: means of `planes` [H, W, channels] over the area of each cell."""
    image = torch.from_numpy(planes).permute(2, 0, 1)
    return torch.nn.functional.adaptive_avg_pool2d(image, (height, width)).flatten(1).t()


def image_latents(texture: SourceTexture, config: GridConfig, generator: torch.Generator) -> Tensor:
    """[cells, latent_channels] float32 of all levels: for each cell the mean of its texels, channel by channel, and how much
    they vary; the remaining channels are random. Each channel has mean 0 and standard deviation IMAGE_DEVIATION over mip 0.

    So the decoder starts from inputs that already describe the texture around a texel, instead of noise.
    """
    levels = latent_levels(*texture.size, config)
    described: list[Tensor] = []
    for level, mip in zip(levels, mip_chain(texture.pixels, texture.color_space, texture.maps), strict=False):
        planes = mip.astype(np.float32) / 255.0
        grey = planes.mean(axis=2, keepdims=True)
        moments = _pooled(np.concatenate([planes, grey, grey * grey], axis=2), level.height, level.width)
        variation = (moments[:, -1:] - moments[:, -2:-1] ** 2).clamp(min=0.0).sqrt()
        described.append(torch.cat([moments[:, :-2], variation], dim=1)[:, : config.latent_channels])
    finest = described[0]
    mean, deviation = finest.mean(dim=0), finest.std(dim=0, unbiased=False)
    known = (torch.cat(described) - mean) / (deviation + FLAT) * IMAGE_DEVIATION
    latents = random_latents(len(known), config, generator)
    latents[:, : known.shape[1]] = known + RANDOM_SHARE * latents[:, : known.shape[1]]
    return latents


class LatentTable:
    """[cells, channels] trained latents. Autograd does not record reads: `set_gradient` takes their gradient.

    Autograd would allocate a gradient as large as the table in each step, and torch's own ways to add rows at indices (a sort,
    or one addition a row) take longer than the decoders do.
    """

    def __init__(self, start: Tensor) -> None:
        self.values = nn.Parameter(start)
        self._gradient = torch.zeros_like(start)
        self._rows: dict[int, Tensor] = {}
        self._products: dict[int, Tensor] = {}
        self._channels = torch.arange(start.shape[1], device=start.device)

    def read(self, index: Tensor, weights: Tensor) -> Tensor:
        """[N, channels]: sum over k of cells `index` [N, k] times `weights` [N, k]."""
        return torch.nn.functional.embedding_bag(index, self.values.detach(), per_sample_weights=weights, mode="sum")

    def set_gradient(self, parts: Iterable[tuple[Tensor, Tensor, Tensor]]) -> None:
        """The gradient of the values from (index [N, k], weights [N, k], gradient [N, channels] of what was read there)."""
        self._gradient.zero_()
        for index, weights, gradient in parts:
            count = index.numel() * gradient.shape[1]
            if count not in self._rows:
                self._rows[count] = torch.empty(count, dtype=torch.int64, device=index.device)
                self._products[count] = torch.empty(count, dtype=gradient.dtype, device=index.device)
            shape = (*index.shape, gradient.shape[1])
            rows, products = self._rows[count].view(shape), self._products[count].view(shape)
            torch.add(index.unsqueeze(2) * gradient.shape[1], self._channels, out=rows)
            torch.mul(weights.unsqueeze(2), gradient.unsqueeze(1), out=products)
            self._gradient.view(-1).scatter_add_(0, rows.view(-1), products.view(-1))
        self.values.grad = self._gradient
