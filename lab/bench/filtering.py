"""Filters and wrap modes of glTF samplers in float64, not only trilinear (OpenGL 4.3, Sec. 8.14)."""

import numpy as np
from numpy.typing import NDArray

from ntc.codec import reference
from ntc.codec.config import WrapMode
from ntc.codec.latents import texture_levels
from ntc.codec.mips import linear_to_srgb, srgb_to_linear
from ntc.codec.model import Pack
from viewer.scene.model import Sampler

Array = NDArray[np.float64]


def selected_lod(lod: Array, sampler: Sampler, levels: int) -> tuple[Array, NDArray[np.bool_]]:
    """Return ([N] sampled level of detail, [N] whether the filter within a level is linear) for `lod` [N] and `levels` levels.

    A trilinear level of detail may lie beyond the last level. The nearest texel there is then as large as that of a full pyramid,
    but decoding ends at the last level.
    """
    magnified = lod <= 0.0
    linear = np.where(magnified, sampler.magnify_linear, sampler.minify_linear).astype(bool)
    if sampler.mipmap == "none":
        return np.zeros_like(lod), linear
    if sampler.mipmap == "nearest":
        lod = np.clip(np.ceil(lod + 0.5) - 1.0, 0.0, levels - 1)
    return np.where(magnified, 0.0, lod), linear


def _moved(pack: Pack, texture_index: int, uv: Array, lod: Array, sampler: Sampler) -> tuple[Array, Array]:
    """Return the `uv` [N, 2] and `lod` [N] that `sampler` reads."""
    texture = pack.textures[texture_index]
    levels = texture_levels(texture, pack.config)
    read, linear = selected_lod(lod, sampler, len(levels))
    size = np.array([texture.width, texture.height], np.float64)
    texels = np.maximum(np.floor(size * np.exp2(-np.floor(read))[:, None]), 1.0)
    return np.where(linear[:, None], uv, (np.floor(uv * texels) + 0.5) / texels), read


def decode_filtered(pack: Pack, texture_index: int, uv: Array, lod: Array, sampler: Sampler) -> Array:
    """Return [N, channels] float64 values in [0, 1] of a texture with `sampler` at `uv` [N, 2] and `lod` [N].

    Values are in the texture's colour space: a decode path should show them. With a nearest filter, a decoder in fp32 may take
    another texel or level for coordinates right between two.
    """
    uv, read = _moved(pack, texture_index, uv, lod, sampler)
    return reference.decode_texels(pack, texture_index, uv, read, sampler.wrap)


def wrapped(texel: NDArray[np.int64], size: NDArray[np.int64] | int, mode: WrapMode) -> NDArray[np.int64]:
    """Return [N] texel numbers after wrapping; `size` is the side in texels, one for all or [N]."""
    if mode == "clamp":
        return np.clip(texel, 0, size - 1)
    if mode == "repeat":
        return texel % size
    folded = texel % (2 * size)
    return np.where(folded < size, folded, 2 * size - 1 - folded)


def filter_decoded(pack: Pack, texture_index: int, uv: Array, lod: Array, sampler: Sampler) -> Array:
    """Return the values of `decode_filtered` for path `cached`, which decodes texels first and filters them in linear light.

    Decoded texels are not rounded to 8 bits here, unlike those in the tiles of that path.
    """
    texture = pack.textures[texture_index]
    levels = texture_levels(texture, pack.config)
    uv, read = _moved(pack, texture_index, uv, lod, sampler)
    read = np.clip(read, 0.0, len(levels) - 1.0)
    lower = np.floor(read).astype(np.int64)
    sides = np.array([(level.texel_width, level.texel_height) for level in levels], np.int64)
    total = np.zeros((len(uv), texture.channels))
    for level, share in ((lower, 1.0 - (read - lower)), (np.minimum(lower + 1, len(levels) - 1), read - lower)):
        size = sides[level]
        at = uv * size - 0.5
        corner = np.floor(at).astype(np.int64)
        part = at - corner
        for step in ((0, 0), (1, 0), (0, 1), (1, 1)):
            weight = share.copy()
            texel = np.empty_like(corner)
            for axis in (0, 1):
                weight *= part[:, axis] if step[axis] else 1.0 - part[:, axis]
                texel[:, axis] = wrapped(corner[:, axis] + step[axis], size[:, axis], sampler.wrap[axis])
            centre = (texel + 0.5) / size
            decoded = reference.decode_texels(pack, texture_index, centre, level.astype(np.float64), sampler.wrap)
            total += weight[:, None] * (srgb_to_linear(decoded) if texture.color_space == "srgb" else decoded)
    return np.asarray(linear_to_srgb(total) if texture.color_space == "srgb" else total, np.float64)
