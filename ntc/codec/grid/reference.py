"""Reference decoder of codec `grid` in numpy float64: slow and written for reading. All fast decoders are tested against it.

Specification: docs/reference/codec-grid.md.
"""

import numpy as np
from numpy.typing import NDArray

from ntc.codec.config import WrapMode
from ntc.codec.grid.model import LOD_INPUT_SCALE, Adapter, GridDecoder, GridTexture, grid_parts, specialised_layers
from ntc.codec.latents import LatentLevel, texture_levels
from ntc.codec.model import Pack
from ntc.codec.sampling import Array, bilinear, clamped_lod, trilinear

PHASES = (0.0, 0.25)
"""Phases of the triangle waves, in turns."""


def triangle_wave(turns: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the triangle wave of period 1 in [-1, 1] at `turns`: 1 at 0, -1 at 0.5."""
    return 4.0 * np.abs(turns - np.floor(turns) - 0.5) - 1.0


def positional_encoding(texel_coordinates: NDArray[np.float64], octaves: int) -> NDArray[np.float64]:
    """Return [N, octaves * 4] of `texel_coordinates` [N, 2]: one wave for each axis, octave and phase, in this order."""
    waves = [
        triangle_wave(texel_coordinates[:, axis] / 2.0 ** (octave + 1) + phase)
        for axis in range(2)
        for octave in range(octaves)
        for phase in PHASES
    ]
    return np.stack(waves, axis=-1)


def run_decoder(decoder: GridDecoder, inputs: Array, leaky_slope: float, adapter: Adapter | None = None) -> Array:
    """Run the network: [N, outputs], not clamped, for `inputs` [N, decoder_inputs]."""
    values = inputs
    for index, (weight, scale, bias) in enumerate(specialised_layers(decoder, adapter)):
        values = values @ weight.astype(np.float64).T
        if scale is not None:
            values = values * scale.astype(np.float64)
        values = values + bias.astype(np.float64)
        if index + 1 < len(decoder.weights):
            values = np.where(values > 0.0, values, values * leaky_slope)
    return values


def decoder_inputs(pack: Pack, texture: GridTexture, uv: Array, lod: Array, wrap: tuple[WrapMode, WrapMode]) -> Array:
    """Return [N, decoder_inputs]: blended latents, positional encoding and lod of `texture` at `uv` [N, 2] and `lod` [N]."""
    config = grid_parts(pack).config
    levels = texture_levels(texture, config)
    lod = clamped_lod(lod, len(levels))
    values = texture.offset.astype(np.float64) + texture.scale.astype(np.float64) * texture.latents

    def of_level(level: LatentLevel, at: Array) -> Array:
        def cell(column: NDArray[np.int64], row: NDArray[np.int64]) -> Array:
            return np.asarray(values[level.first_cell + row * level.width + column])

        texels = at * np.array([level.texel_width, level.texel_height], np.float64)
        latents = bilinear(cell, (level.width, level.height), at, wrap)
        return np.concatenate([latents, positional_encoding(texels, config.positional_octaves)], axis=-1)

    width = config.latent_channels + config.positional_inputs
    features = trilinear(levels, of_level, width, uv, lod, wrap)
    if config.lod_inputs:
        features = np.concatenate([features, lod[:, None] * LOD_INPUT_SCALE], axis=-1)
    return features
