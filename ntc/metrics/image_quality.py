"""Similarity of two pictures: SSIM and FLIP."""

import math

import numpy as np
from numpy.typing import NDArray

from ntc.errors import InputError
from ntc.features.pixels import LUMA, as_rgb, check_image

Image = NDArray[np.uint8]

WINDOW_RADIUS = 5
"""Radius of SSIM's window of 11x11 texels."""
WINDOW_SIGMA = 1.5
SSIM_C1, SSIM_C2 = (0.01 * 255.0) ** 2, (0.03 * 255.0) ** 2
PIXELS_PER_DEGREE = 67.02
"""Pixels per degree of FLIP's default viewing conditions: a display 0.7 m wide with 3840 pixels, seen from 0.7 m."""


def _check_pair(a: Image, b: Image) -> None:
    for image in (a, b):
        check_image(image)
    if a.shape != b.shape:
        raise InputError(f"images: have shapes {a.shape} and {b.shape}; resize one to the other")


def _luma(image: Image) -> NDArray[np.float64]:
    return np.asarray(as_rgb(image).astype(np.float64) @ LUMA)


def _windowed(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return [H, W] Gaussian means of `values` [H, W] over the window around each texel. The picture is mirrored at its edges."""
    from scipy import ndimage

    return np.asarray(ndimage.gaussian_filter(values, WINDOW_SIGMA, mode="reflect", radius=WINDOW_RADIUS))


def ssim_map(a: Image, b: Image) -> NDArray[np.float64]:
    """Return [H, W] SSIM of the window around each texel. The picture is mirrored at its edges.

    Parameters and errors are those of `ssim`.
    """
    _check_pair(a, b)
    x, y = _luma(a), _luma(b)
    mean_x, mean_y = _windowed(x), _windowed(y)
    variance_x, variance_y = _windowed(x * x) - mean_x**2, _windowed(y * y) - mean_y**2
    covariance = _windowed(x * y) - mean_x * mean_y
    luminance = (2.0 * mean_x * mean_y + SSIM_C1) / (mean_x**2 + mean_y**2 + SSIM_C1)
    structure = (2.0 * covariance + SSIM_C2) / (variance_x + variance_y + SSIM_C2)
    return np.asarray(luminance * structure)


def ssim(a: Image, b: Image) -> float:
    """Return the mean SSIM (Wang et al. 2004) of the luma of two pictures [H, W, C] uint8, sRGB, C from 1 to 4; 1 when equal.

    Luma is that of BT.601, as in the authors' program, but not rounded. With one or two channels, the first is grey. Alpha is left
    out. Windows are 11x11 Gaussians (sigma 1.5) inside the picture, as in the authors' program. Along a side shorter than 11 texels,
    there is a window around each texel, and the picture is mirrored at its edges.
    Raises InputError for pictures of different shapes, of another type, or without texels.
    """
    windows = ssim_map(a, b)
    inner = (
        slice(WINDOW_RADIUS, -WINDOW_RADIUS) if side > 2 * WINDOW_RADIUS else slice(None) for side in windows.shape
    )
    return float(np.mean(windows[tuple(inner)]))


def flip_map(reference: Image, test: Image, pixels_per_degree: float = PIXELS_PER_DEGREE) -> NDArray[np.float32]:
    """Return [H, W] LDR-FLIP of each pixel, 0 to 1. Parameters and errors are those of `flip`.

    It holds Python's interpreter lock until it is done.
    """
    _check_pair(reference, test)
    if not (math.isfinite(pixels_per_degree) and pixels_per_degree > 0.0):
        raise InputError(f"FLIP: pixels_per_degree is {pixels_per_degree}; set it above 0")
    try:
        import flip_evaluator
    except ImportError as error:
        raise InputError(f"FLIP: flip-evaluator cannot be imported ({error}); pip install flip-evaluator") from error
    pictures = [as_rgb(image).astype(np.float32) / np.float32(255.0) for image in (reference, test)]
    errors, _, _ = flip_evaluator.evaluate(
        *pictures, "LDR", applyMagma=False, computeMeanError=False, parameters={"ppd": pixels_per_degree}
    )
    return np.asarray(errors, np.float32).reshape(reference.shape[:2])


def flip(reference: Image, test: Image, pixels_per_degree: float = PIXELS_PER_DEGREE) -> float:
    """Return the mean LDR-FLIP (Andersson et al. 2020) of two pictures [H, W, C] uint8, sRGB, C from 1 to 4: 0 equal, 1 worst.

    With one or two channels, the first is grey. Alpha is left out. `pixels_per_degree` are those of the observer's field of view.
    NVIDIA's flip-evaluator computes it. Raises InputError for pictures of different shapes, of another type or without
    texels, for `pixels_per_degree` not above 0, and where flip-evaluator cannot be imported.
    """
    # flip-evaluator's mean is summed in single precision.
    return float(np.mean(flip_map(reference, test, pixels_per_degree), dtype=np.float64))
