"""Textures as the input of an image network."""

from collections.abc import Sequence
from typing import Literal

import torch
from torch.nn import functional

from ntc.codec.textures import SourceTexture
from ntc.features.pixels import as_rgb


def square_images(
    textures: Sequence[SourceTexture], side: int, filter_name: Literal["bilinear", "bicubic"]
) -> torch.Tensor:
    """[textures, 3, side, side] float32 in [0, 1]: the whole of each texture, resized, coded as it is.

    Grey is repeated, alpha left out. Reduction is antialiased. Nothing is cropped: a texture has no middle that
    matters more, so one that is not square is squeezed.
    """
    images = []
    for texture in textures:
        pixels = torch.from_numpy(as_rgb(texture.pixels).transpose(2, 0, 1).copy())
        image = pixels.to(torch.float32)[None] / 255.0
        small = functional.interpolate(image, (side, side), mode=filter_name, align_corners=False, antialias=True)
        images.append(small.clamp(0.0, 1.0))
    return torch.cat(images)
