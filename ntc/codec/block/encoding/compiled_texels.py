"""Texels of blocks in units of a texture's axes and back, compiled by numba."""

import numpy as np
from numba import float32, float64, int64, uint8
from numpy.typing import NDArray

from ntc.codec.compiling import Signatures, compiled_loop

MOMENTS_AT_ONCE = 4096
"""Texels whose squares of 8-bit values are summed in 32 bits, which hold them."""


@compiled_loop()
def _used(matrix: NDArray[np.floating]) -> NDArray[np.int64]:
    """Return [columns, 2]: first row that is not 0 in each column of `matrix`, and the one after the last."""
    ranges = np.zeros((matrix.shape[1], 2), np.int64)
    for column in range(matrix.shape[1]):
        ranges[column, 0] = column
        for row in range(matrix.shape[0]):
            if matrix[row, column] != 0.0:
                ranges[column, 0] = min(ranges[column, 0], row)
                ranges[column, 1] = row + 1
    return ranges


@compiled_loop()
def normalise(
    texels: NDArray[np.uint8], mean: NDArray[np.float32], inverse: NDArray[np.float32], out: NDArray[np.float32]
) -> None:
    """Write (value - `mean`) @ `inverse` of 8-bit `texels` [blocks, texels, channels] into `out` [blocks, texels x channels]."""
    channels, used = texels.shape[2], _used(inverse)
    centred = np.zeros((channels, 256), np.float32)
    for channel in range(channels):
        for value in range(256):
            centred[channel, value] = np.float32(value) / np.float32(255.0) - mean[channel]
    for block in range(texels.shape[0]):
        for texel in range(texels.shape[1]):
            for channel in range(channels):
                total = np.float32(0.0)
                for row in range(used[channel, 0], used[channel, 1]):
                    total += centred[row, texels[block, texel, row]] * inverse[row, channel]
                out[block, texel * channels + channel] = total


@compiled_loop()
def add_moments(values: NDArray[np.uint8], sums: NDArray[np.int64], products: NDArray[np.int64]) -> None:
    """Add the sums of 8-bit `values` [texels, channels] and of the products of channels to `sums` and `products`, which are exact."""
    channels = values.shape[1]
    run = np.zeros((channels, MOMENTS_AT_ONCE), np.uint32)
    for start in range(0, len(values), MOMENTS_AT_ONCE):
        count = min(MOMENTS_AT_ONCE, len(values) - start)
        for one in range(channels):
            values_of_one = run[one]
            total = np.uint32(0)
            for texel in range(count):
                values_of_one[texel] = values[start + texel, one]
                total += values_of_one[texel]
            sums[one] += np.int64(total)
            for other in range(one + 1):
                values_of_other = run[other]
                total = np.uint32(0)
                for texel in range(count):
                    total += values_of_one[texel] * values_of_other[texel]
                products[one, other] += np.int64(total)
                if other < one:
                    products[other, one] = products[one, other]


@compiled_loop()
def show(
    transformed: NDArray[np.float64], mean: NDArray[np.float64], axes: NDArray[np.float64], out: NDArray[np.uint8]
) -> None:
    """Write `mean` + `axes` @ `transformed` [channels, blocks, texels] as 8-bit values into `out` [blocks, texels, channels]."""
    channels, used = transformed.shape[0], _used(axes.T)
    for block in range(out.shape[0]):
        for texel in range(out.shape[1]):
            for channel in range(channels):
                value = mean[channel]
                for column in range(used[channel, 0], used[channel, 1]):
                    value += axes[channel, column] * transformed[column, block, texel]
                value = min(max(value, 0.0), 1.0)
                out[block, texel, channel] = np.uint8(np.rint(value * 255.0))


SIGNATURES: Signatures = {
    normalise: (uint8[:, :, ::1], float32[::1], float32[:, ::1], float32[:, ::1]),
    add_moments: (uint8[:, ::1], int64[::1], int64[:, ::1]),
    show: (float64[:, :, ::1], float64[::1], float64[:, ::1], uint8[:, :, ::1]),
}
