"""Low-level features: colour statistics, and how much detail a texture has at each scale."""

import numpy as np
from numpy.typing import NDArray

from ntc.codec.textures import SourceTexture
from ntc.features.extractor import Extractor, one_by_one, standardised_columns
from ntc.features.pixels import LUMA, small_mips

SCALES = 4


def low_level_features(texture: SourceTexture) -> NDArray[np.float64]:
    """[9 + 2 * 4] float64: mean, deviation and skew of luma and two colour differences (sRGB-coded values), then the
    root mean square of horizontal and of vertical differences at four scales, finest first."""
    mips = small_mips(texture)
    rgb = mips[0]
    luma = rgb @ LUMA
    planes = np.stack([luma, rgb[..., 0] - luma, rgb[..., 2] - luma], axis=-1).reshape(-1, 3)
    mean, deviation = planes.mean(axis=0), planes.std(axis=0)
    centred = planes - mean
    # A power of 3 takes ten times as long.
    skew = np.cbrt((centred * centred * centred).mean(axis=0))
    detail: list[float] = []
    for scale in range(SCALES):
        plane = mips[min(scale, len(mips) - 1)] @ LUMA
        for axis in (0, 1):
            difference = np.roll(plane, -1, axis=axis) - plane
            detail.append(float(np.sqrt(np.mean(difference**2))))
    return np.concatenate([mean, deviation, skew, np.array(detail)])


def low_level_extractor() -> Extractor:
    """`low_level_features`, by name."""
    return Extractor("low_level", "1", 9 + 2 * SCALES, 1, standardised_columns, one_by_one(low_level_features))
