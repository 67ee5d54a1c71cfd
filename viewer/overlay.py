"""Overlays as pictures: decoders per block, and error against the reference."""

import numpy as np
from numpy.typing import NDArray

OVERLAY_OPACITY = 0.6
ERROR_AMPLIFICATION = 8.0


def heat_colors(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """[..., 3] sRGB in [0, 1]: green at 0, yellow at 0.5, red at 1 (the paper's Fig. 1 colours)."""
    clipped = np.clip(values, 0.0, 1.0)
    return np.stack([np.minimum(1.0, 2.0 * clipped), np.minimum(1.0, 2.0 - 2.0 * clipped), np.zeros_like(clipped)], -1)


def divergence_overlay(
    color: NDArray[np.uint8], divergence: NDArray[np.uint16], block: tuple[int, int] = (8, 8)
) -> NDArray[np.uint8]:
    """[H, W, 3] uint8: `color` under a heatmap from green (one decoder) to red (the most in this picture).

    `divergence` is [ceil(H / block height), ceil(W / block width)]; blocks that decode nothing stay as they are.
    """
    height, width = color.shape[:2]
    per_pixel = np.repeat(np.repeat(divergence, block[0], axis=0), block[1], axis=1)[:height, :width]
    top = max(2, int(divergence.max(initial=0)))
    heat = heat_colors((per_pixel.astype(np.float64) - 1.0) / (top - 1)) * 255.0
    opacity = np.where(per_pixel > 0, OVERLAY_OPACITY, 0.0)[..., None]
    return np.rint(color * (1.0 - opacity) + heat * opacity).astype(np.uint8)


def error_overlay(color: NDArray[np.uint8], reference: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """[H, W, 3] uint8: absolute difference of 8-bit sRGB values, amplified 8 times, black where equal."""
    difference = np.abs(color.astype(np.int16) - reference.astype(np.int16)) * ERROR_AMPLIFICATION
    return np.minimum(difference, 255).astype(np.uint8)
