"""Powers of two moved from layer to layer, so that what is computed in halves stays in their range (docs/explanation/accuracy.md).

LeakyReLU(2^-k x) = 2^-k LeakyReLU(x): a hidden layer's weights and biases times 2^-k and the next layer's weights times 2^k
decode the same, exactly, but for weights that leave the range of fp32. The ranges of a decoder's inputs are found first.
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
"""Largest error of a wrapped coordinate, which shaders hold in such steps (shaders/ntc/position.glsl)."""


@dataclass(frozen=True, eq=False)
class InputBounds:
    """Ranges of all inputs of a decoder, in its order, at any position and any level of detail of one texture."""

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
        """Return [N] half the range of `weight` [N, inputs] times the exact inputs."""
        radius = (self.high - self.low) / 2.0
        radius[self.waves] = 0.0
        return np.abs(weight) @ radius + self._waves(np.abs(weight), 1.0)

    def largest_sum(self, weight: Array, error: Array) -> Array:
        """Return [N] largest sum of the magnitudes of the products of `weight` [N, inputs] with inputs that are off by `error`."""
        magnitude = self.magnitude + error
        magnitude[self.waves] = error[self.waves]
        return np.abs(weight) @ magnitude + self._waves(np.abs(weight), 1.0)

    def _waves(self, magnitudes: Array, largest: float) -> Array:
        """Return [N] largest sum over the positional inputs: of each pair of phases only one can be at its largest."""
        pairs = magnitudes[:, self.waves].reshape(len(magnitudes), -1, len(PHASES))
        return np.asarray(pairs.max(axis=-1).sum(axis=-1) * largest)


def _level_errors(level: LatentLevel, config: GridConfig) -> tuple[float, Array]:
    """Return (error of a filtered stored latent in stored steps, [positional_inputs] errors of the waves) at one level."""
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
    """Return the bounds for `texture` whatever its latents are, and wherever it is read.

    `lod_error` is how far the level of detail itself may be off: 0 where it is given, more where a shader takes a logarithm.
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


LARGEST_SUM = 2.0**15
"""Bounds of sums are brought below this: half of the largest half, which leaves room for roundings."""
SMALLEST_SUM = 1.0
"""Bounds of sums below this are brought up to it, for halves below 2^-14 lose digits."""
SMALLEST_WEIGHT = 2.0**-9
"""Least weight that is used, as a share of the largest of a layer: 32 times the smallest half that has all its digits."""
LARGEST_SINGLE = 3.4e38
LARGEST_EXPONENT = 96
"""Largest exponent of two by which layers are scaled: beyond this fp32 ends as well."""


@dataclass(frozen=True)
class Exponents:
    """Hidden layer l of a decoder gives 2^-exponents[l] of what it gave before."""

    first: int = 0
    second: int = 0


def _adapted(sums: Array, adapter: Adapter | None, bias: NDArray[np.float32], layer: int) -> tuple[Array, Array]:
    """Return [neurons] bounds of a hidden layer's sums, and of what it hands on, for `sums` of its products."""
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
    """Return the exponent of the smallest change that brings `largest` into range; 0 where it is there."""
    if not math.isfinite(largest) or largest == 0.0:
        return 0
    exponent = 0
    if largest >= LARGEST_SUM:
        exponent = math.frexp(largest / LARGEST_SUM)[1]
    elif largest < smallest_sum:
        exponent = math.frexp(largest / smallest_sum)[1] - 1
    return max(-LARGEST_EXPONENT, min(LARGEST_EXPONENT, exponent))


def exponents(pack: Pack) -> list[Exponents]:
    """Return for each decoder the exponents that keep the sums of all its textures in range, whatever their latents."""
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
    """Return `texture` for a rescaled decoder: its adapter's biases change with the powers of two in the matrices, its scales do
    not."""
    adapter = texture.adapter
    if adapter is None or by == Exponents():
        return texture
    output = None if adapter.output_weight is None else _times(adapter.output_weight, by.second)
    biases = np.stack([_times(adapter.biases[0], -by.first), _times(adapter.biases[1], -by.second)])
    return replace(texture, adapter=replace(adapter, biases=biases, output_weight=output))


def rescaled_pack(pack: Pack) -> Pack:
    """Return `pack` with sums in the range of halves. It decodes to the same values; a pack that is in range is returned as it is."""
    by = exponents(pack)
    if all(one == Exponents() for one in by):
        return pack
    decoders = tuple(
        _rescaled_decoder(decoder, own) for decoder, own in zip(grid_parts(pack).decoders, by, strict=True)
    )
    textures = tuple(_rescaled_texture(texture, by[texture.group]) for texture in grid_parts(pack).textures)
    return replace(pack, decoders=decoders, textures=textures)


def _halves_are_enough(pack: Pack) -> bool:
    """Return whether all weights fit into halves, and no layer's are so small that halves would keep few digits of them."""
    weights = [part for decoder in grid_parts(pack).decoders for part in decoder.weights]
    others = [part for decoder in grid_parts(pack).decoders for part in decoder.biases]
    for texture in grid_parts(pack).textures:
        if texture.adapter is not None:
            others += [texture.adapter.scales, texture.adapter.biases]
    largest = [float(np.abs(part).max(initial=0.0)) for part in weights]
    fit = all(float(np.abs(part).max(initial=0.0)) <= LARGEST_HALF for part in others)
    return fit and all(size == 0.0 or SMALLEST_WEIGHT <= size <= LARGEST_HALF for size in largest)


def stored_pack(pack: Pack, precision: Precision) -> Pack:
    """Return what of `pack` is stored for decoding in `precision`, before weights are rounded to halves.

    `fp16` computes in fp32: it needs rescaling only where weights themselves are too large or too small for halves.
    """
    if precision == "fp32" or (precision == "fp16" and _halves_are_enough(pack)):
        return pack
    return rescaled_pack(pack)
