"""Decoding with torch, as every codec does it: bilinear and trilinear lookups in flat pyramids, and pieces of a texture at a time."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from ntc.codec.config import WrapMode
from ntc.codec.latents import texture_levels
from ntc.codec.model import Pack
from ntc.codec.sampling import texel_centres


@dataclass(frozen=True, eq=False)
class PyramidTable:
    """The layout of the levels of many textures in one flat array. All tensors are int64 on one device."""

    width: Tensor
    """[T, L] cells (or texels) along u; levels that a texture lacks repeat its last."""
    height: Tensor
    """[T, L] cells (or texels) along v."""
    first: Tensor
    """[T, L] index of the level's first element in the flat array."""
    levels: Tensor
    """[T] levels that the texture has."""
    repeats: Tensor
    """[T, 2] bool: whether neighbours beyond the edge come from the other side, along u and v."""

    @classmethod
    def of(
        cls, levels: Sequence[Sequence[tuple[int, int]]], repeats: Sequence[tuple[bool, bool]], device: torch.device
    ) -> "PyramidTable":
        """Table for textures whose levels have these (width, height), laid out one after the other."""
        most = max(len(sizes) for sizes in levels)
        width, height, first, position = [], [], [], 0
        for sizes in levels:
            starts = []
            for w, h in sizes:
                starts.append(position)
                position += w * h
            fill = most - len(sizes)
            width.append([w for w, _ in sizes] + [sizes[-1][0]] * fill)
            height.append([h for _, h in sizes] + [sizes[-1][1]] * fill)
            first.append(starts + [starts[-1]] * fill)

        def tensor(values: object) -> Tensor:
            return torch.tensor(values, dtype=torch.int64, device=device)

        counts = tensor([len(sizes) for sizes in levels])
        return cls(tensor(width), tensor(height), tensor(first), counts, torch.tensor(list(repeats), device=device))


def _neighbour(cell: Tensor, cells: Tensor, repeats: Tensor) -> Tensor:
    return torch.where(repeats, torch.remainder(cell, cells), torch.minimum(cell.clamp(min=0), cells - 1))


def bilinear_corners(table: PyramidTable, texture: Tensor, level: Tensor, uv: Tensor) -> tuple[Tensor, Tensor]:
    """Return the indices [N, 4] int64 into the flat array and weights [N, 4] for `uv` [N, 2] in [0, 1] of `texture` [N] at `level`
    [N]."""
    width, height = table.width[texture, level], table.height[texture, level]
    x, y = uv[:, 0] * width - 0.5, uv[:, 1] * height - 0.5
    left, top = torch.floor(x), torch.floor(y)
    fraction_x, fraction_y = x - left, y - top
    repeats = table.repeats[texture]
    column, row = left.long(), top.long()
    columns = [_neighbour(column + step, width, repeats[:, 0]) for step in (0, 1)]
    rows = [_neighbour(row + step, height, repeats[:, 1]) * width + table.first[texture, level] for step in (0, 1)]
    index = torch.stack(
        [rows[0] + columns[0], rows[0] + columns[1], rows[1] + columns[0], rows[1] + columns[1]], dim=-1
    )
    x_weights, y_weights = (1.0 - fraction_x, fraction_x), (1.0 - fraction_y, fraction_y)
    weights = torch.stack([x_weights[i] * y_weights[j] for j in (0, 1) for i in (0, 1)], dim=-1)
    return index, weights


def trilinear_corners(table: PyramidTable, texture: Tensor, uv: Tensor, lod: Tensor) -> tuple[Tensor, Tensor]:
    """Return the indices [N, 8] and weights [N, 8] that blend the two levels around `lod` [N], which lies in the texture's range."""
    lower = torch.floor(lod).long()
    upper = torch.minimum(lower + 1, table.levels[texture] - 1)
    share = (lod - lower)[:, None]
    index_lower, weights_lower = bilinear_corners(table, texture, lower, uv)
    index_upper, weights_upper = bilinear_corners(table, texture, upper, uv)
    weights = torch.cat([weights_lower * (1.0 - share), weights_upper * share], dim=-1)
    return torch.cat([index_lower, index_upper], dim=-1), weights


def weighted_rows(rows: Tensor, index: Tensor, weights: Tensor) -> Tensor:
    """Return [N, C]: sum over k of `rows` [R, C] at `index` [N, k], times `weights` [N, k]."""
    return torch.nn.functional.embedding_bag(index, rows, per_sample_weights=weights, mode="sum")


