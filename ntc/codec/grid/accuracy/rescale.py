"""Rescaling of decoders by powers of two, which keeps sums in the range of halves (docs/explanation/accuracy.md#rescaling).

LeakyReLU(2^-k x) = 2^-k LeakyReLU(x). So a hidden layer's weights and biases can be multiplied by 2^-k, and the next layer's weights
by 2^k: the decoded values are exactly the same, unless a weight leaves the range of fp32. The exponents come from bounds of the sums,
and those from the ranges of the decoder's inputs.
"""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ntc.codec.config import LARGEST_HALF, Precision
from ntc.codec.grid.model import LOD_INPUT_SCALE, Adapter, GridConfig, GridDecoder, GridTexture, grid_parts
from ntc.codec.grid.reference import PHASES
from ntc.codec.latents import LatentLevel, texture_levels
from ntc.codec.model import Pack

Array = NDArray[np.float64]
SINGLE_UNIT = 2.0**-24
"""Relative error of a rounding to fp32."""
COORDINATE_ERROR = 2.0**-32
"""Largest error of a wrapped coordinate: shaders hold it in steps of 2^-32 (shaders/ntc/position.glsl)."""


@dataclass(frozen=True, eq=False)
class InputBounds:
    """Ranges of a decoder's inputs, in their order, over all positions and levels of detail of one texture."""

    low: Array
    """[inputs] smallest exact value."""
    high: Array
    """[inputs] largest exact value."""
    error: Array
    """[inputs] largest error of the value that a shader computes in fp32."""
    waves: slice
    """Positional inputs, in pairs of phases: the magnitudes of a pair sum to at most 1."""

    @property
    def magnitude(self) -> Array:
        """[inputs] largest exact magnitude."""
        return np.maximum(np.abs(self.low), np.abs(self.high))

    def spread(self, weight: Array) -> Array:
        """Return [N]: half the range of `weight` [N, inputs] @ exact inputs."""
        radius = (self.high - self.low) / 2.0
        radius[self.waves] = 0.0
        return np.abs(weight) @ radius + self._waves(np.abs(weight), 1.0)

    def largest_sum(self, weight: Array, error: Array) -> Array:
        """Return [N]: the largest sum of |weight| * |input| for `weight` [N, inputs] and inputs that are off by `error` [inputs]."""
        magnitude = self.magnitude + error
        magnitude[self.waves] = error[self.waves]
        return np.abs(weight) @ magnitude + self._waves(np.abs(weight), 1.0)

    def _waves(self, magnitudes: Array, largest: float) -> Array:
        """Return [N]: the largest sum over the positional inputs. Of the two phases of a pair, only one can be at its largest."""
        pairs = magnitudes[:, self.waves].reshape(len(magnitudes), -1, len(PHASES))
        return np.asarray(pairs.max(axis=-1).sum(axis=-1) * largest)


def _level_errors(level: LatentLevel, config: GridConfig) -> tuple[float, Array]:
    """Return (error of a filtered latent in steps of stored integers, [positional_inputs] errors of the waves) at one level."""
    stored = 0.0
    waves = []
    cells, texels = (level.width, level.height), (level.texel_width, level.texel_height)
    for axis in range(2):
        place = cells[axis] * COORDINATE_ERROR + SINGLE_UNIT
        # With one cell the place has no effect. Neighbouring cells differ by at most the largest stored integer.
        stored += config.largest_stored * (place if cells[axis] > 1 else 0.0)
        # Position in texels within the longest period, in fp32.
        longest = 2.0**config.positional_octaves
        turns = texels[axis] * COORDINATE_ERROR + (longest + 1.0) * SINGLE_UNIT
        for octave in range(config.positional_octaves):
            periods = longest / 2.0 ** (octave + 1)
            for phase in PHASES:
                rounding = 0.0 if phase == 0.0 else (periods + 1.0) * SINGLE_UNIT
                # The wave has slope 4. Of its operations only the last two round, near 1.
                waves.append(4.0 * (turns / 2.0 ** (octave + 1) + rounding) + 2.0 * SINGLE_UNIT)
    # Three interpolations of three operations each; 16 instead of 9 leaves room for either way to write one.
    return stored + 16.0 * SINGLE_UNIT * config.largest_stored, np.array(waves)


