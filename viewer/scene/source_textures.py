"""Textures of a scene in the form that codecs encode, at full or reduced size."""

from collections.abc import Collection, Mapping
from dataclasses import replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ntc.codec.config import WrapMode
from ntc.codec.maps import BASE_ALONE, MapName
from ntc.codec.mips import resize_to
from ntc.codec.textures import SourceTexture
from ntc.errors import InputError
from viewer.scene.images import map_in_threads, reduced_size
from viewer.scene.model import Scene, SceneTexture

MapChoice = Literal["base", "all"]
"""Choice of the maps to encode: `base` colours alone, or `all` maps of material sets with alpha."""


def reduce_texture(texture: SourceTexture, size: int) -> SourceTexture:
    """Return `texture` reduced to at most `size` texels a side, with the same aspect to the nearest texel; unchanged when it fits.

    A box filter is used, as for mips: colours in linear light, normals as vectors, alpha (the last of two or four channels of a base
    colour) and other maps as stored. The pixel hash stays that of the original. Raises InputError for a size below 1.
    """
    if size < 1:
        raise InputError(f"texture size {size}: must be at least 1 texel")
    width, height = reduced_size(*texture.size, size)
    if (width, height) == texture.size:
        return texture
    # Transposed, because rows are filtered before columns: the order decides the rounding that existing packs were encoded with.
    small = resize_to(texture.pixels.transpose(1, 0, 2), height, width, texture.color_space, texture.maps)
    return replace(texture, pixels=np.ascontiguousarray(small.transpose(1, 0, 2)))


def _whole(texture: SceneTexture) -> NDArray[np.uint8]:
    """Return [H, W, C] the channels of all maps of `texture`, then its alpha."""
    base = [texture.pixels] if "base" in texture.maps else []
    further = [texture.further_maps[name] for name in texture.maps if name != "base"]
    alpha = [] if texture.alpha is None else [texture.alpha[..., None]]
    return np.concatenate([*base, *further, *alpha], axis=2)


def without_alpha(texture: SourceTexture) -> SourceTexture:
    """Return `texture` without the map `alpha`, the form in older packs and packs of base colours."""
    if "alpha" not in texture.maps:
        return texture
    return replace(texture, pixels=np.ascontiguousarray(texture.pixels[..., :-1]), maps=texture.maps[:-1], cutoff=None)


def _cutoffs(scene: Scene) -> dict[int, float]:
    """Return the alpha from which on texels are opaque, by the id of each texture that is a mask in all materials with alpha."""
    cutoffs: dict[int, float] = {}
    blended = {material.texture_id for material in scene.materials if material.alpha_mode == "blend"}
    for material in scene.materials:
        opacity = material.factor[3]
        if (
            material.alpha_mode == "mask"
            and material.texture_id not in blended
            and 0.0 < material.alpha_cutoff <= opacity
        ):
            cutoffs.setdefault(material.texture_id, material.alpha_cutoff / opacity)
    return cutoffs


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
    """Return whether `source_textures` includes the texture."""
    return maps == "all" or "base" in texture.maps


def source_texture(scene: Scene, index: int, size: int | None, maps: MapChoice = "base") -> SourceTexture:
    """Return the texture of `scene` with the id `index`, in the form of `source_textures`."""
    return _source(scene, index, _wraps(scene), _cutoffs(scene), size, maps)


def source_maps(texture: SceneTexture, maps: MapChoice) -> tuple[MapName, ...]:
    """Return the maps of `texture` that `source_textures` returns."""
    if maps == "base" or (texture.maps == BASE_ALONE and not texture.has_alpha):
        return BASE_ALONE
    return (*texture.maps, "alpha") if texture.has_alpha else texture.maps


def _source(
    scene: Scene,
    index: int,
    wraps: Mapping[int, tuple[WrapMode, WrapMode]],
    cutoffs: Mapping[int, float],
    size: int | None,
    maps: MapChoice,
) -> SourceTexture:
    texture = scene.textures[index]
    texture_maps = source_maps(texture, maps)
    is_set = texture_maps != BASE_ALONE
    whole = SourceTexture(
        name=texture.name,
        pixels=_whole(texture) if is_set else texture.pixels,
        pixel_hash=texture.set_hash or texture.pixel_hash if is_set else texture.pixel_hash,
        wrap=wraps.get(index, ("repeat", "repeat")),
        category=texture.category,
        maps=texture_maps,
        cutoff=cutoffs.get(index) if "alpha" in texture_maps else None,
    )
    return whole if size is None else reduce_texture(whole, size)


def source_textures(
    scene: Scene, size: int | None, maps: MapChoice = "base", only: Collection[int] | None = None
) -> tuple[SourceTexture, ...]:
    """Return the textures of `scene` in the order of their ids, reduced to at most `size` texels a side unless it is None.

    `maps`: `base` returns base colours (RGB) and leaves out textures without one, whose ids are the last. `all` returns all textures
    with all their maps, and alpha where a material reads it; the hash of a material set is then `SceneTexture.set_hash`. `only`: ids
    of the textures to return; None for all. Wrap modes and the cutoff of alpha are those of the first material that uses the texture.
    Raises InputError for a size below 1.
    """
    wraps, cutoffs = _wraps(scene), _cutoffs(scene)
    chosen = [
        index
        for index, texture in enumerate(scene.textures)
        if has_source(texture, maps) and (only is None or index in only)
    ]
    return tuple(map_in_threads(lambda index: _source(scene, index, wraps, cutoffs, size, maps), chosen))
