"""What decoding at texel centres needs, worked out once for every row and column of every mip.

At the centre of texel (x, y) the cells around it along u, their weights and the positional encoding of u depend on x alone, and
along v on y alone. Training looks them up instead of working them out for each sample. Tests compare with `ntc.codec.torch_codec`.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import torch
from torch import Tensor

from ntc.codec.config import CodecConfig, WrapMode
from ntc.codec.latents import LatentLevel


def _axis(cells: int, texels: int, repeats: bool, octaves: int) -> tuple[Tensor, Tensor]:
    """Neighbouring cells [texels, 2] int64, and [texels, 2 + 2 octaves] float32: their weights, then triangle waves."""
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
    """What is known of N texel centres without looking at latents."""

    index: Tensor
    """[N, 4] int64 cells."""
    weights: Tensor
    """[N, 4]."""
    waves: Tensor
    """[N, 4 octaves] positional encoding."""


class TexelTables:
    """Tables of all rows and columns of the levels of some textures."""

    def __init__(
        self,
        pyramids: Sequence[Sequence[LatentLevel]],
        wraps: Sequence[tuple[WrapMode, WrapMode]],
        first_cells: Sequence[int],
        config: CodecConfig,
        device: torch.device,
    ) -> None:
        most = max(len(levels) for levels in pyramids)
        cells, numbers, first = [], [], torch.zeros(len(pyramids), most, 2, dtype=torch.int64)
        made: dict[tuple[int, int, bool], tuple[Tensor, Tensor]] = {}
        position = 0
        for texture, (levels, wrap, first_cell) in enumerate(zip(pyramids, wraps, first_cells, strict=True)):
            for number, level in enumerate(levels):
                sizes = ((level.width, level.texel_width), (level.height, level.texel_height))
                for axis, (count, texels) in enumerate(sizes):
                    key = (count, texels, wrap[axis] == "repeat")
                    if key not in made:
                        made[key] = _axis(*key, config.positional_octaves)
                    cell, values = made[key]
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
        """Features at texel (column, row) `texel` [N, 2] int64 of `level` [N] int64 of `texture` [N] int64."""
        place = self._first[texture, level] + texel
        (column, u), (row, v) = (
            (self._cells.index_select(0, at), self._numbers.index_select(0, at)) for at in place.t().contiguous()
        )
        index = (row[:, :, None] + column[:, None, :]).flatten(1)
        weights = (v[:, :2, None] * u[:, None, :2]).flatten(1)
        return CentreFeatures(index, weights, torch.cat([u[:, 2:], v[:, 2:]], dim=1))
