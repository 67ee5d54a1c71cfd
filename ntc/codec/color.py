"""sRGB transfer function (IEC 61966-2-1), and pixels of a colour space in linear light."""

import numpy as np
from numpy.typing import NDArray

from ntc.codec.config import ColorSpace

Floats = NDArray[np.floating]


def srgb_to_linear(srgb: Floats) -> Floats:
    """Linear light in [0, 1] of sRGB-coded values in [0, 1], any shape, in the precision of the input."""
    return np.where(srgb <= 0.04045, srgb / 12.92, ((np.maximum(srgb, 0.0) + 0.055) / 1.055) ** 2.4)


def linear_to_srgb(linear: Floats) -> Floats:
    """Return sRGB-coded values in [0, 1] of linear light in [0, 1], any shape, in the precision of the input."""
    return np.where(linear <= 0.0031308, linear * 12.92, 1.055 * np.maximum(linear, 0.0) ** (1.0 / 2.4) - 0.055)


def srgb8_to_linear_table() -> NDArray[np.float32]:
    """Return [256] float32: linear light of every 8-bit sRGB value."""
    return srgb_to_linear(np.arange(256, dtype=np.float64) / 255.0).astype(np.float32)


def linear_to_srgb8(linear: Floats) -> NDArray[np.uint8]:
    """Return 8-bit sRGB of linear light, any shape; clamped to [0, 1], rounded to nearest; NaN counts as 0."""
    clipped = np.clip(np.nan_to_num(linear, nan=0.0, posinf=1.0, neginf=0.0), 0.0, 1.0)
    return np.asarray(np.rint(linear_to_srgb(clipped) * 255.0), np.uint8)


def alpha_channel(channels: int) -> int | None:
    """Index of the alpha channel, which is never sRGB-coded: the last of two or of four; None without one."""
    return channels - 1 if channels in (2, 4) else None


def to_linear(pixels: NDArray[np.uint8], color_space: ColorSpace) -> NDArray[np.float32]:
    """Return [H, W, C] float32 linear light in [0, 1] of `pixels` [H, W, C] uint8."""
    if color_space == "linear":
        return pixels.astype(np.float32) / np.float32(255.0)
    linear = srgb8_to_linear_table()[pixels]
    alpha = alpha_channel(pixels.shape[2])
    if alpha is not None:
        linear[..., alpha] = pixels[..., alpha] / np.float32(255.0)
    return linear


def to_8bit(linear: NDArray[np.float32], color_space: ColorSpace) -> NDArray[np.uint8]:
    """Return [H, W, C] uint8 in `color_space` of `linear` [H, W, C] float32 linear light, clamped to [0, 1], rounded to nearest."""
    if color_space == "linear":
        return np.asarray(np.rint(np.clip(linear, 0.0, 1.0) * 255.0), np.uint8)
    coded = linear_to_srgb8(linear)
    alpha = alpha_channel(linear.shape[2])
    if alpha is not None:
        coded[..., alpha] = np.rint(np.clip(linear[..., alpha], 0.0, 1.0) * 255.0)
    return coded
