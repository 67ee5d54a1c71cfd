"""Latents as 8-bit integers with a scale and an offset per channel."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

LARGEST_STORED = 255
"""Stored integers run from 0 to 255."""


@dataclass(frozen=True, eq=False)
class QuantizedLatents:
    """value = offset + scale * stored."""

    stored: NDArray[np.uint8]
    """[cells, channels] uint8."""
    scale: NDArray[np.float32]
    """[channels] float32, positive."""
    offset: NDArray[np.float32]
    """[channels] float32."""

    def values(self) -> NDArray[np.float64]:
        """[cells, channels] float64: the values that the stored integers stand for."""
        return self.offset.astype(np.float64) + self.scale.astype(np.float64) * self.stored


def quantize_latents(
    values: NDArray[np.float32], low: NDArray[np.float32], high: NDArray[np.float32]
) -> QuantizedLatents:
    """Round `values` [cells, channels] to 256 steps from `low` to `high` [channels]; values beyond are clamped.

    Raises ValueError for values that are not finite.
    """
    if not (np.isfinite(values).all() and np.isfinite(low).all() and np.isfinite(high).all()):
        raise ValueError("latents are not finite")
    scale = (np.maximum(high - low, np.float32(1e-6)) / np.float32(LARGEST_STORED)).astype(np.float32)
    stored = np.clip(np.rint((values - low) / scale), 0, LARGEST_STORED).astype(np.uint8)
    return QuantizedLatents(stored, scale, low.astype(np.float32))
