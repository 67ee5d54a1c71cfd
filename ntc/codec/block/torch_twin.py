"""The float64 reference of codec `block` as tensors of torch, float32. It computes in numpy, and imports torch for tensors alone."""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ntc.codec.config import WrapMode
from ntc.codec.model import Pack
from ntc.codec.reference import decode_image, decode_mip, decode_texels


class TorchBlock:
    """Decodes the textures of one pack of codec `block` to tensors on one torch device."""

    def __init__(self, pack: Pack, device: str, interruption: Callable[[], None]) -> None:
        """`interruption` is called before each image; what it raises ends the decode."""
        self._pack, self._device, self._interruption = pack, device, interruption

    def _tensor(self, values: NDArray[np.float64]) -> Any:
        import torch

        return torch.from_numpy(values.astype(np.float32)).to(self._device)

    def texels(self, texture_index: int, at: Any, lod: Any, wrap: tuple[WrapMode, WrapMode]) -> Any:
        """Return [N, channels] float32 tensor in [0, 1] at `at` [N, 2] and `lod` [N], tensors."""
        self._interruption()
        return self._tensor(decode_texels(self._pack, texture_index, at.cpu().numpy(), lod.cpu().numpy(), wrap))

    def decode_texels(
        self,
        texture_index: int,
        uv: NDArray[Any],
        lod: NDArray[Any],
        wrap: tuple[WrapMode, WrapMode] | None = None,
    ) -> NDArray[np.float32]:
        """Return [N, channels] float32 in [0, 1] at `uv` [N, 2] and `lod` [N]."""
        return decode_texels(self._pack, texture_index, uv, lod, wrap).astype(np.float32)

    def mip(self, texture_index: int, level: int = 0) -> Any:
        """Return [h, w, channels] float32 tensor in [0, 1]: mip `level`."""
        self._interruption()
        return self._tensor(decode_mip(self._pack, texture_index, level))

    def decode_image(self, texture_index: int, level: int = 0) -> NDArray[np.uint8]:
        """Return [h, w, channels] uint8 in the texture's colour space: mip `level`."""
        self._interruption()
        return decode_image(self._pack, texture_index, level)