def wrapped_coordinate(coordinate: Tensor, mode: WrapMode) -> Tensor:
    """Return `coordinate` [N] wrapped into [0, 1]."""
    if mode == "repeat":
        return coordinate - torch.floor(coordinate)
    if mode == "clamp":
        return coordinate.clamp(0.0, 1.0)
    # Distance to the nearest even number: exact in fp32, where folding [0, 2) is not for small negative coordinates.
    return torch.abs(coordinate - 2.0 * torch.round(coordinate / 2.0))


def finite_places(
    uv: NDArray[Any], lod: NDArray[Any], wrap: tuple[WrapMode, WrapMode], device: torch.device
) -> tuple[Tensor, Tensor]:
    """Return `uv` [N, 2] wrapped into [0, 1] and `lod` [N], float32; what is not finite counts as 0."""
    at, level = (
        torch.from_numpy(np.nan_to_num(np.asarray(part, np.float32), posinf=0.0, neginf=0.0)).to(device)
        for part in (uv, lod)
    )
    return torch.stack([wrapped_coordinate(at[:, axis], wrap[axis]) for axis in range(2)], dim=-1), level


class TorchTexels(ABC):
    """Decodes the textures of one pack on one torch device."""

    texels_at_once: ClassVar[int]
    """Texels decoded together, to bound memory."""

    def __init__(self, pack: Pack, device: str | torch.device, interruption: Callable[[], None]) -> None:
        """`interruption` is called before each piece of an image; what it raises ends the decode."""
        self._pack = pack
        self._interruption = interruption
        self._device = torch.device(device)

    @abstractmethod
    def _decode_of(
        self, texture_index: int, wrap: tuple[WrapMode, WrapMode]
    ) -> Callable[[Tensor, Tensor, Tensor], Tensor]:
        """Return what decodes a piece of a texture: [N, output channels], not clamped, of N zeros int64 (the number of the texture in
        a table of one), `uv` [N, 2] in [0, 1] and `lod` [N] from 0 to its last level."""

    @torch.no_grad()
    def texels(self, texture_index: int, at: Tensor, lod: Tensor, wrap: tuple[WrapMode, WrapMode]) -> Tensor:
        """Return [N, channels] float32 in [0, 1] at `at` [N, 2], wrapped into [0, 1], and finite `lod` [N], all on the codec's device.

        Positions may be float64: they are used as they are, all else is float32.
        """
        texture = self._pack.textures[texture_index]
        decode, places = self._decode_of(texture_index, wrap), texture.places(self._pack.config)
        parts = [torch.zeros((0, texture.channels), device=self._device)]
        lod = lod.clamp(0.0, len(texture_levels(texture, self._pack.config)) - 1.0)
        for uv, level in zip(torch.split(at, self.texels_at_once), torch.split(lod, self.texels_at_once), strict=True):
            if not len(uv):
                continue
            self._interruption()
            same = torch.zeros(len(level), dtype=torch.int64, device=self._device)
            parts.append(decode(same, uv, level).float().clamp(0.0, 1.0)[:, places])
        return torch.cat(parts)

    def decode_texels(
        self,
        texture_index: int,
        uv: NDArray[Any],
        lod: NDArray[Any],
        wrap: tuple[WrapMode, WrapMode] | None = None,
    ) -> NDArray[np.float32]:
        """Return [N, channels] float32 in [0, 1] at `uv` [N, 2] and `lod` [N]; the float32 twin of
        `ntc.codec.reference.decode_texels`."""
        modes = self._pack.textures[texture_index].wrap if wrap is None else wrap
        decoded = self.texels(texture_index, *finite_places(uv, lod, modes, self._device), modes)
        return np.asarray(decoded.cpu().numpy(), np.float32)

    def mip(self, texture_index: int, level: int = 0) -> Tensor:
        """Return [h, w, channels] float32 in [0, 1] on the codec's device: mip `level`, decoded at its texel centres."""
        texture = self._pack.textures[texture_index]
        size = texture_levels(texture, self._pack.config)[level]
        at = torch.from_numpy(texel_centres(size.texel_width, size.texel_height)).to(self._device)
        texels = self.texels(texture_index, at, torch.full((len(at),), float(level), device=self._device), texture.wrap)
        return texels.reshape(size.texel_height, size.texel_width, texture.channels)

    @abstractmethod
    def decode_image(self, texture_index: int, level: int = 0) -> NDArray[np.uint8]:
        """Return [h, w, channels] uint8 in the texture's colour space: mip `level`, decoded at its texel centres."""