def input_bounds(texture: GridTexture, config: GridConfig, lod_error: float = 0.0) -> InputBounds:
    """Return the ranges of the decoder's inputs for `texture`, for all latents and all places.

    `lod_error` is the largest error of the lod: 0 where it is given, more where a shader computes a logarithm.
    """
    scale, offset = texture.scale.astype(np.float64), texture.offset.astype(np.float64)
    ends = np.stack([offset, offset + scale * config.largest_stored])
    levels = texture_levels(texture, config)
    last_lod = (len(levels) - 1) * LOD_INPUT_SCALE
    ones = np.ones(config.positional_inputs)
    lods = np.full(config.lod_inputs, last_lod)
    low = np.concatenate([ends.min(axis=0), -ones, 0.0 * lods])
    high = np.concatenate([ends.max(axis=0), ones, lods])
    errors = [_level_errors(level, config) for level in levels]
    stored = max(error for error, _ in errors)
    # Scale, offset, weights of two levels and their sum: at most six roundings.
    reach = np.abs(offset) + np.abs(scale) * config.largest_stored
    latents = np.abs(scale) * stored + 6.0 * SINGLE_UNIT * reach
    waves = np.max([waves for _, waves in errors], axis=0) + 4.0 * SINGLE_UNIT
    error = np.concatenate([latents, waves, np.zeros(config.lod_inputs)])
    # Features are linear in lod between two levels.
    error += lod_error * np.concatenate([(high - low)[: -len(lods) or None], np.full(len(lods), LOD_INPUT_SCALE)])
    first = config.latent_channels
    # A driver may flush denormals to 0; they are smaller than this.
    return InputBounds(low, high, error + 2.0**-120, slice(first, first + config.positional_inputs))


LARGEST_SUM = 2.0**15
"""Sums are scaled until their bound is below this: half of the largest half, which leaves room for roundings."""
SMALLEST_SUM = 1.0
"""Sums are scaled up until their bound is at least this, because halves below 2^-14 lose digits."""
SMALLEST_WEIGHT = 2.0**-9
"""A layer whose largest weight is below this is rescaled for `fp16`: 32 times the smallest half that has all its digits."""
LARGEST_SINGLE = 3.4e38
"""Largest fp32 number, rounded down."""
LARGEST_EXPONENT = 96
"""Largest exponent by which layers are scaled: beyond it, fp32 may overflow as well."""


@dataclass(frozen=True)
class Exponents:
    """Exponents k by which a decoder's hidden layers are rescaled: a layer's outputs are multiplied by 2^-k."""

    first: int = 0
    second: int = 0


def _adapted(sums: Array, adapter: Adapter | None, bias: NDArray[np.float32], layer: int) -> tuple[Array, Array]:
    """Return ([neurons] bounds of a hidden layer's sums, [neurons] bounds of its outputs); `sums` bounds the sums of products."""
    if adapter is None:
        whole = sums + np.abs(bias)
        return whole, whole
    adapted = np.abs(adapter.scales[layer]) * sums + np.abs(adapter.biases[layer])
    return np.maximum(sums, adapted), adapted


def _largest_sums(decoder: GridDecoder, adapter: Adapter | None, inputs: InputBounds) -> tuple[float, float]:
    """Return the bounds of all sums in the first and the second hidden layer."""
    weights = [weight.astype(np.float64) for weight in decoder.weights]
    first, hidden = _adapted(inputs.largest_sum(weights[0], inputs.error), adapter, decoder.biases[0], 0)
    second, _ = _adapted(np.abs(weights[1]) @ hidden, adapter, decoder.biases[1], 1)
    return float(first.max()), float(second.max())


