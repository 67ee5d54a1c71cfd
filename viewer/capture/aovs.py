"""Maps of every pixel's surface, as channels of one EXR file."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import OpenImageIO
from numpy.typing import NDArray

from viewer.render.renderer import Renderer
from viewer.scene.images import write_image
from viewer.state.view_state import Slot

Channels = Mapping[str, NDArray[np.float32]]
"""Channels of an EXR file: [H, W] float32 by name, row 0 on top."""


def material_aovs(renderer: Renderer, slot: Slot) -> Channels:
    """Return the maps that the last view has read of a slot (factors applied to the base colour alone), and coverage.

    Colours are linear; `normal` is the tangent-space normal, a unit vector.
    """
    planes = renderer.planes(slot)
    found = {"A": renderer.covered().astype(np.float32)}
    if "base" in planes:
        found |= {name: planes["base"][..., place] for place, name in enumerate("RGB")}
    if "surface" in planes:
        surface = planes["surface"]
        across = surface[..., :2] * 2.0 - 1.0
        up = np.sqrt(np.maximum(1.0 - np.square(across).sum(2, keepdims=True), 0.0))
        normals = np.concatenate([across, up], axis=2)
        normals /= np.linalg.norm(normals, axis=2, keepdims=True)
        found |= {f"normal.{axis}": normals[..., place] for place, axis in enumerate("XYZ")}
        found |= {"roughness": surface[..., 2], "metalness": surface[..., 3]}
    if "emission" in planes:
        found |= {f"emissive.{name}": planes["emission"][..., place] for place, name in enumerate("RGB")}
        found["occlusion"] = planes["emission"][..., 3]
    return found


def write_aovs(path: Path, channels: Channels) -> None:
    """Write `channels` as an EXR file of 32-bit floats, atomically. Raises InputError where it cannot be written."""
    names = sorted(channels)
    pixels = np.ascontiguousarray(np.stack([channels[name] for name in names], axis=2), np.float32)
    height, width = pixels.shape[:2]
    spec = OpenImageIO.ImageSpec(width, height, len(names), "float")
    spec.channelnames = tuple(names)
    write_image(path, pixels, spec)
