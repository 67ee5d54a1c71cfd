"""The first mip of a texture, and angles between normals, compiled by numba."""

import numpy as np
from numba import float32, float64, int64, uint8
from numpy.typing import NDArray

from ntc.codec.compiling import Signatures, compiled_loop


@compiled_loop()
def _z(x: np.float32, y: np.float32) -> np.float32:
    """Return z of a unit vector with this `x` and `y`, never below 0."""
    found: np.float32 = np.sqrt(max(np.float32(1.0) - (x * x + y * y), np.float32(0.0)))
    return found


@compiled_loop()
def halve(pixels: NDArray[np.uint8], tables: NDArray[np.float32], normal: int, out: NDArray[np.float32]) -> None:
    """Write the mean of 2x2 texels of `pixels` [H, W, C], both sides even, by the values of `tables` [C, 256], into `out` [H/2, W/2,
    C]. Channels `normal` and the next one are xy of normals, whose z comes after them; -1: there are none."""
    half, channels = np.float32(0.5), pixels.shape[2]
    depths = np.empty(4, np.float32)
    for row in range(out.shape[0]):
        for column in range(out.shape[1]):
            place = 0
            for channel in range(channels):
                table = tables[channel]
                above = table[pixels[2 * row, 2 * column, channel]] + table[pixels[2 * row, 2 * column + 1, channel]]
                below = (
                    table[pixels[2 * row + 1, 2 * column, channel]]
                    + table[pixels[2 * row + 1, 2 * column + 1, channel]]
                )
                out[row, column, place] = (above * half + below * half) * half
                place += 1
                if channel == normal + 1 and normal >= 0:
                    for texel in range(4):
                        own = pixels[2 * row + texel // 2, 2 * column + texel % 2]
                        depths[texel] = _z(tables[normal, own[normal]], tables[normal + 1, own[normal + 1]])
                    out[row, column, place] = ((depths[0] + depths[1]) * half + (depths[2] + depths[3]) * half) * half
                    place += 1


@compiled_loop()
def write_angles(coded: NDArray[np.uint8], others: NDArray[np.uint8], degrees: NDArray[np.float64]) -> None:
    """Write the angles in degrees between normals whose xy are `coded` and `others` [H, W, 2] into `degrees` [H, W]."""
    step, one = np.float32(2.0 / 255.0), np.float32(1.0)
    for row in range(coded.shape[0]):
        for column in range(coded.shape[1]):
            ax = np.float32(coded[row, column, 0]) * step - one
            ay = np.float32(coded[row, column, 1]) * step - one
            bx = np.float32(others[row, column, 0]) * step - one
            by = np.float32(others[row, column, 1]) * step - one
            x, y, z = np.float64(ax), np.float64(ay), np.float64(_z(ax, ay))
            u, v, w = np.float64(bx), np.float64(by), np.float64(_z(bx, by))
            # By both: the cosine alone has no digits left for small angles.
            sine = np.sqrt((y * w - z * v) ** 2 + (z * u - x * w) ** 2 + (x * v - y * u) ** 2)
            degrees[row, column] = np.degrees(np.arctan2(sine, x * u + y * v + z * w))


SIGNATURES: Signatures = {
    halve: (uint8[:, :, ::1], float32[:, ::1], int64, float32[:, :, ::1]),
    write_angles: (uint8[:, :, :], uint8[:, :, :], float64[:, ::1]),
}
