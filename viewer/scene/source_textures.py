"""The textures of a scene as the codec wants them, and smaller copies of them."""

from collections.abc import Collection, Mapping
from dataclasses import replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ntc.codec.config import WrapMode
from ntc.codec.maps import BASE_ALONE
from ntc.codec.mips import resize_to
from ntc.codec.textures import SourceTexture
from ntc.errors import InputError
from viewer.scene.images import map_in_threads, reduced_size
from viewer.scene.model import Scene, SceneTexture

MapChoice = Literal["base", "all"]
"""Base colours alone, or whole material sets."""


def reduce_texture(texture: SourceTexture, size: int) -> SourceTexture:
    """Return `texture` with at most `size` texels a side, its aspect kept to the nearest texel; the same when it fits.

    Box filtered as mips are: colours in linear light, normals as vectors, alpha (the last of two or four channels of a base colour)
    and all else as it is. The pixel hash stays that of the original. Raises InputError for a size below 1.
    """
    if size < 1:
        raise InputError(f"texture size {size}: must be at least 1 texel")
    width, height = reduced_size(*texture.size, size)
    if (width, height) == texture.size:
        return texture
    # Transposed, so that rows are filtered before columns: the rounding that packs were encoded with so far.
    small = resize_to(texture.pixels.transpose(1, 0, 2), height, width, texture.color_space, texture.maps)
    return replace(texture, pixels=np.ascontiguousarray(small.transpose(1, 0, 2)))


def _whole(texture: SceneTexture) -> NDArray[np.uint8]:
    """Return [H, W, C] the channels of all maps of `texture`."""
    base = [texture.pixels] if "base" in texture.maps else []
    return np.concatenate([*base, *(texture.further_maps[name] for name in texture.maps if name != "base")], axis=2)


def _wraps(scene: Scene) -> dict[int, tuple[WrapMode, WrapMode]]:
    """Return the wrap modes of the first material that uses each texture, by texture id."""
    wraps: dict[int, tuple[WrapMode, WrapMode]] = {}
    for material in scene.materials:
        wraps.setdefault(material.texture_id, material.sampler.wrap)
        for plane in (material.surface, material.emission):
            if plane is not None:
                wraps.setdefault(plane.texture_id, plane.sampler.wrap)
    return wraps


def has_source(texture: SceneTexture, maps: MapChoice) -> bool:
    """Return whether `source_textures` gives the texture."""
    return maps == "all" or "base" in texture.maps


def source_texture(scene: Scene, index: int, size: int | None, maps: MapChoice = "base") -> SourceTexture:
    """Return the texture of `scene` with the id `index`, as `source_textures` gives it."""
    return _source(scene, index, _wraps(scene), size, maps)


def _source(
    scene: Scene, index: int, wraps: Mapping[int, tuple[WrapMode, WrapMode]], size: int | None, maps: MapChoice
) -> SourceTexture:
    texture = scene.textures[index]
    is_set = maps == "all" and texture.maps != BASE_ALONE
    whole = SourceTexture(
        name=texture.name,
        pixels=_whole(texture) if is_set else texture.pixels,
        pixel_hash=texture.set_hash if is_set else texture.pixel_hash,
        wrap=wraps.get(index, ("repeat", "repeat")),
        category=texture.category,
        maps=texture.maps if is_set else BASE_ALONE,
    )
    return whole if size is None else reduce_texture(whole, size)


def source_textures(
    scene: Scene, size: int | None, maps: MapChoice = "base", only: Collection[int] | None = None
) -> tuple[SourceTexture, ...]:
    """Textures of `scene` in the order of their ids, reduced to at most `size` texels a side unless it is None.

    With `only`, those of these ids.

    `base` gives base colours (RGB): textures without one, whose ids are the last, are left out. `all` gives all textures with all
    their maps; the hash of a material set is then `SceneTexture.set_hash`. Wrap modes are those of the first material that uses
    the texture. Alpha is not part of them: it stays a plain texture. Raises InputError for a size below 1.
    """
    wraps = _wraps(scene)
    chosen = [
        index
        for index, texture in enumerate(scene.textures)
        if has_source(texture, maps) and (only is None or index in only)
    ]
    return tuple(map_in_threads(lambda index: _source(scene, index, wraps, size, maps), chosen))
