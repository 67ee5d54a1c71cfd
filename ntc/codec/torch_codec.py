"""Decoding a pack with torch, float32 (docs/codec.md)."""

from collections.abc import Callable

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
    positional_encoding,
    trilinear_corners,
    weighted_rows,
    with_lod,
)
from ntc.codec.torch_texels import TorchTexels


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


class TorchCodec(TorchTexels):
    """Decodes the textures of one pack on one torch device. What a texture needs stays there once it was decoded."""

    texels_at_once = 1 << 17

    def __init__(self, pack: Pack, device: str | torch.device, interruption: Callable[[], None] = lambda: None) -> None:
        """`interruption` is called before each piece of an image; what it raises ends the decode."""
        super().__init__(pack, device, interruption)
        self._decoders = DecoderStack(pack.grid_config, len(pack.decoders), torch.Generator().manual_seed(0))
        self._decoders.load(pack.grid_decoders)
        if pack.grid_config.adapter_output:
            self._decoders.clear_output()
        self._decoders.to(self._device)
        self._adapters = [self._adapter(texture) for texture in pack.textures]
        self._tables: dict[tuple[int, tuple[bool, bool]], tuple[PyramidTable, PyramidTable]] = {}
        self._latents: dict[int, tuple[Tensor, Tensor, Tensor]] = {}

    def _adapter(self, texture: EncodedTexture) -> AdapterStack | None:
        if texture.adapter is None:
            return None
        stack = AdapterStack(self._pack.grid_config, 1)
        stack.load([texture.adapter])
        return stack.to(self._device)

    def _tables_of(self, index: int, wrap: tuple[WrapMode, WrapMode]) -> tuple[PyramidTable, PyramidTable]:
        """Where cells and texels of all levels of a texture are."""
        repeats = (wrap[0] == "repeat", wrap[1] == "repeat")
        if (index, repeats) not in self._tables:
            texture = self._pack.textures[index]
            levels = latent_levels(texture.width, texture.height, self._pack.config)
            sizes = (
                [(level.width, level.height) for level in levels],
                [(level.texel_width, level.texel_height) for level in levels],
            )
            cells, texels = (PyramidTable.of([each], [repeats], self._device) for each in sizes)
            self._tables[index, repeats] = cells, texels
        return self._tables[index, repeats]

    def _latents_of(self, index: int) -> tuple[Tensor, Tensor, Tensor]:
        """[cells, channels] as stored, scale and offset [channels] of a texture."""
        if index not in self._latents:
            texture = self._pack.textures[index]
            latents, scale, offset = (
                torch.from_numpy(part.copy()).to(self._device)
                for part in (texture.latents, texture.scale, texture.offset)
            )
            self._latents[index] = latents, scale, offset
        return self._latents[index]

    def _decode_of(
        self, texture_index: int, wrap: tuple[WrapMode, WrapMode]
    ) -> Callable[[Tensor, Tensor, Tensor], Tensor]:
        texture, config = self._pack.textures[texture_index], self._pack.grid_config
        cells, texels = self._tables_of(texture_index, wrap)
        stored, scale, offset = self._latents_of(texture_index)
        group = torch.tensor([texture.group], device=self._device)

        def decode(same: Tensor, uv: Tensor, lod: Tensor) -> Tensor:
            index, weights = trilinear_corners(cells, same, uv, lod)
            latents = offset + scale * (stored[index] * weights[..., None].float()).sum(1)
            waves = positional_encoding(texels, same, uv, lod, config.positional_octaves).float()
            inputs = torch.cat([latents, with_lod(waves, lod.float(), config)], dim=-1)
            colors: Tensor = self._decoders(inputs[None], group, self._adapters[texture_index])[0]
            return colors

        return decode

    def decode_image(self, texture_index: int, level: int = 0) -> NDArray[np.uint8]:
        """[h, w, channels] uint8 in the texture's colour space: mip `level`, decoded at its texel centres."""
        return image_of_texels(self._pack, texture_index, level, self.decode_texels)
