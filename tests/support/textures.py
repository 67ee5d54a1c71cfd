"""Textures to encode, and packs of codec `grid` as the arrays that they hold."""

import numpy as np
from numpy.typing import NDArray

from ntc.codec.config import ColorSpace
from ntc.codec.grid.model import grid_parts
from ntc.codec.model import Pack
from ntc.codec.textures import SourceTexture, hash_pixels


def of_pixels(pixels: NDArray[np.uint8], name: str = "texture") -> SourceTexture:
    """A texture of `pixels` [H, W, C], which are sRGB and repeat."""
    return SourceTexture(name, pixels, hash_pixels(pixels))


def texture(
    width: int, height: int, channels: int = 3, seed: int = 0, color_space: ColorSpace = "srgb"
) -> SourceTexture:
    """A texture of smooth waves that repeat at its edges."""
    random = np.random.default_rng(seed)
    u, v = (np.arange(width) + 0.5) / width, ((np.arange(height) + 0.5) / height)[:, None]
    planes = [
        0.5 + 0.4 * np.sin(2.0 * np.pi * (u * random.integers(1, 3) + v * random.integers(0, 2)) + random.uniform(0, 6))
        for _ in range(channels)
    ]
    pixels = np.rint(np.stack([np.broadcast_to(plane, (height, width)) for plane in planes], -1) * 255).astype(np.uint8)
    return SourceTexture(f"waves {seed}", pixels, hash_pixels(pixels), color_space)


def waves(width: int, height: int, channels: int = 3, seed: int = 0) -> SourceTexture:
    """A smooth texture with a little noise."""
    random = np.random.default_rng(seed)
    y, x = np.mgrid[0:height, 0:width]
    image = np.stack([np.sin(x * 0.2 + y * 0.1 * (seed + 1) + c) for c in range(channels)], axis=-1) * 80 + 128
    pixels = np.clip(image + random.normal(0, 2, image.shape), 0, 255).astype(np.uint8)
    return SourceTexture(f"waves {seed}", pixels, hash_pixels(pixels), wrap=("mirror", "repeat"))


def arrays(pack: Pack) -> list[NDArray[np.generic]]:
    """All arrays of a pack in a fixed order."""
    parts: list[NDArray[np.generic]] = []
    for encoded in grid_parts(pack).textures:
        parts += [encoded.latents, encoded.scale, encoded.offset]
        if encoded.adapter is not None:
            parts += [part for part in vars(encoded.adapter).values() if part is not None]
    for decoder in grid_parts(pack).decoders:
        parts += [*decoder.weights, *decoder.biases]
    return parts


def same(a: Pack, b: Pack) -> bool:
    """Return whether two packs hold the same bits."""
    return [array.tobytes() for array in arrays(a)] == [array.tobytes() for array in arrays(b)]
