"""Ranges of the inputs of a decoder over a whole texture, and the error of fp32 in them (docs/explanation/accuracy.md)."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ntc.codec.grid.config import LOD_INPUT_SCALE, GridConfig
from ntc.codec.grid.model import GridTexture
from ntc.codec.grid.reference import PHASES
from ntc.codec.latents import LatentLevel, latent_levels

Array = NDArray[np.float64]
SINGLE_UNIT = 2.0**-24
"""Relative error of a rounding to fp32."""
COORDINATE_ERROR = 2.0**-32
"""Largest error of a wrapped coordinate, which shaders hold in such steps (shaders/ntc/position.glsl)."""


@dataclass(frozen=True, eq=False)
class InputBounds:
    """Of all inputs of a decoder, in its order, at any position and any level of detail of one texture."""

    low: Array
    """[inputs] smallest exact value."""
    high: Array
    """[inputs] largest exact value."""
    error: Array
    """[inputs] largest difference between the exact value and the one that a shader computes in fp32."""
    waves: slice
    """The positional inputs: pairs of phases whose magnitudes sum to at most 1."""

    @property
    def magnitude(self) -> Array:
        """[inputs] largest exact magnitude."""
        return np.maximum(np.abs(self.low), np.abs(self.high))

    def spread(self, weight: Array) -> Array:
        """[N] half the range of `weight` [N, inputs] times the exact inputs."""
        radius = (self.high - self.low) / 2.0
        radius[self.waves] = 0.0
        return np.abs(weight) @ radius + self._waves(np.abs(weight), 1.0)

    def largest_sum(self, weight: Array, error: Array) -> Array:
        """[N] largest sum of the magnitudes of the products of `weight` [N, inputs] with inputs that are off by `error`."""
        magnitude = self.magnitude + error
        magnitude[self.waves] = error[self.waves]
        return np.abs(weight) @ magnitude + self._waves(np.abs(weight), 1.0)

    def _waves(self, magnitudes: Array, largest: float) -> Array:
        """[N] largest sum over the positional inputs: of each pair of phases only one can be at its largest."""
        pairs = magnitudes[:, self.waves].reshape(len(magnitudes), -1, len(PHASES))
        return np.asarray(pairs.max(axis=-1).sum(axis=-1) * largest)


def _level_errors(level: LatentLevel, config: GridConfig) -> tuple[float, Array]:
    """(error of a filtered stored latent in stored steps, [positional_inputs] errors of the waves) at one level."""
    stored = 0.0
    waves = []
    cells, texels = (level.width, level.height), (level.texel_width, level.texel_height)
    for axis in range(2):
        place = cells[axis] * COORDINATE_ERROR + SINGLE_UNIT
        # With one cell the place is of no effect. Neighbouring cells differ by at most the largest stored number.
        stored += config.largest_stored * (place if cells[axis] > 1 else 0.0)
        # Texels within the longest period, as fp32.
        longest = 2.0**config.positional_octaves
        turns = texels[axis] * COORDINATE_ERROR + (longest + 1.0) * SINGLE_UNIT
        for octave in range(config.positional_octaves):
            periods = longest / 2.0 ** (octave + 1)
            for phase in PHASES:
                rounding = 0.0 if phase == 0.0 else (periods + 1.0) * SINGLE_UNIT
                # The wave has slope 4; of its own operations only the last ones round, near 1.
                waves.append(4.0 * (turns / 2.0 ** (octave + 1) + rounding) + 2.0 * SINGLE_UNIT)
    # Three interpolations, each of three operations, and room for either way to write one.
    return stored + 16.0 * SINGLE_UNIT * config.largest_stored, np.array(waves)


def input_bounds(texture: GridTexture, config: GridConfig, lod_error: float = 0.0) -> InputBounds:
    """Bounds for `texture` whatever its latents are, and wherever it is read.

    `lod_error` is how far the level of detail itself may be off: 0 where it is given, more where a shader takes a logarithm.
    """
    scale, offset = texture.scale.astype(np.float64), texture.offset.astype(np.float64)
    ends = np.stack([offset, offset + scale * config.largest_stored])
    levels = latent_levels(texture.width, texture.height, config)
    last_lod = (len(levels) - 1) * LOD_INPUT_SCALE
    ones = np.ones(config.positional_inputs)
    lods = np.full(config.lod_inputs, last_lod)
    low = np.concatenate([ends.min(axis=0), -ones, 0.0 * lods])
    high = np.concatenate([ends.max(axis=0), ones, lods])
    errors = [_level_errors(level, config) for level in levels]
    stored = max(error for error, _ in errors)
    # Scaling, offset, shares of two levels and their sum: six roundings at most.
    reach = np.abs(offset) + np.abs(scale) * config.largest_stored
    latents = np.abs(scale) * stored + 6.0 * SINGLE_UNIT * reach
    waves = np.max([waves for _, waves in errors], axis=0) + 4.0 * SINGLE_UNIT
    error = np.concatenate([latents, waves, np.zeros(config.lod_inputs)])
    # Features are linear in lod between two levels.
    error += lod_error * np.concatenate([(high - low)[: -len(lods) or None], np.full(len(lods), LOD_INPUT_SCALE)])
    first = config.latent_channels
    # Numbers that a driver takes for 0 are smaller than this.
    return InputBounds(low, high, error + 2.0**-120, slice(first, first + config.positional_inputs))
