"""Decoding a pack of codec `grid` with torch, in float32 (docs/reference/codecs.md)."""

from collections.abc import Callable

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from ntc.codec.config import WrapMode
from ntc.codec.grid.model import GridTexture, grid_parts
from ntc.codec.grid.stacks import AdapterStack, DecoderStack
from ntc.codec.grid.torch_inputs import positional_encoding, with_lod
from ntc.codec.latents import latent_levels
from ntc.codec.model import Pack
from ntc.codec.reference import image_of_texels
from ntc.codec.torch_texels import PyramidTable, TorchTexels, trilinear_corners


class TorchGrid(TorchTexels):
    """Decodes the textures of one pack on one torch device. What a texture needs stays there once it was decoded."""

    texels_at_once = 1 << 17

    def __init__(
        self,
        pack: Pack,
        device: str | torch.device,
        interruption: Callable[[], None] = lambda: None,
    ) -> None:
        """`interruption` is called before each piece of an image; what it raises ends the decode."""
        super().__init__(pack, device, interruption)
        own = grid_parts(pack)
        self._config, self._textures = own.config, own.textures
        self._decoders = DecoderStack(own.config, len(pack.decoders), torch.Generator().manual_seed(0))
        self._decoders.load(own.decoders)
        if own.config.adapter_output:
            self._decoders.clear_output()
        self._decoders.to(self._device)
        self._adapters = [self._adapter(texture) for texture in own.textures]
        self._tables: dict[tuple[int, tuple[bool, bool]], tuple[PyramidTable, PyramidTable]] = {}
        self._latents: dict[int, tuple[Tensor, Tensor, Tensor]] = {}

    def _adapter(self, texture: GridTexture) -> AdapterStack | None:
        if texture.adapter is None:
            return None
        stack = AdapterStack(self._config, 1)
        stack.load([texture.adapter])
        return stack.to(self._device)

    def _tables_of(self, index: int, wrap: tuple[WrapMode, WrapMode]) -> tuple[PyramidTable, PyramidTable]:
        """Where cells and texels of all levels of a texture are."""
        repeats = (wrap[0] == "repeat", wrap[1] == "repeat")
        if (index, repeats) not in self._tables:
            texture = self._textures[index]
            levels = latent_levels(texture.width, texture.height, self._config)
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
            texture = self._textures[index]
            latents, scale, offset = (
                torch.from_numpy(part.copy()).to(self._device)
                for part in (texture.latents, texture.scale, texture.offset)
            )
            self._latents[index] = latents, scale, offset
        return self._latents[index]

    def _decode_of(
        self, texture_index: int, wrap: tuple[WrapMode, WrapMode]
    ) -> Callable[[Tensor, Tensor, Tensor], Tensor]:
        texture, config = self._textures[texture_index], self._config
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