def _exponent(largest: float, smallest_sum: float) -> int:
    """Return the smallest exponent that brings the bound `largest` into range; 0 where it is in range."""
    if not math.isfinite(largest) or largest == 0.0:
        return 0
    exponent = 0
    if largest >= LARGEST_SUM:
        exponent = math.frexp(largest / LARGEST_SUM)[1]
    elif largest < smallest_sum:
        exponent = math.frexp(largest / smallest_sum)[1] - 1
    return max(-LARGEST_EXPONENT, min(LARGEST_EXPONENT, exponent))


def exponents(pack: Pack) -> list[Exponents]:
    """Return for each decoder the exponents that keep the sums of its textures in range, for all latents."""
    largest = np.zeros((len(pack.decoders), 2))
    for texture in grid_parts(pack).textures:
        sums = _largest_sums(
            grid_parts(pack).decoders[texture.group], texture.adapter, input_bounds(texture, grid_parts(pack).config)
        )
        largest[texture.group] = np.maximum(largest[texture.group], sums)
    return [Exponents(_exponent(first, SMALLEST_SUM), _exponent(second, SMALLEST_SUM)) for first, second in largest]


def _times(values: NDArray[np.float32], exponent: int) -> NDArray[np.float32]:
    if exponent == 0:
        return values
    with np.errstate(over="ignore", under="ignore"):
        return np.clip(np.ldexp(values.astype(np.float64), exponent), -LARGEST_SINGLE, LARGEST_SINGLE).astype(
            np.float32
        )


def _rescaled_decoder(decoder: GridDecoder, by: Exponents) -> GridDecoder:
    first, second, third = decoder.weights
    weights = (_times(first, -by.first), _times(second, by.first - by.second), _times(third, by.second))
    biases = (_times(decoder.biases[0], -by.first), _times(decoder.biases[1], -by.second), decoder.biases[2])
    return GridDecoder(weights, biases)


def _rescaled_texture(texture: GridTexture, by: Exponents) -> GridTexture:
    """Return `texture` for a rescaled decoder: its adapter's biases are scaled as the decoder's, its scales stay."""
    adapter = texture.adapter
    if adapter is None or by == Exponents():
        return texture
    output = None if adapter.output_weight is None else _times(adapter.output_weight, by.second)
    biases = np.stack([_times(adapter.biases[0], -by.first), _times(adapter.biases[1], -by.second)])
    return replace(texture, adapter=replace(adapter, biases=biases, output_weight=output))


def rescaled_pack(pack: Pack) -> Pack:
    """Return `pack` with sums in the range of halves; it decodes to the same values. A pack in range is returned unchanged."""
    by = exponents(pack)
    if all(one == Exponents() for one in by):
        return pack
    decoders = tuple(
        _rescaled_decoder(decoder, scaling) for decoder, scaling in zip(grid_parts(pack).decoders, by, strict=True)
    )
    textures = tuple(_rescaled_texture(texture, by[texture.group]) for texture in grid_parts(pack).textures)
    return replace(pack, decoders=decoders, textures=textures)


def _halves_are_enough(pack: Pack) -> bool:
    """Return whether all weights fit into halves, without a layer so small that halves would lose its digits."""
    weights = [part for decoder in grid_parts(pack).decoders for part in decoder.weights]
    others = [part for decoder in grid_parts(pack).decoders for part in decoder.biases]
    for texture in grid_parts(pack).textures:
        if texture.adapter is not None:
            others += [texture.adapter.scales, texture.adapter.biases]
    largest = [float(np.abs(part).max(initial=0.0)) for part in weights]
    fit = all(float(np.abs(part).max(initial=0.0)) <= LARGEST_HALF for part in others)
    return fit and all(size == 0.0 or SMALLEST_WEIGHT <= size <= LARGEST_HALF for size in largest)


def stored_pack(pack: Pack, precision: Precision) -> Pack:
    """Return `pack` as it is stored for decoding in `precision`, before weights are rounded to halves: rescaled where needed.

    `fp16` computes in fp32, so it needs rescaling only if weights are too large or too small for halves.
    """
    if precision == "fp32" or (precision == "fp16" and _halves_are_enough(pack)):
        return pack
    return rescaled_pack(pack)
