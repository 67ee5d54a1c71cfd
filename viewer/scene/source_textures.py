"""The textures of a scene as the codec wants them, and smaller copies of them."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ntc.codec.color import linear_to_srgb, srgb8_to_linear_table
from ntc.codec.config import WrapMode
from ntc.codec.textures import SourceTexture
from ntc.errors import InputError
from viewer.scene.images import map_in_threads, reduced_size
from viewer.scene.model import Scene

_LINEAR_OF_SRGB = srgb8_to_linear_table()
_LINEAR = (np.arange(256) / 255.0).astype(np.float32)


def _box_filter(values: NDArray[np.float32], size: int) -> NDArray[np.float32]:
    """Means over `size` equal stretches of axis 0 of `values` [N, M], size <= N; edge texels count by their share."""
    count = len(values)
    if count % size == 0:
        return np.asarray(values.reshape(size, count // size, values.shape[1]).mean(axis=1), np.float32)
    edges = np.arange(size + 1) * (count / size)
    texels = np.arange(count)
    covered = np.minimum(edges[1:, None], texels + 1) - np.maximum(edges[:-1, None], texels)
    weights = (np.maximum(covered, 0.0) * (size / count)).astype(np.float32)
    return np.asarray(weights @ values, np.float32)


def reduce_texture(texture: SourceTexture, size: int) -> SourceTexture:
    """`texture` with at most `size` texels a side, its aspect kept to the nearest texel; the same when it fits.

    Colours are box filtered in linear light, alpha (the last of two or four channels) as it is. The pixel hash
    stays that of the original. Raises InputError for a size below 1.
    """
    if size < 1:
        raise InputError(f"texture size {size}: must be at least 1 texel")
    width, height = reduced_size(*texture.size, size)
    if (width, height) == texture.size:
        return texture
    channels = texture.pixels.shape[2]
    colors = channels - (channels % 2 == 0) if texture.color_space == "srgb" else 0
    planes: list[NDArray[np.uint8]] = []
    for channel in range(channels):
        is_srgb = channel < colors
        values = (_LINEAR_OF_SRGB if is_srgb else _LINEAR)[texture.pixels[..., channel]]
        small = _box_filter(_box_filter(values, height).T, width).T
        encoded = linear_to_srgb(np.clip(small, 0.0, 1.0)) if is_srgb else small
        planes.append(np.clip(np.rint(encoded * 255.0), 0, 255).astype(np.uint8))
    return replace(texture, pixels=np.ascontiguousarray(np.stack(planes, axis=2)))


def source_textures(scene: Scene, size: int | None) -> tuple[SourceTexture, ...]:
    """RGB textures of `scene` in the order of their ids, reduced to at most `size` texels a side unless it is None.

    Wrap modes are those of the first material that uses the texture. Alpha is not part of them: it stays a plain
    texture. Raises InputError for a size below 1.
    """
    wraps: dict[int, tuple[WrapMode, WrapMode]] = {}
    for material in scene.materials:
        wraps.setdefault(material.texture_id, material.sampler.wrap)
    textures = [
        SourceTexture(
            name=texture.name,
            pixels=texture.pixels,
            pixel_hash=texture.pixel_hash,
            wrap=wraps.get(index, ("repeat", "repeat")),
            category=texture.category,
        )
        for index, texture in enumerate(scene.textures)
    ]
    if size is None:
        return tuple(textures)
    return tuple(map_in_threads(lambda texture: reduce_texture(texture, size), textures))
