"""Decoding a pack of codec `two_colors` with torch, in float32."""

from collections.abc import Callable
from functools import cache
from typing import cast

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from ntc.codec.config import WrapMode
from ntc.codec.latents import texture_levels
from ntc.codec.model import Pack
from ntc.codec.torch_texels import PyramidTable, TorchTexels, trilinear_corners, weighted_rows
from tests.support.two_colors.model import PLANE_WORDS, TwoColorsConfig, TwoColorsTexture
from tests.support.two_colors.reference import image_of


class TorchTwoColors(TorchTexels):
    """Decodes the textures of one pack; the texels of a texture stay once it was decoded."""

    texels_at_once = 1 << 17

    def __init__(self, pack: Pack, device: str | torch.device, interruption: Callable[[], None]) -> None:
        super().__init__(pack, device, interruption)
        self._config = cast(TwoColorsConfig, pack.config)
        self._images = cache(self._decoded)

    def _decoded(self, texture_index: int) -> list[Tensor]:
        """[h, w, output channels] float32 of each mip."""
        texture = cast(TwoColorsTexture, self._pack.textures[texture_index])
        parts = torch.from_numpy(texture.blocks.copy()).to(self._device).view(len(texture.blocks), -1, 4 * PLANE_WORDS)
        indices = (parts[:, :, 8:, None] >> torch.tensor([0, 2, 4, 6], device=self._device)) & 3
        shares, colors = indices.flatten(2)[..., None] / 3.0, parts[:, :, :8].float() / 255.0
        values = torch.zeros(len(parts), shares.shape[2], self._config.output_channels, device=self._device)
        for place, channels in enumerate(self._config.planes.values()):
            both = torch.lerp(colors[:, place, None, :4], colors[:, place, None, 4:], shares[:, place])
            values[..., list(channels.values())] = both[..., list(channels)]
        levels = texture_levels(texture, self._config)
        return [image_of(values[each.first_cell : each.first_cell + each.cells], each) for each in levels]

    def _decode_of(
        self, texture_index: int, wrap: tuple[WrapMode, WrapMode]
    ) -> Callable[[Tensor, Tensor, Tensor], Tensor]:
        images = self._images(texture_index)
        sizes = [(image.shape[1], image.shape[0]) for image in images]
        table = PyramidTable.of([sizes], [(wrap[0] == "repeat", wrap[1] == "repeat")], self._device)
        rows = torch.cat([image.flatten(0, 1) for image in images])

        def decode(same: Tensor, uv: Tensor, lod: Tensor) -> Tensor:
            index, weights = trilinear_corners(table, same, uv, lod)
            return weighted_rows(rows, index, weights.float())

        return decode

    def decode_image(self, texture_index: int, level: int = 0) -> NDArray[np.uint8]:
        self._interruption()
        image = self._images(texture_index)[level][..., self._pack.textures[texture_index].places(self._config)]
        return np.asarray(np.rint(image.cpu().numpy() * 255.0), np.uint8)
