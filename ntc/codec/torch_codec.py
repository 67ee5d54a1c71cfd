"""Decoding a pack with torch, float32 (docs/codec.md)."""

from collections.abc import Callable
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from ntc.codec.config import CodecConfig, WrapMode
from ntc.codec.decoder import AdapterStack, DecoderStack
from ntc.codec.latents import latent_levels
from ntc.codec.model import EncodedTexture, Pack
from ntc.codec.reference import image_of_texels
from ntc.codec.torch_sampling import (
    PyramidTable,
    finite_places,
    positional_encoding,
    trilinear_corners,
    weighted_rows,
    with_lod,
)

TEXELS_AT_ONCE = 1 << 17
"""Texels decoded together, to bound memory."""


def codec_features(
    config: CodecConfig,
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


class TorchCodec:
    """Decodes the textures of one pack on one torch device."""

    def __init__(self, pack: Pack, device: str | torch.device, interruption: Callable[[], None] = lambda: None) -> None:
        """`interruption` is called before each piece of an image; what it raises ends the decode."""
        self._pack = pack
        self._interruption = interruption
        self._device = torch.device(device)
        self._decoders = DecoderStack(pack.grid_config, len(pack.decoders), torch.Generator().manual_seed(0))
        self._decoders.load(pack.grid_decoders)
        if pack.grid_config.adapter_output:
            self._decoders.clear_output()
        self._decoders.to(self._device)
        self._adapters = [self._adapter(texture) for texture in pack.textures]

    def _adapter(self, texture: EncodedTexture) -> AdapterStack | None:
        if texture.adapter is None:
            return None
        stack = AdapterStack(self._pack.grid_config, 1)
        stack.load([texture.adapter])
        return stack.to(self._device)

    def _tables(self, index: int, wrap: tuple[WrapMode, WrapMode]) -> tuple[PyramidTable, PyramidTable]:
        texture = self._pack.textures[index]
        levels = latent_levels(texture.width, texture.height, self._pack.config)
        repeats = [(wrap[0] == "repeat", wrap[1] == "repeat")]
        cells = PyramidTable.of([[(level.width, level.height) for level in levels]], repeats, self._device)
        texels = PyramidTable.of([[(level.texel_width, level.texel_height) for level in levels]], repeats, self._device)
        return cells, texels

    @torch.no_grad()
    def decode_texels(
        self,
        texture_index: int,
        uv: NDArray[Any],
        lod: NDArray[Any],
        wrap: tuple[WrapMode, WrapMode] | None = None,
    ) -> NDArray[np.float32]:
        """[N, channels] float32 in [0, 1] at `uv` [N, 2] and `lod` [N]; the float32 twin of `ntc.codec.reference.decode_texels`."""
        texture = self._pack.textures[texture_index]
        modes = texture.wrap if wrap is None else wrap
        cells, texels = self._tables(texture_index, modes)
        scale, offset = torch.from_numpy(texture.scale.copy()), torch.from_numpy(texture.offset.copy())
        latents = (offset + scale * torch.from_numpy(texture.latents.copy())).to(self._device)
        group = torch.tensor([texture.group], device=self._device)
        last = float(cells.levels[0] - 1)
        parts = []
        for start in range(0, len(uv), TEXELS_AT_ONCE):
            self._interruption()
            part = slice(start, start + TEXELS_AT_ONCE)
            wrapped, level = finite_places(uv[part], lod[part], modes, self._device)
            same = torch.zeros(len(level), dtype=torch.int64, device=self._device)
            features = codec_features(
                self._pack.grid_config, latents, cells, texels, same, wrapped, level.clamp(0.0, last)
            )
            decoded = self._decoders(torch.cat(features, dim=-1)[None], group, self._adapters[texture_index])[0]
            parts.append(decoded.clamp(0.0, 1.0)[:, texture.places(self._pack.config)].cpu().numpy())
        return np.concatenate(parts) if parts else np.zeros((0, texture.channels), np.float32)

    def decode_image(self, texture_index: int, level: int = 0) -> NDArray[np.uint8]:
        """[h, w, channels] uint8 in the texture's colour space: mip `level`, decoded at its texel centres."""
        return image_of_texels(self._pack, texture_index, level, self.decode_texels)
