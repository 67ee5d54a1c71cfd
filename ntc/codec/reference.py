"""The slow twin of every decoder: docs/codec.md in numpy float64, written for reading."""

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray

from ntc.codec.block.reference import decode_image as decode_block_image
from ntc.codec.block.reference import texel_values
from ntc.codec.block_pack import block_texture
from ntc.codec.config import LOD_INPUT_SCALE, CodecConfig, WrapMode
from ntc.codec.latents import LatentLevel, latent_levels
from ntc.codec.model import Adapter, Decoder, EncodedTexture, Pack, specialised_layers

Array = NDArray[np.float64]
TexelDecoder = Callable[[int, Array, Array], NDArray[np.floating]]
"""(texture index, uv [N, 2], lod [N]) -> [N, channels] in [0, 1]."""
PHASES = (0.0, 0.25)
"""Of the triangle waves, in turns."""
TEXELS_AT_ONCE = 1 << 16
"""Texels decoded together, to bound memory."""


def wrap_coordinate(coordinate: Array, mode: WrapMode) -> Array:
    """Texture coordinates [N] wrapped into [0, 1]."""
    if mode == "repeat":
        return coordinate - np.floor(coordinate)
    if mode == "clamp":
        return np.clip(coordinate, 0.0, 1.0)
    turned = coordinate - 2.0 * np.floor(coordinate / 2.0)
    return np.where(turned > 1.0, 2.0 - turned, turned)


def _neighbour(cell: NDArray[np.int64], cells: int, mode: WrapMode) -> NDArray[np.int64]:
    return cell % cells if mode == "repeat" else np.clip(cell, 0, cells - 1)


def _bilinear(
    fetch: Callable[[NDArray[np.int64], NDArray[np.int64]], Array],
    size: tuple[int, int],
    uv: Array,
    wrap: tuple[WrapMode, WrapMode],
) -> Array:
    """[N, K] at wrapped `uv` [N, 2] of a grid of `size` (along u, along v), whose values `fetch` gives by column and row."""
    x, y = uv[:, 0] * size[0] - 0.5, uv[:, 1] * size[1] - 0.5
    left, top = np.floor(x).astype(np.int64), np.floor(y).astype(np.int64)
    fraction_x, fraction_y = (x - left)[:, None], (y - top)[:, None]

    def value(column: NDArray[np.int64], row: NDArray[np.int64]) -> Array:
        return fetch(_neighbour(column, size[0], wrap[0]), _neighbour(row, size[1], wrap[1]))

    upper = value(left, top) * (1.0 - fraction_x) + value(left + 1, top) * fraction_x
    lower = value(left, top + 1) * (1.0 - fraction_x) + value(left + 1, top + 1) * fraction_x
    return upper * (1.0 - fraction_y) + lower * fraction_y


def _trilinear(
    levels: Sequence[LatentLevel],
    sample: Callable[[LatentLevel, Array], Array],
    width: int,
    uv: Array,
    lod: Array,
    wrap: tuple[WrapMode, WrapMode],
) -> Array:
    """[N, width]: what `sample` gives for a level and wrapped `uv` [N, 2], blended between the two levels around `lod` [N], which
    lies in their range."""
    uv = np.where(np.isfinite(uv), uv, 0.0)
    wrapped = np.stack([wrap_coordinate(uv[:, axis], wrap[axis]) for axis in range(2)], axis=-1)
    lower = np.floor(lod).astype(np.int64)
    upper = np.minimum(lower + 1, len(levels) - 1)
    share = lod - lower
    blended = np.zeros((len(uv), width))
    for number, level in enumerate(levels):
        weight = np.where(lower == number, 1.0 - share, 0.0) + np.where(upper == number, share, 0.0)
        used = np.nonzero(weight)[0]
        if used.size:
            blended[used] += sample(level, wrapped[used]) * weight[used, None]
    return blended


def _clamped_lod(lod: Array, levels: int) -> Array:
    return np.clip(np.where(np.isfinite(lod), lod, 0.0), 0.0, levels - 1)


def triangle_wave(turns: NDArray[np.float64]) -> NDArray[np.float64]:
    """Triangle wave of period 1 in [-1, 1]: 1 at 0, -1 at 0.5."""
    return 4.0 * np.abs(turns - np.floor(turns) - 0.5) - 1.0


def positional_encoding(texel_coordinates: NDArray[np.float64], octaves: int) -> NDArray[np.float64]:
    """[N, octaves * 4] of `texel_coordinates` [N, 2]: for each axis, each octave, each phase one wave."""
    waves = [
        triangle_wave(texel_coordinates[:, axis] / 2.0 ** (octave + 1) + phase)
        for axis in range(2)
        for octave in range(octaves)
        for phase in PHASES
    ]
    return np.stack(waves, axis=-1)


def run_decoder(decoder: Decoder, inputs: Array, leaky_slope: float, adapter: Adapter | None = None) -> Array:
    """[N, outputs] of the three linear layers for `inputs` [N, decoder_inputs], not clamped."""
    values = inputs
    for index, (weight, scale, bias) in enumerate(specialised_layers(decoder, adapter)):
        values = values @ weight.astype(np.float64).T
        if scale is not None:
            values = values * scale.astype(np.float64)
        values = values + bias.astype(np.float64)
        if index + 1 < len(decoder.weights):
            values = np.where(values > 0.0, values, values * leaky_slope)
    return values


