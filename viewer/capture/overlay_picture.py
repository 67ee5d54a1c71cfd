"""Pictures around the picture: the colour bar of a divergence map, and the error against the reference."""

import numpy as np
import OpenImageIO
from numpy.typing import NDArray

from viewer.state.palettes import PaletteName, palette_colors, share_of_most

ERROR_AMPLIFICATION = 8.0
LARGEST_BAR = (360, 18)
"""(width, height) of the colour bar in pixels."""
MARGIN = 10
TEXT_SIZE = 13
MOST_TICKS = 16


def with_color_bar(picture: NDArray[np.uint8], palette: PaletteName, most: int) -> NDArray[np.uint8]:
    """Return `picture` [H, W, 3] uint8 with a colour bar at its lower left, which shows the colour of each number of decoders.

    A picture too small for it stays as it is.
    """
    height, width = picture.shape[:2]
    most = max(most, 2)
    bar_width = min(LARGEST_BAR[0], width - 2 * MARGIN)
    plate_height = LARGEST_BAR[1] + TEXT_SIZE + 14
    if bar_width < 8 * most or height < 2 * plate_height or bar_width < 120:
        return picture
    drawn = picture.copy()
    top, left = height - plate_height - MARGIN, MARGIN
    drawn[top : top + plate_height, left : left + bar_width] //= 4
    for decoders in range(1, most + 1):
        color = palette_colors(palette, np.array(share_of_most(decoders, most))) * 255.0
        edges = [left + round(bar_width * number / most) for number in (decoders - 1, decoders)]
        drawn[top : top + LARGEST_BAR[1], edges[0] : edges[1]] = np.rint(color)
    buffer = OpenImageIO.ImageBuf(drawn)
    every = -(-most // MOST_TICKS)
    baseline = top + LARGEST_BAR[1] + TEXT_SIZE + 2
    for decoders in range(1, most + 1):
        if (decoders - 1) % every == 0 or decoders == most:
            middle = left + round(bar_width * (decoders - 0.5) / most)
            text = f"{decoders}" if decoders < most else f"{decoders} decoders"
            alignment = "center" if decoders < most else "right"
            x = middle if decoders < most else left + bar_width - 3
            OpenImageIO.ImageBufAlgo.render_text(buffer, x, baseline, text, TEXT_SIZE, "", (1.0, 1.0, 1.0), alignment)
    return np.asarray(buffer.get_pixels(OpenImageIO.UINT8), np.uint8)


def error_overlay(color: NDArray[np.uint8], reference: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return [H, W, 3] uint8: absolute difference of 8-bit sRGB values, amplified 8 times, black where equal."""
    difference = np.abs(color.astype(np.int16) - reference.astype(np.int16)) * ERROR_AMPLIFICATION
    return np.minimum(difference, 255).astype(np.uint8)
