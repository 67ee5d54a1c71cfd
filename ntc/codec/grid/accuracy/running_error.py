"""How far a decoded texel can be from the exact one: a bound for each texel, from the numbers that its decoding meets.

The analysis of `error_bound` with the sums of one texel in place of ranges over all of them (docs/explanation/accuracy.md).
"""

import numpy as np
from numpy.typing import NDArray

from ntc.codec.config import LARGEST_HALF, Precision
from ntc.codec.grid.accuracy.error_bound import OWN_ROUNDING
from ntc.codec.grid.accuracy.input_bounds import input_bounds
from ntc.codec.grid.accuracy.rounding_model import (
    ARITHMETIC,
    HALF,
    LARGEST_SINGLE,
    Arithmetic,
    Layer,
    decoder_layers,
    effective_weight,
    hidden_values,
    sums_of_values,
)
from ntc.codec.grid.model import grid_parts
from ntc.codec.grid.reference import decoder_inputs
from ntc.codec.model import Pack

Array = NDArray[np.float64]


def _running(layers: list[Layer], inputs: Array, error: Array, slope: float, arithmetic: Arithmetic) -> Array:
    """[N, outputs] bounds for exact `inputs` [N, decoder_inputs] that are read with at most `error` [decoder_inputs]."""
    first, second, third = layers
    weight_1, weight_2 = effective_weight(first), effective_weight(second)
    read = np.broadcast_to(error, inputs.shape)
    if arithmetic.factors_are_half:
        read = read + HALF.unit * (np.abs(inputs) + read) + HALF.smallest
    magnitude = np.abs(inputs) + read
    sums_1 = sums_of_values(first, magnitude, arithmetic)
    exact = inputs @ weight_1.T + first.bias
    error_1 = read @ np.abs(weight_1).T + sums_1.local
    hidden_1 = hidden_values(exact, exact, error_1, slope, arithmetic)
    sums_2 = sums_of_values(second, hidden_1.largest, arithmetic)
    exact = hidden_1.low @ weight_2.T + second.bias
    error_2 = (hidden_1.slope_high * error_1 + hidden_1.rounding) @ np.abs(weight_2).T + sums_2.local
    hidden_2 = hidden_values(exact, exact, error_2, slope, arithmetic)
    sums_3 = sums_of_values(third, hidden_2.largest, arithmetic)
    # Where a sum is so near 0 that its sign may differ, the slope is known up to `doubt` only.
    slope_1, doubt_1 = hidden_1.slope, hidden_1.slope_doubt
    slope_2, doubt_2 = hidden_2.slope, hidden_2.slope_doubt
    own_1 = slope_1 * sums_1.local + doubt_1 * error_1 + hidden_1.rounding
    own_2 = slope_2 * sums_2.local + doubt_2 * error_2 + hidden_2.rounding
    result = sums_3.local + own_2 @ np.abs(third.weight).T
    for output, weight_3 in enumerate(third.weight):
        reach_1 = (slope_2 * weight_3) @ weight_2
        reach_0 = (slope_1 * reach_1) @ weight_1
        result[:, output] += np.einsum("ni,ni->n", np.abs(reach_0), read)
        result[:, output] += np.einsum("ni,ni->n", np.abs(reach_1), own_1)
    limit = LARGEST_HALF if arithmetic.factors_are_half else LARGEST_SINGLE
    largest = np.max([sums.largest.max(axis=1) for sums in (sums_1, sums_2, sums_3)], axis=0)
    fits = (largest <= limit) & (magnitude.max(axis=1) <= limit)
    return np.where(fits[:, None] & (result < 1.0), result * OWN_ROUNDING, 1.0)


def running_bounds(
    stored: Pack, texture_index: int, uv: Array, lod: Array, precision: Precision, lod_error: float = 0.0
) -> Array:
    """[N, channels] largest differences from the exact decode at `uv` [N, 2] and `lod` [N], where both are fp32 numbers.

    `stored` is what `ntc.codec.grid.accuracy.rescale.stored_pack` gave; a decoder may read a `lod` that is off by `lod_error`.
    1 where numbers may overflow.
    """
    texture = grid_parts(stored).textures[texture_index]
    arithmetic = ARITHMETIC[precision]
    layers = decoder_layers(grid_parts(stored).decoders[texture.group], texture.adapter, arithmetic)
    inputs = decoder_inputs(stored, texture, uv, lod, texture.wrap)
    error = input_bounds(texture, grid_parts(stored).config, lod_error).error
    with np.errstate(over="ignore", invalid="ignore"):
        return _running(layers, inputs, error, grid_parts(stored).config.leaky_slope, arithmetic)[
            :, texture.places(stored.config)
        ]