def decoder_inputs(
    pack: Pack, texture: EncodedTexture, uv: Array, lod: Array, wrap: tuple[WrapMode, WrapMode]
) -> Array:
    """[N, decoder_inputs]: what the decoder of a pack of codec `grid` reads at `uv` [N, 2] and `lod` [N] (docs/codec.md,
    steps 1 to 4)."""
    config = pack.grid_config
    levels = latent_levels(texture.width, texture.height, config)
    lod = _clamped_lod(lod, len(levels))
    values = texture.offset.astype(np.float64) + texture.scale.astype(np.float64) * texture.latents

    def of_level(level: LatentLevel, at: Array) -> Array:
        def cell(column: NDArray[np.int64], row: NDArray[np.int64]) -> Array:
            return np.asarray(values[level.first_cell + row * level.width + column])

        texels = at * np.array([level.texel_width, level.texel_height], np.float64)
        latents = _bilinear(cell, (level.width, level.height), at, wrap)
        return np.concatenate([latents, positional_encoding(texels, config.positional_octaves)], axis=-1)

    width = config.latent_channels + config.positional_inputs
    features = _trilinear(levels, of_level, width, uv, lod, wrap)
    if config.lod_inputs:
        features = np.concatenate([features, lod[:, None] * LOD_INPUT_SCALE], axis=-1)
    return features


def _block_values(pack: Pack, texture: EncodedTexture, uv: Array, lod: Array, wrap: tuple[WrapMode, WrapMode]) -> Array:
    """[N, output_channels], not clamped: codec `block` blends decoded texels."""
    config, decoder = pack.block_config, pack.block_decoders[texture.group]
    levels = latent_levels(texture.width, texture.height, config)
    stored = block_texture(texture, config)

    def of_level(level: LatentLevel, at: Array) -> Array:
        def texel(column: NDArray[np.int64], row: NDArray[np.int64]) -> Array:
            return texel_values(stored, decoder, config, levels.index(level), column, row)

        return _bilinear(texel, (level.texel_width, level.texel_height), at, wrap)

    return _trilinear(levels, of_level, config.output_channels, uv, _clamped_lod(lod, len(levels)), wrap)


def decode_texels(
    pack: Pack, texture_index: int, uv: Array, lod: Array, wrap: tuple[WrapMode, WrapMode] | None = None
) -> Array:
    """[N, channels] float64 in [0, 1], in the texture's colour space, at `uv` [N, 2] and `lod` [N].

    `wrap` None takes the texture's own modes.
    """
    texture = pack.textures[texture_index]
    modes = texture.wrap if wrap is None else wrap
    parts = [np.zeros((0, pack.config.output_channels))]
    for start in range(0, len(uv), TEXELS_AT_ONCE):
        part = slice(start, start + TEXELS_AT_ONCE)
        at, levels = np.asarray(uv[part], np.float64), np.asarray(lod[part], np.float64)
        if isinstance(pack.config, CodecConfig):
            inputs = decoder_inputs(pack, texture, at, levels, modes)
            decoder = pack.grid_decoders[texture.group]
            parts.append(run_decoder(decoder, inputs, pack.config.leaky_slope, texture.adapter))
        else:
            parts.append(_block_values(pack, texture, at, levels, modes))
    return np.clip(np.concatenate(parts), 0.0, 1.0)[:, texture.places(pack.config)]


def texel_centres(width: int, height: int) -> Array:
    """[height * width, 2] float64 texture coordinates of all texel centres, row by row."""
    u, v = (np.arange(width) + 0.5) / width, (np.arange(height) + 0.5) / height
    return np.stack([np.tile(u, height), np.repeat(v, width)], axis=-1)


def image_of_texels(pack: Pack, texture_index: int, level: int, decode: TexelDecoder) -> NDArray[np.uint8]:
    """[h, w, channels] uint8 in the texture's colour space: mip `level` of the texture, which `decode` gives at its texel centres."""
    texture = pack.textures[texture_index]
    geometry = latent_levels(texture.width, texture.height, pack.config)[level]
    uv = texel_centres(geometry.texel_width, geometry.texel_height)
    values = decode(texture_index, uv, np.full(len(uv), float(level)))
    return np.asarray(np.rint(values * 255.0), np.uint8).reshape(geometry.texel_height, geometry.texel_width, -1)


def decode_image(pack: Pack, texture_index: int, level: int = 0) -> NDArray[np.uint8]:
    """[h, w, channels] uint8 in the texture's colour space: mip `level` of the texture, decoded at its texel centres."""
    if isinstance(pack.config, CodecConfig):
        return image_of_texels(pack, texture_index, level, partial(decode_texels, pack))
    texture = pack.textures[texture_index]
    decoder = pack.block_decoders[texture.group]
    image = decode_block_image(block_texture(texture, pack.config), decoder, pack.config, level)
    return image[..., texture.places(pack.config)]
