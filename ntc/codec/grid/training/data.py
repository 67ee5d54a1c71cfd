"""Training data: textures and latents on the training device, and random samples with their targets."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from ntc.codec.config import WrapMode
from ntc.codec.encoding import Interruption, no_interruption
from ntc.codec.grid.model import GridConfig
from ntc.codec.grid.torch_twin import positional_encoding, with_lod
from ntc.codec.latents import LatentLevel, latent_levels
from ntc.codec.maps import channel_places
from ntc.codec.mips import hardware_filtered, mip_chain, srgb_channels
from ntc.codec.textures import SourceTexture
from ntc.codec.torch_texels import PyramidTable, trilinear_corners

LATENT_SPREAD = 0.02
"""Random latents are uniform in [-LATENT_SPREAD, LATENT_SPREAD]. Smaller values gain nothing; 0.25 costs 0.9 dB after 500 steps
(paper's learning rates)."""
IMAGE_DEVIATION = 0.3
"""Standard deviation over mip 0 of latents that start at an image."""
FLAT = 0.02
"""Deviation in [0, 1] below which a channel counts as flat: its noise is not amplified."""
RANDOM_SHARE = 0.02
"""Weight of the random numbers that are added to an image, which make equal cells differ."""


def random_latents(cells: int, config: GridConfig, generator: torch.Generator) -> Tensor:
    """Return random latents, [cells, latent_channels]."""
    return (torch.rand(cells, config.latent_channels, generator=generator) * 2.0 - 1.0) * LATENT_SPREAD


def _pooled(planes: NDArray[np.float32], height: int, width: int) -> Tensor:
    """Return [height * width, channels]: the mean of `planes` [H, W, channels] over each cell."""
    image = torch.from_numpy(planes).permute(2, 0, 1)
    return torch.nn.functional.adaptive_avg_pool2d(image, (height, width)).flatten(1).t()


def image_latents(texture: SourceTexture, config: GridConfig, generator: torch.Generator) -> Tensor:
    """Return latents that start as a small copy of the texture: [cells, latent_channels] float32, all levels.

    The channels of a cell are the mean of each channel of its texels, then the standard deviation of their grey, then random numbers.
    All but the random ones have mean 0 and standard deviation IMAGE_DEVIATION over mip 0. So from the first step, the decoder's inputs
    describe the texture.
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
    """Trained latents, [cells, channels]. Autograd does not record reads; `set_gradient` computes the gradient.

    Autograd would allocate a gradient of the table's size in each step. Its operators that add rows at indices take longer than the
    decoders.
    """

    def __init__(self, start: Tensor) -> None:
        self.values = nn.Parameter(start)
        self._gradient = torch.zeros_like(start)
        self._rows: dict[int, Tensor] = {}
        self._products: dict[int, Tensor] = {}
        self._channels = torch.arange(start.shape[1], device=start.device)

    def read(self, index: Tensor, weights: Tensor) -> Tensor:
        """Return blended latents, [N, channels]: the sum over k of cells `index` [N, k] times `weights` [N, k]."""
        return torch.nn.functional.embedding_bag(index, self.values.detach(), per_sample_weights=weights, mode="sum")

    def set_gradient(self, parts: Iterable[tuple[Tensor, Tensor, Tensor]]) -> None:
        """Set the gradient of the table from parts (index [N, k], weights [N, k], gradient [N, channels] of what `read` returned)."""
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


CENTRE_SHARE = 0.5
"""Share of each texture's samples at texel centres of a mip. The others lie anywhere, between mips too."""
LEVEL_FALL = 2.0
"""A level is sampled this many times less often than the next finer one. It has a quarter of the texels, but a scene that is seen from
near and far shows about as many pixels of each level."""
SMALLEST_LEVEL_WEIGHT = 0.02
"""Lower limit of a level's sampling rate, relative to mip 0."""


def _axis(cells: int, texels: int, repeats: bool, octaves: int) -> tuple[Tensor, Tensor]:
    """Return, for each texel centre of an axis, [texels, 2] int64 cells around it and [texels, 2 + 2 octaves] weights and waves."""
    centre = torch.arange(texels, dtype=torch.float64) + 0.5
    at = centre / texels * cells - 0.5
    near = torch.floor(at)
    fraction = at - near
    cell = torch.stack([near, near + 1.0], dim=1).long()
    cell = torch.remainder(cell, cells) if repeats else cell.clamp(0, cells - 1)
    octave = 2.0 ** -torch.arange(1, octaves + 1, dtype=torch.float64)[:, None]
    turns = centre[:, None, None] * octave + torch.tensor([0.0, 0.25], dtype=torch.float64)
    waves = (4.0 * torch.abs(turns - torch.floor(turns) - 0.5) - 1.0).flatten(1)
    return cell, torch.cat([torch.stack([1.0 - fraction, fraction], dim=1), waves], dim=1).float()


@dataclass(frozen=True, eq=False)
class CentreFeatures:
    """Decoder inputs at N texel centres, except the latents themselves."""

    index: Tensor
    """[N, 4] int64: cells to blend."""
    weights: Tensor
    """[N, 4]: their weights."""
    waves: Tensor
    """[N, 4 octaves] positional encoding."""


class TexelTables:
    """Tables of decoder inputs at texel centres, for each row and each column of all levels.

    At the centre of texel (x, y), the cells along u, their weights and the positional encoding of u depend on x alone; those along v
    on y alone. Training reads them here instead of computing them for each sample.
    """

    def __init__(
        self,
        pyramids: Sequence[Sequence[LatentLevel]],
        wraps: Sequence[tuple[WrapMode, WrapMode]],
        first_cells: Sequence[int],
        config: GridConfig,
        device: torch.device,
    ) -> None:
        most = max(len(levels) for levels in pyramids)
        cells, numbers, first = [], [], torch.zeros(len(pyramids), most, 2, dtype=torch.int64)
        axes: dict[tuple[int, int, bool], tuple[Tensor, Tensor]] = {}
        position = 0
        for texture, (levels, wrap, first_cell) in enumerate(zip(pyramids, wraps, first_cells, strict=True)):
            for number, level in enumerate(levels):
                sizes = ((level.width, level.texel_width), (level.height, level.texel_height))
                for axis, (count, texels) in enumerate(sizes):
                    key = (count, texels, wrap[axis] == "repeat")
                    if key not in axes:
                        axes[key] = _axis(*key, config.positional_octaves)
                    cell, values = axes[key]
                    if axis == 1:
                        cell = cell * level.width + (first_cell + level.first_cell)
                    first[texture, number, axis] = position
                    cells.append(cell)
                    numbers.append(values)
                    position += texels
        self._cells = torch.cat(cells).to(device)
        self._numbers = torch.cat(numbers).to(device)
        self._first = first.to(device)

    def at(self, texture: Tensor, level: Tensor, texel: Tensor) -> CentreFeatures:
        """Return the inputs at texel (column, row) `texel` [N, 2] of `level` [N] of `texture` [N], all int64."""
        place = self._first[texture, level] + texel
        (column, u), (row, v) = (
            (self._cells.index_select(0, at), self._numbers.index_select(0, at)) for at in place.t().contiguous()
        )
        index = (row[:, :, None] + column[:, None, :]).flatten(1)
        weights = (v[:, :2, None] * u[:, None, :2]).flatten(1)
        return CentreFeatures(index, weights, torch.cat([u[:, 2:], v[:, 2:]], dim=1))


@dataclass(frozen=True, eq=False)
class Samples:
    """Random samples with targets: N of each of T textures, flattened to [T N]."""

    uv: Tensor
    """[T N, 2] in [0, 1]."""
    lod: Tensor
    """[T N]."""
    index: Tensor
    """[T N, 4 or 8] int64: cells to blend."""
    weights: Tensor
    """[T N, 4 or 8]: their weights."""
    known: Tensor
    """[T N, rest]: inputs of the decoder after the latents."""
    targets: Tensor
    """[T N, output_channels] in the texture's colour space, in [0, 1]."""


def _in_places(values: NDArray[Any], places: list[int], channels: int) -> NDArray[Any]:
    """Return [texels, channels]: the channels of `values` [H, W, C] in columns `places`, 0 in all others."""
    texels = np.zeros((values.shape[0] * values.shape[1], channels), values.dtype)
    texels[:, places] = values.reshape(-1, values.shape[2])
    return texels


class TrainingData:
    """The mip chains of a batch's textures in one flat array, and the sizes of their latent levels."""

    def __init__(
        self,
        textures: Sequence[SourceTexture],
        config: GridConfig,
        device: torch.device,
        interruption: Interruption = no_interruption,
    ) -> None:
        self.count = len(textures)
        self._config, self._device = config, device
        pyramids = [latent_levels(*texture.size, config) for texture in textures]
        repeats = [(texture.wrap[0] == "repeat", texture.wrap[1] == "repeat") for texture in textures]
        self._cells = PyramidTable.of(
            [[(lv.width, lv.height) for lv in levels] for levels in pyramids], repeats, device
        )
        self._texels = PyramidTable.of(
            [[(lv.texel_width, lv.texel_height) for lv in levels] for levels in pyramids], repeats, device
        )
        self.cell_counts = [sum(level.cells for level in levels) for levels in pyramids]
        self.texel_counts = [texture.size[0] * texture.size[1] for texture in textures]
        first_cells = [sum(self.cell_counts[:number]) for number in range(len(textures))]
        self._tables = TexelTables(pyramids, [texture.wrap for texture in textures], first_cells, config, device)
        self._sizes = torch.stack([self._texels.width, self._texels.height], dim=-1)
        channels = config.output_channels
        rows, coded_rows = [], []
        for texture, levels in zip(textures, pyramids, strict=True):
            interruption()
            columns = list(channel_places(texture.maps, texture.channels, config.maps, channels))
            for mip in mip_chain(texture.pixels, texture.color_space, texture.maps)[: len(levels)]:
                coded_rows.append(_in_places(mip, columns, channels))
                if config.levels != 1:
                    linear = hardware_filtered(mip, texture.color_space, texture.maps)
                    rows.append(_in_places(linear, columns, channels).astype(np.float16))
        # Half precision: an error of at most a tenth of an 8-bit sRGB step, for half the memory and bandwidth.
        self._linear = torch.from_numpy(np.concatenate(rows)).to(device) if rows else None
        self._coded = torch.from_numpy(np.concatenate(coded_rows)).to(device)
        map_weights, coded = np.zeros((len(textures), channels), np.float32), np.zeros((len(textures), channels), bool)
        for number, texture in enumerate(textures):
            columns = list(channel_places(texture.maps, texture.channels, config.maps, channels))
            map_weights[number, columns] = np.sqrt(texture.map_weights.of_channels(texture.maps, texture.channels))
            coded[number, columns] = srgb_channels(texture.maps, texture.channels, texture.color_space)
        self.channel_mask = torch.from_numpy(map_weights).to(device)
        """[T, output_channels]: the square root of the weight of a channel's squared error; 0 for channels that a texture lacks."""
        self._srgb_coded = torch.from_numpy(coded).to(device)
        weights = torch.clamp(
            LEVEL_FALL ** -torch.arange(self._cells.width.shape[1], dtype=torch.float32), min=SMALLEST_LEVEL_WEIGHT
        )
        available = torch.arange(self._cells.width.shape[1])[None, :] < self._cells.levels.cpu()[:, None]
        shares = weights[None, :] * available
        self._level_cumulative = torch.cumsum(shares / shares.sum(dim=1, keepdim=True), dim=1).to(device)

    def sample(self, per_texture: int, generator: torch.Generator, chosen: Tensor) -> tuple[Samples, ...]:
        """Return `per_texture` random samples of each texture in `chosen` [T] int64, in one part or two.

        One part lies at texel centres of a mip. The other lies anywhere, between mips too; its targets are filtered trilinearly in
        linear light, as hardware does.
        """
        # With one level, all samples are texels of mip 0, as in the paper.
        centres = per_texture if self._config.levels == 1 else round(CENTRE_SHARE * per_texture)
        parts = [self._at_centres(centres, generator, chosen)] if centres else []
        if centres < per_texture:
            parts.append(self._anywhere(per_texture - centres, generator, chosen))
        return tuple(parts)

    def _levels(self, random: Tensor, chosen: Tensor) -> Tensor:
        """Return [T, N] int64 levels for `random` [T, N] in [0, 1)."""
        level = torch.searchsorted(self._level_cumulative[chosen], random.contiguous())
        return torch.minimum(level, (self._cells.levels[chosen] - 1)[:, None])

    def _random(self, count: int, numbers: int, generator: torch.Generator, chosen: Tensor) -> Tensor:
        # Numbers for all textures: what the others get does not depend on which have converged.
        return torch.rand(numbers, self.count, count, generator=generator).to(self._device)[:, chosen]

    def _at_centres(self, count: int, generator: torch.Generator, chosen: Tensor) -> Samples:
        texture = chosen[:, None].expand(len(chosen), count).reshape(-1)
        if self._config.levels == 1:
            u, v = self._random(count, 2, generator, chosen)
            level = torch.zeros_like(texture)
        else:
            u, v, which = self._random(count, 3, generator, chosen)
            level = self._levels(which, chosen).reshape(-1)
        size = self._sizes[texture, level]
        texel = (torch.stack([u.reshape(-1), v.reshape(-1)], dim=-1) * size).long()
        # A random number just below 1, times a large size, may round up to the size.
        texel = torch.minimum(texel, size - 1)
        row = self._texels.first[texture, level] + texel[:, 1] * size[:, 0] + texel[:, 0]
        inputs = self._tables.at(texture, level, texel)
        lod = level.to(u.dtype)
        return Samples(
            uv=(texel + 0.5) / size,
            lod=lod,
            index=inputs.index,
            weights=inputs.weights,
            known=with_lod(inputs.waves, lod, self._config),
            targets=self._coded.index_select(0, row).float().div_(255.0),
        )

    def _anywhere(self, count: int, generator: torch.Generator, chosen: Tensor) -> Samples:
        texture = chosen[:, None].expand(len(chosen), count).reshape(-1)
        u, v, which, between = self._random(count, 4, generator, chosen)
        last = (self._cells.levels[chosen] - 1)[:, None].to(u.dtype)
        lod = torch.minimum(self._levels(which, chosen) + between, last).reshape(-1)
        uv = torch.stack([u.reshape(-1), v.reshape(-1)], dim=-1)
        index, weights = trilinear_corners(self._cells, texture, uv, lod)
        waves = positional_encoding(self._texels, texture, uv, lod, self._config.positional_octaves)
        targets = self._filtered(texture, uv, lod)
        return Samples(uv, lod, index, weights, with_lod(waves, lod, self._config), targets)

    def _filtered(self, texture: Tensor, uv: Tensor, lod: Tensor) -> Tensor:
        if self._linear is None:
            raise ValueError("a codec of one level has no texels between levels")
        index, weights = trilinear_corners(self._texels, texture, uv, lod)
        texels = self._linear.index_select(0, index.reshape(-1)).float().view(*index.shape, -1)
        blended = torch.bmm(weights.unsqueeze(1), texels).squeeze(1)
        srgb = torch.where(
            blended <= 0.0031308, blended * 12.92, 1.055 * blended.clamp(min=1e-6) ** (1.0 / 2.4) - 0.055
        )
        return torch.where(self._srgb_coded[texture], srgb, blended)
