"""Decoding texels of a pack with torch, piece by piece: what both codecs share."""

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Any, ClassVar

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from ntc.codec.config import WrapMode
from ntc.codec.latents import latent_levels
from ntc.codec.model import Pack
from ntc.codec.torch_sampling import finite_places


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
        """What decodes a piece of a texture: [N, output channels], not clamped, of N zeros int64 (the number of the texture
        in a table of one), `uv` [N, 2] in [0, 1] and `lod` [N] from 0 to its last level."""

    @torch.no_grad()
    def texels(self, texture_index: int, at: Tensor, lod: Tensor, wrap: tuple[WrapMode, WrapMode]) -> Tensor:
        """[N, channels] float32 in [0, 1] at `at` [N, 2], wrapped into [0, 1], and finite `lod` [N], all on the codec's device.

        Positions may be float64: they are used as they are, all else is float32.
        """
        texture = self._pack.textures[texture_index]
        decode, places = self._decode_of(texture_index, wrap), texture.places(self._pack.config)
        parts = [torch.zeros((0, texture.channels), device=self._device)]
        lod = lod.clamp(0.0, len(latent_levels(texture.width, texture.height, self._pack.config)) - 1.0)
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
        """[N, channels] float32 in [0, 1] at `uv` [N, 2] and `lod` [N]; the float32 twin of `ntc.codec.reference.decode_texels`."""
        modes = self._pack.textures[texture_index].wrap if wrap is None else wrap
        decoded = self.texels(texture_index, *finite_places(uv, lod, modes, self._device), modes)
        return np.asarray(decoded.cpu().numpy(), np.float32)

    @abstractmethod
    def decode_image(self, texture_index: int, level: int = 0) -> NDArray[np.uint8]:
        """[h, w, channels] uint8 in the texture's colour space: mip `level`, decoded at its texel centres."""
