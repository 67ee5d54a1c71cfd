"""What decoders of codec `grid` read, in torch: blended latents, positional encoding, level of detail."""

import torch
from torch import Tensor

from ntc.codec.grid.config import LOD_INPUT_SCALE, GridConfig
from ntc.codec.torch_texels import PyramidTable, trilinear_corners, weighted_rows


def level_waves(table: PyramidTable, texture: Tensor, uv: Tensor, level: Tensor, octaves: int) -> Tensor:
    """[N, 4 octaves] triangle waves of the texel coordinate at whole `level` [N]. `table` holds texel sizes."""
    size = torch.stack([table.width[texture, level], table.height[texture, level]], dim=-1)
    texel = (uv * size)[:, :, None, None]
    octave = 2.0 ** -torch.arange(1, octaves + 1, device=uv.device, dtype=uv.dtype)[None, None, :, None]
    phase = torch.tensor([0.0, 0.25], device=uv.device, dtype=uv.dtype)[None, None, None, :]
    turns = texel * octave + phase
    return (4.0 * torch.abs(turns - torch.floor(turns) - 0.5) - 1.0).flatten(1)


def positional_encoding(table: PyramidTable, texture: Tensor, uv: Tensor, lod: Tensor, octaves: int) -> Tensor:
    """[N, 4 octaves] triangle waves, blended between the two levels around `lod` [N]."""
    lower = torch.floor(lod).long()
    upper = torch.minimum(lower + 1, table.levels[texture] - 1)
    share = (lod - lower)[:, None]
    waves = [level_waves(table, texture, uv, level, octaves) for level in (lower, upper)]
    return waves[0] * (1.0 - share) + waves[1] * share


def with_lod(waves: Tensor, lod: Tensor, config: GridConfig) -> Tensor:
    """[N, rest]: positional encoding `waves` and, where the codec has it, the lod input of `lod` [N]."""
    return torch.cat([waves, lod[:, None] * LOD_INPUT_SCALE], dim=-1) if config.lod_inputs else waves


def codec_features(
    config: GridConfig,
    latents: Tensor,
    cells: PyramidTable,
    texels: PyramidTable,
    texture: Tensor,
    uv: Tensor,
    lod: Tensor,
) -> tuple[Tensor, Tensor]:
    """Latents [N, latent_channels] and the other inputs of the decoder [N, rest] at wrapped `uv` [N, 2] in [0, 1] and clamped
    `lod` [N] of `texture` [N].

    `latents` [all cells, channels]; differentiable in them.
    """
    index, weights = trilinear_corners(cells, texture, uv, lod)
    waves = positional_encoding(texels, texture, uv, lod, config.positional_octaves)
    return weighted_rows(latents, index, weights), with_lod(waves, lod, config)
