"""Latents as small integers with a scale and an offset per channel."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class QuantizedLatents:
    """value = offset + scale * stored."""

    stored: NDArray[np.uint8]
    """[cells, channels] uint8, one integer a byte whatever its bits."""
    scale: NDArray[np.float32]
    """[channels] float32, positive."""
    offset: NDArray[np.float32]
    """[channels] float32."""

    def values(self) -> NDArray[np.float64]:
        """[cells, channels] float64: the values that the stored integers stand for."""
        return self.offset.astype(np.float64) + self.scale.astype(np.float64) * self.stored


def quantize_latents(
    values: NDArray[np.float32], low: NDArray[np.float32], high: NDArray[np.float32], largest: int
) -> QuantizedLatents:
    """Round `values` [cells, channels] to the integers 0 to `largest`, which stand for `low` to `high` [channels]; values
    beyond are clamped.

    Raises ValueError for values that are not finite.
    """
    if not (np.isfinite(values).all() and np.isfinite(low).all() and np.isfinite(high).all()):
        raise ValueError("latents are not finite")
    scale = (np.maximum(high - low, np.float32(1e-6)) / np.float32(largest)).astype(np.float32)
    stored = np.clip(np.rint((values - low) / scale), 0, largest).astype(np.uint8)
    return QuantizedLatents(stored, scale, low.astype(np.float32))


def packed_cells(stored: NDArray[np.uint8], bits: int) -> NDArray[np.uint8]:
    """[cells, channels * bits / 8] uint8: `stored` [cells, channels] as it lies in files, for 4 bits two integers a byte, the
    first in the low half."""
    if bits == 8:
        return np.ascontiguousarray(stored)
    return np.ascontiguousarray(stored[:, 0::2] | (stored[:, 1::2] << 4))


def unpacked_cells(packed: NDArray[np.uint8], bits: int) -> NDArray[np.uint8]:
    """[cells, channels] uint8, one integer a byte: the inverse of `packed_cells`."""
    if bits == 8:
        return packed
    return np.stack([packed & 15, packed >> 4], axis=-1).reshape(len(packed), -1)
