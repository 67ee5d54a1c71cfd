"""Features `low_level` and `spectral`: statistics of pixels, without a network."""

import numpy as np
from numpy.typing import NDArray

from ntc.codec.textures import SourceTexture
from ntc.features.extractor import Extractor, one_by_one, standardised_columns
from ntc.features.pixels import LUMA, small_mips

SCALES = 4
"""Mips whose gradients count."""


def low_level_features(texture: SourceTexture) -> NDArray[np.float64]:
    """Return features `low_level` of `texture`, [17] float64.

    They are mean, deviation and skew of luma and two colour differences (coded values), then the root mean square of vertical and of
    horizontal differences at four scales, finest first.
    """
    mips = small_mips(texture)
    rgb = mips[0]
    luma = rgb @ LUMA
    planes = np.stack([luma, rgb[..., 0] - luma, rgb[..., 2] - luma], axis=-1).reshape(-1, 3)
    mean, deviation = planes.mean(axis=0), planes.std(axis=0)
    centred = planes - mean
    # A product: numpy's power of 3 takes ten times as long.
    skew = np.cbrt((centred * centred * centred).mean(axis=0))
    detail: list[float] = []
    for scale in range(SCALES):
        plane = mips[min(scale, len(mips) - 1)] @ LUMA
        for axis in (0, 1):
            difference = np.roll(plane, -1, axis=axis) - plane
            detail.append(float(np.sqrt(np.mean(difference**2))))
    return np.concatenate([mean, deviation, skew, np.array(detail)])


def low_level_extractor() -> Extractor:
    """Return the extractor of features `low_level`."""
    return Extractor("low_level", "1", 9 + 2 * SCALES, 1, standardised_columns, one_by_one(low_level_features))


OCTAVES = 8
EDGE_SCALES = 3
EDGE_THRESHOLD = 0.05
"""Change of coded luma per texel from which a gradient counts as an edge."""
DIRECTIONS = 8
LENGTH = 3 + 3 + 6 + OCTAVES + EDGE_SCALES + DIRECTIONS

_ENERGY_FLOOR = 1e-6
"""Variance of luma that counts as none: about that of rounding to 8 bits."""


def color_features(rgb: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return [12] float64 of `rgb` [H, W, 3] in [0, 1]: means, cube roots of third moments, covariances rr rg rb gg gb bb.

    Values are coded (sRGB for sRGB textures), as decoders write them. Covariances appear as signed square roots, so that every number
    has the unit of a deviation.
    """
    values = rgb.reshape(-1, 3)
    mean = values.mean(axis=0)
    centred = values - mean
    covariance = (centred.T @ centred / len(values))[np.triu_indices(3)]
    return np.concatenate([mean, np.cbrt((centred**3).mean(axis=0)), np.sign(covariance) * np.sqrt(np.abs(covariance))])


def _window(size: int) -> NDArray[np.float64]:
    """Return [size] Hann window, symmetric and never zero."""
    return np.sin(np.pi * (np.arange(size) + 0.5) / size) ** 2


def radial_spectrum(luma: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return [8] float64: log10 of the variance of `luma` [H, W] in each octave of frequency, finest first.

    The first octave begins at 1/2 cycle per texel (diagonals only), the next at 1/4, and so on. The last one holds all periods above
    128 texels. The mean is removed. A Hann window hides borders that do not tile. The bins sum to the variance under the window, so
    images of different sizes compare.
    """
    height, width = luma.shape
    window = np.outer(_window(height), _window(width))
    centred = (luma - np.sum(luma * window) / np.sum(window)) * window
    energy = np.abs(np.fft.fft2(centred)) ** 2 / (luma.size * np.sum(window**2))
    radius = np.hypot(np.fft.fftfreq(height)[:, None], np.fft.fftfreq(width)[None, :])
    # 1e-9 puts frequencies on the edge of an octave into the same octave for all directions.
    octave = np.floor(-np.log2(np.maximum(radius, 1e-9)) - 1e-9).astype(np.int64)
    bins = np.bincount(np.clip(octave, 0, OCTAVES - 1).ravel(), energy.ravel(), OCTAVES)
    return np.asarray(np.log10(bins + _ENERGY_FLOOR))


def _gradient(luma: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the change of `luma` [H, W] per texel, downwards and to the right, each [H, W]; borders do not wrap."""
    down, right = (np.gradient(luma, axis=axis) if luma.shape[axis] > 1 else np.zeros_like(luma) for axis in (0, 1))
    return down, right


def edge_density(luma: NDArray[np.float64]) -> float:
    """Return the share of the texels of `luma` [H, W] in which it changes by more than EDGE_THRESHOLD per texel."""
    return float(np.mean(np.hypot(*_gradient(luma)) > EDGE_THRESHOLD))


def edge_directions(luma: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return [8] float64, sum 1: the histogram of gradient directions of `luma` [H, W], opposite directions as one.

    Bin k is centred at k * 22.5 degrees from a horizontal gradient (a vertical edge). Without any gradient all
    bins are 1/8.
    """
    down, right = _gradient(luma)
    magnitude = np.hypot(down, right).ravel()
    total = float(magnitude.sum())
    if total < 1e-9:
        return np.full(DIRECTIONS, 1.0 / DIRECTIONS)
    position = (np.arctan2(down, right).ravel() / np.pi * DIRECTIONS) % DIRECTIONS
    lower = np.floor(position)
    # Each gradient is shared between two bins: a small rotation changes the histogram a little.
    upper_share = position - lower
    index = lower.astype(np.int64)
    histogram = np.bincount(index % DIRECTIONS, magnitude * (1.0 - upper_share), DIRECTIONS)
    histogram += np.bincount((index + 1) % DIRECTIONS, magnitude * upper_share, DIRECTIONS)
    return histogram / total


def spectral_features(texture: SourceTexture) -> NDArray[np.float64]:
    """Return features `spectral` of `texture`, [31] float64, always finite.

    They are `color_features` (12), `radial_spectrum` (8), `edge_density` of three mips, finest first, and `edge_directions` (8), of
    the first mip with at most 256 texels a side.
    """
    mips = small_mips(texture)
    luma = [mips[min(scale, len(mips) - 1)] @ LUMA for scale in range(EDGE_SCALES)]
    return np.concatenate(
        [
            color_features(mips[0]),
            radial_spectrum(luma[0]),
            np.array([edge_density(plane) for plane in luma]),
            edge_directions(luma[0]),
        ]
    )


def spectral_extractor() -> Extractor:
    """Return the extractor of features `spectral`."""
    return Extractor("spectral", "1", LENGTH, 1, standardised_columns, one_by_one(spectral_features))
