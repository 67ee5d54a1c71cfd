"""Low-level features: colour statistics, and how much detail a texture has at each scale."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ntc.mips import mip_chain
from ntc.textures import SourceTexture

LARGEST_SIDE = 256
"""Texels: features are taken from the first mip that is no larger."""
SCALES = 4


def _first_small_mip(texture: SourceTexture) -> list[NDArray[np.float64]]:
    chain = mip_chain(texture.pixels, texture.color_space)
    small = [mip for mip in chain if max(mip.shape[:2]) <= LARGEST_SIDE]
    return [mip[..., : min(3, mip.shape[2])].astype(np.float64) / 255.0 for mip in small]


def _as_rgb(mip: NDArray[np.float64]) -> NDArray[np.float64]:
    return mip if mip.shape[2] == 3 else np.repeat(mip[..., :1], 3, axis=2)


def low_level_features(texture: SourceTexture) -> NDArray[np.float64]:
    """[9 + 2 * 4] float64: mean, deviation and skew of luma and two colour differences (sRGB-coded values), then the
    root mean square of horizontal and of vertical differences at four scales, finest first."""
    mips = _first_small_mip(texture)
    rgb = _as_rgb(mips[0])
    luma = rgb @ np.array([0.299, 0.587, 0.114])
    planes = np.stack([luma, rgb[..., 0] - luma, rgb[..., 2] - luma], axis=-1).reshape(-1, 3)
    mean, deviation = planes.mean(axis=0), planes.std(axis=0)
    skew = np.cbrt(((planes - mean) ** 3).mean(axis=0))
    detail: list[float] = []
    for scale in range(SCALES):
        plane = _as_rgb(mips[min(scale, len(mips) - 1)]) @ np.array([0.299, 0.587, 0.114])
        for axis in (0, 1):
            difference = np.roll(plane, -1, axis=axis) - plane
            detail.append(float(np.sqrt(np.mean(difference**2))))
    return np.concatenate([mean, deviation, skew, np.array(detail)])


def feature_matrix(textures: Sequence[SourceTexture]) -> NDArray[np.float64]:
    """[textures, features] float64, each column standardised to mean 0 and deviation 1 (0 where it is constant)."""
    matrix = np.stack([low_level_features(texture) for texture in textures])
    deviation = matrix.std(axis=0)
    return (matrix - matrix.mean(axis=0)) / np.where(deviation > 1e-12, deviation, 1.0)
