"""What a glTF sampler that is not trilinear makes of a place and a level of detail, in float64 (OpenGL 4.3, Sec. 8.14)."""

import numpy as np
from numpy.typing import NDArray

from ntc import reference
from ntc.latents import latent_levels
from ntc.pack import Pack
from viewer.scene.model import Sampler

Array = NDArray[np.float64]


def selected_lod(lod: Array, sampler: Sampler, levels: int) -> tuple[Array, NDArray[np.bool_]]:
    """([N] level of detail that is read, [N] whether the filter within a level is linear) for `lod` [N], of `levels` levels.

    A trilinear level of detail may lie beyond the last level: the texel that is nearest there is as large as that of a whole
    pyramid. Decoding ends at the last level.
    """
    magnified = lod <= 0.0
    linear = np.where(magnified, sampler.magnify_linear, sampler.minify_linear).astype(bool)
    if sampler.mipmap == "none":
        return np.zeros_like(lod), linear
    if sampler.mipmap == "nearest":
        lod = np.clip(np.ceil(lod + 0.5) - 1.0, 0.0, levels - 1)
    return np.where(magnified, 0.0, lod), linear


def decode_filtered(pack: Pack, texture_index: int, uv: Array, lod: Array, sampler: Sampler) -> Array:
    """[N, channels] float64 in [0, 1], in the texture's colour space: what decode paths show with `sampler` at `uv` [N, 2], `lod` [N].

    Where a filter takes the nearest texel or level, a decoder in fp32 may take another one for a place right between two.
    """
    texture = pack.textures[texture_index]
    levels = latent_levels(texture.width, texture.height, pack.config)
    read, linear = selected_lod(lod, sampler, len(levels))
    size = np.array([texture.width, texture.height], np.float64)
    texels = np.maximum(np.floor(size * np.exp2(-np.floor(read))[:, None]), 1.0)
    uv = np.where(linear[:, None], uv, (np.floor(uv * texels) + 0.5) / texels)
    return reference.decode_texels(pack, texture_index, uv, read, sampler.wrap)
