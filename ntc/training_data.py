"""Textures on the training device, and random samples of them with their targets."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from ntc.config import CodecConfig
from ntc.latents import latent_levels
from ntc.mips import mip_chain, to_linear
from ntc.sampling import PyramidTable, trilinear_corners
from ntc.textures import SourceTexture

CENTRE_SHARE = 0.5
"""Share of each texture's samples at texel centres of whole levels; the others lie anywhere, between levels too."""
SMALLEST_LEVEL_WEIGHT = 0.02
"""Levels are sampled by their texels, but never less often than this, relative to mip 0."""


@dataclass(frozen=True, eq=False)
class Samples:
    """Random texels of textures: N samples each of T textures, flattened to [T N]."""

    texture: Tensor
    """[T N] int64."""
    uv: Tensor
    """[T N, 2] in [0, 1]."""
    lod: Tensor
    """[T N]."""
    targets: Tensor
    """[T N, output_channels] in the texture's colour space, in [0, 1]."""
    per_texture: int
    """N."""
    centres: int
    """The first so many of each texture lie at texel centres of whole levels."""

    def columns(self, values: Tensor, first: int, end: int) -> Tensor:
        """[T (end - first), ...]: of `values` [T N, ...] the samples `first` to `end` of each texture."""
        return values.view(-1, self.per_texture, *values.shape[1:])[:, first:end].flatten(0, 1)


class TrainingData:
    """The mip chains of some textures in one flat array, and their latent geometry."""

    def __init__(self, textures: Sequence[SourceTexture], config: CodecConfig, device: torch.device) -> None:
        self.count = len(textures)
        self._device = device
        pyramids = [latent_levels(*texture.size, config) for texture in textures]
        repeats = [(texture.wrap[0] == "repeat", texture.wrap[1] == "repeat") for texture in textures]
        self.cells = PyramidTable.of([[(lv.width, lv.height) for lv in levels] for levels in pyramids], repeats, device)
        self.texels = PyramidTable.of(
            [[(lv.texel_width, lv.texel_height) for lv in levels] for levels in pyramids], repeats, device
        )
        self.cell_counts = [sum(level.cells for level in levels) for levels in pyramids]
        self.texel_counts = [texture.size[0] * texture.size[1] for texture in textures]
        channels = config.output_channels
        rows, coded_rows = [], []
        for texture, levels in zip(textures, pyramids, strict=True):
            for mip in mip_chain(texture.pixels, texture.color_space)[: len(levels)]:
                linear = to_linear(mip, texture.color_space).reshape(-1, mip.shape[2])
                missing = ((0, 0), (0, channels - mip.shape[2]))
                rows.append(np.pad(linear, missing).astype(np.float16))
                coded_rows.append(np.pad(mip.reshape(-1, mip.shape[2]), missing))
        # Half precision: a tenth of an 8-bit sRGB step at worst, for half the memory and traffic.
        self._linear = torch.from_numpy(np.concatenate(rows)).to(device)
        self._coded = torch.from_numpy(np.concatenate(coded_rows)).to(device)
        used = torch.tensor([[channel < t.pixels.shape[2] for channel in range(channels)] for t in textures])
        self.channel_mask = used.to(device=device, dtype=torch.float32)
        """[T, output_channels]: 1 for the channels that a texture has."""
        coded = torch.tensor(
            [[t.color_space == "srgb" and channel < 3 for channel in range(channels)] for t in textures]
        )
        self._srgb_coded = coded.to(device)
        self._single_level = config.levels == 1
        weights = torch.clamp(
            4.0 ** -torch.arange(self.cells.width.shape[1], dtype=torch.float32), min=SMALLEST_LEVEL_WEIGHT
        )
        available = torch.arange(self.cells.width.shape[1])[None, :] < self.cells.levels.cpu()[:, None]
        shares = weights[None, :] * available
        self._level_cumulative = torch.cumsum(shares / shares.sum(dim=1, keepdim=True), dim=1).to(device)

    def sample(self, per_texture: int, generator: torch.Generator, chosen: Tensor) -> Samples:
        """`per_texture` random samples of each texture in `chosen` [T] int64, with targets: trilinear in linear light, as the
        hardware filters."""
        # With one level all are texels of mip 0, as in the paper.
        centres = per_texture if self._single_level else round(CENTRE_SHARE * per_texture)
        shape = (len(chosen), per_texture)
        texture, last = chosen[:, None].expand(shape), (self.cells.levels[chosen] - 1)[:, None]
        random = torch.rand(*shape, 4, generator=generator).to(self._device)
        level = torch.searchsorted(self._level_cumulative[chosen], random[..., 0].contiguous())
        level = torch.minimum(level, last)
        at, lod = random[..., 1:3].clone(), level.to(random.dtype)
        size = torch.stack([self.texels.width[texture, level], self.texels.height[texture, level]], dim=-1)
        texel = torch.minimum((at * size).long(), size - 1)[:, :centres]
        at[:, :centres] = (texel + 0.5) / size[:, :centres]
        lod[:, centres:] = torch.minimum(lod + random[..., 3], last.to(lod.dtype))[:, centres:]
        row = self.texels.first[texture, level][:, :centres] + texel[..., 1] * size[:, :centres, 0] + texel[..., 0]
        targets = [self._coded.index_select(0, row.reshape(-1)).float().div_(255.0).view(*row.shape, -1)]
        if centres < per_texture:
            rest = slice(centres, None)
            between = self._targets(texture[:, rest].reshape(-1), at[:, rest].reshape(-1, 2), lod[:, rest].reshape(-1))
            targets.append(between.view(len(chosen), per_texture - centres, -1))
        return Samples(
            texture=texture.reshape(-1),
            uv=at.view(-1, 2),
            lod=lod.view(-1),
            targets=torch.cat(targets, dim=1).flatten(0, 1),
            per_texture=per_texture,
            centres=centres,
        )

    def _targets(self, texture: Tensor, uv: Tensor, lod: Tensor) -> Tensor:
        index, weights = trilinear_corners(self.texels, texture, uv, lod)
        texels = self._linear.index_select(0, index.reshape(-1)).float().view(*index.shape, -1)
        blended = torch.bmm(weights.unsqueeze(1), texels).squeeze(1)
        srgb = torch.where(
            blended <= 0.0031308, blended * 12.92, 1.055 * blended.clamp(min=1e-6) ** (1.0 / 2.4) - 0.055
        )
        return torch.where(self._srgb_coded[texture], srgb, blended)
