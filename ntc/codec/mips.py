"""The mip chain of a texture: box-filtered in linear light, the truth for every latent level and for the reference path."""

import numpy as np
from numpy.typing import NDArray

from ntc.codec.color import to_8bit, to_linear
from ntc.codec.config import ColorSpace


def mip_sizes(width: int, height: int) -> list[tuple[int, int]]:
    """(width, height) in texels of all mips of a texture, down to 1x1 texel."""
    return [(max(1, width >> level), max(1, height >> level)) for level in range(max(width, height).bit_length())]


def _resample_axis(image: NDArray[np.float32], size: int) -> NDArray[np.float32]:
    """Area-weighted box filter of axis 0 down to `size` rows; each output row covers an equal share of the input."""
    rows = image.shape[0]
    if rows == size:
        return image
    if rows == 2 * size:
        return (image[0::2] + image[1::2]) * np.float32(0.5)
    step = rows / size
    result = np.zeros((size, *image.shape[1:]), np.float32)
    if rows % size == 0:
        # The same sums, without gathering rows.
        for tap in range(rows // size):
            result += image[tap :: rows // size] * np.float32(1.0 / step)
        return result
    starts = np.arange(size) * step
    for tap in range(int(np.ceil(step)) + 1):
        row = np.floor(starts).astype(np.int64) + tap
        overlap = np.clip(np.minimum(row + 1, starts + step) - np.maximum(row, starts), 0.0, None) / step
        weights = overlap.astype(np.float32).reshape(-1, *([1] * (image.ndim - 1)))
        result += image[np.minimum(row, rows - 1)] * weights
    return result


def box_resize(linear: NDArray[np.float32], width: int, height: int) -> NDArray[np.float32]:
    """[height, width, C] float32: area-weighted reduction of `linear` [H, W, C], numbers in linear light."""
    narrow = _resample_axis(linear.transpose(1, 0, 2), width).transpose(1, 0, 2)
    return np.ascontiguousarray(_resample_axis(narrow, height))


def mip_chain(pixels: NDArray[np.uint8], color_space: ColorSpace) -> tuple[NDArray[np.uint8], ...]:
    """All mips of `pixels` [H, W, C] uint8, down to 1x1 texel: mip l is [max(1, H >> l), max(1, W >> l), C] uint8.

    Filtered in linear light from the unrounded mip above, then coded in `color_space` again.
    """
    height, width = pixels.shape[:2]
    chain = [pixels]
    linear = to_linear(pixels, color_space)
    while width >> len(chain) or height >> len(chain):
        linear = box_resize(linear, max(1, width >> len(chain)), max(1, height >> len(chain)))
        chain.append(to_8bit(linear, color_space))
    return tuple(chain)


def resize_to(pixels: NDArray[np.uint8], width: int, height: int, color_space: ColorSpace) -> NDArray[np.uint8]:
    """[height, width, C] uint8: `pixels` reduced by an area-weighted box filter in linear light."""
    return to_8bit(box_resize(to_linear(pixels, color_space), width, height), color_space)
