"""The visible part of an image, enlarged or reduced about as much as the screen needs."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

LARGEST_REPEAT = 32
"""Most pixels along one side of a repeated texel; the screen's own filter enlarges beyond that, and blurs the edges."""


@dataclass(frozen=True, eq=False)
class VisiblePart:
    """A part of an image as new pixels."""

    mips: tuple[NDArray[np.uint8], ...]
    """What it is a part of."""
    key: object
    """Equal for equal parts of one image."""
    pixels: NDArray[np.uint8]
    """[h, w, 3] uint8 sRGB."""
    rectangle: tuple[float, float, float, float]
    """(left, top, right, bottom) in the whole image, as shares of its size."""


def visible_part(
    mips: tuple[NDArray[np.uint8], ...],
    visible: tuple[float, float, float, float],
    width: float,
    known: VisiblePart | None = None,
) -> VisiblePart | None:
    """The part `visible` (left, top, right, bottom as shares) of an image with `mips`, which is `width` pixels wide as a whole.

    Of the mips the finest is taken that has no more texels than there are pixels; texels of an enlarged image stay
    square. `known` is returned where it is the same part; None where nothing is visible.
    """
    finest = mips[0].shape[1]
    level = min(max(math.floor(math.log2(max(finest / max(width, 1.0), 1.0)) + 0.5), 0), len(mips) - 1)
    image = mips[level]
    rows, columns = image.shape[:2]
    left, right = _range(visible[0], visible[2], columns)
    top, bottom = _range(visible[1], visible[3], rows)
    if left >= right or top >= bottom:
        return None
    repeat = min(max(math.ceil(width / columns), 1), LARGEST_REPEAT)
    key = (level, left, top, right, bottom, repeat)
    if known is not None and known.mips is mips and known.key == key:
        return known
    part = image[top:bottom, left:right]
    if repeat > 1:
        part = part.repeat(repeat, axis=0).repeat(repeat, axis=1)
    rectangle = (left / columns, top / rows, right / columns, bottom / rows)
    return VisiblePart(mips, key, np.ascontiguousarray(part), rectangle)


def _range(low: float, high: float, texels: int) -> tuple[int, int]:
    """Texels that a range of shares touches, and one more on each side for the screen's filter."""
    return max(math.floor(low * texels) - 1, 0), min(math.ceil(high * texels) + 1, texels)
