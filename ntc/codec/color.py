"""sRGB transfer function (IEC 61966-2-1), in the directions that the codec and the renderer need."""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.floating]


def srgb_to_linear(srgb: Floats) -> Floats:
    """Linear light in [0, 1] of sRGB-coded values in [0, 1], any shape, in the precision of the input."""
    return np.where(srgb <= 0.04045, srgb / 12.92, ((np.maximum(srgb, 0.0) + 0.055) / 1.055) ** 2.4)


def linear_to_srgb(linear: Floats) -> Floats:
    """sRGB-coded values in [0, 1] of linear light in [0, 1], any shape, in the precision of the input."""
    return np.where(linear <= 0.0031308, linear * 12.92, 1.055 * np.maximum(linear, 0.0) ** (1.0 / 2.4) - 0.055)


def srgb8_to_linear_table() -> NDArray[np.float32]:
    """[256] float32: linear light of every 8-bit sRGB value."""
    return srgb_to_linear(np.arange(256, dtype=np.float64) / 255.0).astype(np.float32)


def linear_to_srgb8(linear: Floats) -> NDArray[np.uint8]:
    """8-bit sRGB of linear light, any shape; clamped to [0, 1], rounded to nearest; NaN counts as 0."""
    clipped = np.clip(np.nan_to_num(linear, nan=0.0, posinf=1.0, neginf=0.0), 0.0, 1.0)
    return np.rint(linear_to_srgb(clipped) * 255.0).astype(np.uint8)
