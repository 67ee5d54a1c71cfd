"""The original images that the page compares with, and coverage, which is never encoded: lossless WebP, which all browsers read."""

import io

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from ntc.codec.maps import PLANE_COMPONENTS, Plane
from ntc.errors import InputError
from viewer.scene.map_pictures import NEUTRAL
from viewer.scene.model import SceneTexture

LARGEST_SIDE = 16383
"""Texels a side that WebP has at most."""


def plane_picture(texture: SceneTexture, plane: Plane) -> NDArray[np.uint8]:
    """[H, W, 3] uint8 of the plane `base`; of the others [2 H, W, 3]: the first three of its components, below them the fourth one.

    In one picture without alpha: browsers multiply by alpha what has one.
    """
    if plane == "base":
        return texture.pixels
    further, places = texture.further_maps, PLANE_COMPONENTS[plane]
    width, height = texture.size
    whole = np.full((height, width, 4), NEUTRAL, np.uint8)
    for name, first in places.items():
        if name in further:
            whole[..., first : first + further[name].shape[2]] = further[name]
    return np.concatenate([whole[..., :3], np.repeat(whole[..., 3:], 3, axis=2)])


def webp(pixels: NDArray[np.uint8], name: str) -> bytes:
    """`pixels` [H, W, 3] or [H, W] as a lossless WebP. Raises InputError for one that is too large, by `name`."""
    if max(pixels.shape[:2]) > LARGEST_SIDE:
        raise InputError(
            f"{name}: {pixels.shape[1]} x {pixels.shape[0]} texels are more than WebP has; leave originals out"
        )
    file = io.BytesIO()
    Image.fromarray(np.ascontiguousarray(pixels)).convert("RGB").save(file, "WEBP", lossless=True, quality=30, method=2)
    return file.getvalue()
