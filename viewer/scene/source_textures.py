"""The textures of a scene as the codec wants them, and smaller copies of them."""

from dataclasses import replace

import numpy as np

from ntc.codec.config import WrapMode
from ntc.codec.mips import resize_to
from ntc.codec.textures import SourceTexture
from ntc.errors import InputError
from viewer.scene.images import map_in_threads, reduced_size
from viewer.scene.model import Scene


def reduce_texture(texture: SourceTexture, size: int) -> SourceTexture:
    """`texture` with at most `size` texels a side, its aspect kept to the nearest texel; the same when it fits.

    Box filtered in linear light, alpha (the last of two or four channels) as it is. The pixel hash stays that of the
    original. Raises InputError for a size below 1.
    """
    if size < 1:
        raise InputError(f"texture size {size}: must be at least 1 texel")
    width, height = reduced_size(*texture.size, size)
    if (width, height) == texture.size:
        return texture
    # Transposed, so that rows are filtered before columns: the rounding that packs were encoded with so far.
    small = resize_to(texture.pixels.transpose(1, 0, 2), height, width, texture.color_space)
    return replace(texture, pixels=np.ascontiguousarray(small.transpose(1, 0, 2)))


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
