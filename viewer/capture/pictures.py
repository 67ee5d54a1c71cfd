"""Pictures of a view: material maps as channels of an EXR file, the colour bar of a divergence map, and the error overlay."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import OpenImageIO
from numpy.typing import NDArray

from viewer.render.renderer import Renderer
from viewer.scene.images import write_image
from viewer.state.palettes import PaletteName, palette_colors, share_of_most
from viewer.state.view_state import Slot

Channels = Mapping[str, NDArray[np.float32]]
"""Channels of an EXR file: [H, W] float32 by name, row 0 on top."""


def material_aovs(renderer: Renderer, slot: Slot) -> Channels:
    """Return the material maps of a slot in the last view, and the coverage as alpha.

    Colours are linear. Only the base colour is multiplied by its factor. `normal` is the tangent-space normal, a unit vector.
    """
    planes = renderer.planes(slot)
    channels = {"A": renderer.covered().astype(np.float32)}
    if "base" in planes:
        channels |= {name: planes["base"][..., place] for place, name in enumerate("RGB")}
    if "surface" in planes:
        surface = planes["surface"]
        across = surface[..., :2] * 2.0 - 1.0
        up = np.sqrt(np.maximum(1.0 - np.square(across).sum(2, keepdims=True), 0.0))
        normals = np.concatenate([across, up], axis=2)
        normals /= np.linalg.norm(normals, axis=2, keepdims=True)
        channels |= {f"normal.{axis}": normals[..., place] for place, axis in enumerate("XYZ")}
        channels |= {"roughness": surface[..., 2], "metalness": surface[..., 3]}
    if "emission" in planes:
        channels |= {f"emissive.{name}": planes["emission"][..., place] for place, name in enumerate("RGB")}
        channels["occlusion"] = planes["emission"][..., 3]
    return channels


def write_aovs(path: Path, channels: Channels) -> None:
    """Write `channels` atomically as an EXR file of 32-bit floats. Raises InputError where it cannot be written."""
    names = sorted(channels)
    pixels = np.ascontiguousarray(np.stack([channels[name] for name in names], axis=2), np.float32)
    height, width = pixels.shape[:2]
    spec = OpenImageIO.ImageSpec(width, height, len(names), "float")
    spec.channelnames = tuple(names)
    write_image(path, pixels, spec)


ERROR_AMPLIFICATION = 8.0
LARGEST_BAR = (360, 18)
"""(width, height) of the colour bar in pixels."""
MARGIN = 10
TEXT_SIZE = 13
MOST_TICKS = 16


def with_color_bar(picture: NDArray[np.uint8], palette: PaletteName, most: int) -> NDArray[np.uint8]:
    """Return `picture` [H, W, 3] uint8 with a colour bar at its lower left: the colours of 1 to `most` decoders per block.

    A picture that is too small for the bar stays as it is.
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
    """Return the error overlay [H, W, 3] uint8: the absolute difference of 8-bit sRGB values times 8, black where they are equal."""
    difference = np.abs(color.astype(np.int16) - reference.astype(np.int16)) * ERROR_AMPLIFICATION
    return np.minimum(difference, 255).astype(np.uint8)
