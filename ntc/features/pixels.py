"""Pixels for features: small mips with three channels."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ntc.codec.maps import BASE_ALONE, SRGB_MAPS, map_slices
from ntc.codec.mips import mip_chain
from ntc.codec.textures import SourceTexture
from ntc.errors import InputError

LARGEST_SIDE = 256
"""Largest side in texels of the mip that features are computed from."""
LUMA = np.array([0.299, 0.587, 0.114])
"""[3] weights of coded red, green and blue in luma (ITU-R BT.601)."""


def first_map(texture: SourceTexture) -> SourceTexture:
    """Return `texture` with its first map alone."""
    if texture.maps == BASE_ALONE:
        return texture
    name = texture.maps[0]
    pixels = texture.pixels[..., map_slices(texture.maps, texture.channels)[name]]
    space = texture.color_space if name == "base" else "srgb" if name in SRGB_MAPS else "linear"
    return replace(texture, pixels=np.ascontiguousarray(pixels), maps=BASE_ALONE, color_space=space)


def as_rgb(pixels: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return [H, W, 3] uint8: the first three channels of `pixels` [H, W, C], or the first one repeated where C < 3.

    With one or two channels, the first is grey. A second or fourth channel is alpha and left out.
    """
    return pixels[..., :3] if pixels.shape[2] >= 3 else np.repeat(pixels[..., :1], 3, axis=2)


def small_mips(texture: SourceTexture) -> list[NDArray[np.float64]]:
    """Return the mips of `texture` from the first that has at most 256 texels a side down to 1x1, finest first.

    Each is [H, W, 3] float64 in [0, 1], coded as the texture is (sRGB values stay sRGB values).
    """
    chain = mip_chain(texture.pixels, texture.color_space)
    return [as_rgb(mip).astype(np.float64) / 255.0 for mip in chain if max(mip.shape[:2]) <= LARGEST_SIDE]


def check_image(image: NDArray[np.uint8]) -> None:
    """Raise InputError unless `image` is [H, W, 1 to 4] uint8 and not empty."""
    if image.dtype != np.uint8 or image.ndim != 3 or not 1 <= image.shape[2] <= 4 or image.size == 0:
        raise InputError(f"image: has shape {image.shape} of {image.dtype}; needs [H, W, 1 to 4] of uint8, not empty")
