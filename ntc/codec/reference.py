"""Decoding in numpy float64, for every codec: the slow twin that fast decoders are compared with."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from ntc.codec.config import WrapMode
from ntc.codec.latents import texture_levels
from ntc.codec.model import Pack
from ntc.codec.registry import codec_of
from ntc.codec.sampling import Array
from ntc.codec.sampling import texel_centres as texel_centres

TexelDecoder = Callable[[int, Array, Array], NDArray[np.floating]]
"""(texture index, uv [N, 2], lod [N]) -> [N, channels] in [0, 1]."""
TEXELS_AT_ONCE = 1 << 16
"""Texels decoded together, to bound memory."""


def decode_texels(
    pack: Pack, texture_index: int, uv: Array, lod: Array, wrap: tuple[WrapMode, WrapMode] | None = None
) -> Array:
    """Return [N, channels] float64 in [0, 1], in the texture's colour space, at `uv` [N, 2] and `lod` [N].

    `wrap` None takes the texture's own modes.
    """
    texture = pack.textures[texture_index]
    codec, modes = codec_of(pack.config), texture.wrap if wrap is None else wrap
    parts = [np.zeros((0, pack.config.output_channels))]
    for start in range(0, len(uv), TEXELS_AT_ONCE):
        part = slice(start, start + TEXELS_AT_ONCE)
        at, levels = np.asarray(uv[part], np.float64), np.asarray(lod[part], np.float64)
        parts.append(codec.reference_values(pack, texture_index, at, levels, modes))
    return np.clip(np.concatenate(parts), 0.0, 1.0)[:, texture.places(pack.config)]


def image_of_texels(pack: Pack, texture_index: int, level: int, decode: TexelDecoder) -> NDArray[np.uint8]:
    """Return [h, w, channels] uint8 in the texture's colour space: mip `level` of the texture, which `decode` gives at its texel
    centres."""
    texture = pack.textures[texture_index]
    geometry = texture_levels(texture, pack.config)[level]
    uv = texel_centres(geometry.texel_width, geometry.texel_height)
    values = decode(texture_index, uv, np.full(len(uv), float(level)))
    return np.asarray(np.rint(values * 255.0), np.uint8).reshape(geometry.texel_height, geometry.texel_width, -1)


def decode_mip(pack: Pack, texture_index: int, level: int = 0) -> Array:
    """Return [h, w, channels] float64 in [0, 1], in the texture's colour space: mip `level`, decoded at its texel centres."""
    whole = codec_of(pack.config).reference_mip(pack, texture_index, level)
    if whole is not None:
        return whole
    texture = pack.textures[texture_index]
    size = texture_levels(texture, pack.config)[level]
    uv = texel_centres(size.texel_width, size.texel_height)
    values = decode_texels(pack, texture_index, uv, np.full(len(uv), float(level)))
    return values.reshape(size.texel_height, size.texel_width, -1)


def decode_image(pack: Pack, texture_index: int, level: int = 0) -> NDArray[np.uint8]:
    """Return [h, w, channels] uint8 in the texture's colour space: mip `level` of the texture, decoded at its texel centres."""
    return np.asarray(np.rint(decode_mip(pack, texture_index, level) * 255.0), np.uint8)
