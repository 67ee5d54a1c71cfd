"""Certified bounds of decoding errors: how far a decoded value can be from the one in exact arithmetic.

`texture_bounds` needs the weights alone and holds at every texel. `running_bounds` uses the sums at single texels and is much tighter.
Arrays of neurons may have a leading axis of texels. Derivation: docs/explanation/accuracy.md#derivation.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import get_args

import numpy as np
from numpy.typing import NDArray

from ntc.codec.config import LARGEST_HALF, Precision
from ntc.codec.grid.accuracy.rescale import SINGLE_UNIT, InputBounds, input_bounds, stored_pack
from ntc.codec.grid.model import Adapter, GridDecoder, grid_parts, specialised_layers
from ntc.codec.grid.reference import decoder_inputs
from ntc.codec.model import Pack

Array = NDArray[np.float64]
HALF_UNIT = 2.0**-11 * (1.0 + 2.0**-10)
"""Relative error of a rounding to a half. The second factor is for emulated halves, which round to fp32 first."""
SMALLEST_HALF_ERROR = 2.0**-25
"""Largest rounding error of a half below 2^-14, where halves lie 2^-24 apart."""
SMALLEST_SINGLE = 2.0**-126
"""Smallest normal fp32 number: a GPU may flush smaller ones to 0."""
LARGEST_SINGLE = 3.0e38


@dataclass(frozen=True)
class Rounding:
    """Model of a rounding: a result is off by at most `unit` times its magnitude, plus `smallest`."""

    unit: float
    smallest: float


SINGLE = Rounding(SINGLE_UNIT, SMALLEST_SINGLE)
HALF = Rounding(HALF_UNIT, SMALLEST_HALF_ERROR)


@dataclass(frozen=True)
class Arithmetic:
    """The roundings that decoding in one precision makes."""

    stored_as_half: bool
    products: Rounding
    sums: Rounding

    @property
    def factors_are_half(self) -> bool:
        """True if inputs and hidden values are rounded before they are multiplied."""
        return self.products is HALF


ARITHMETIC: Mapping[Precision, Arithmetic] = {
    "fp32": Arithmetic(False, SINGLE, SINGLE),
    "fp16": Arithmetic(True, SINGLE, SINGLE),
    "fp16-arithmetic": Arithmetic(True, HALF, SINGLE),
    "fp16-accumulate": Arithmetic(True, HALF, HALF),
}


@dataclass(frozen=True, eq=False)
class Layer:
    """One layer, scale * (weight x) + bias, with exact numbers and with the stored ones."""

    weight: Array
    bias: Array
    scale: Array | None
    stored_weight: Array
    stored_bias: Array
    stored_scale: Array | None


def _stored(values: NDArray[np.float32], arithmetic: Arithmetic) -> Array:
    if not arithmetic.stored_as_half:
        return values.astype(np.float64)
    return np.clip(values, -LARGEST_HALF, LARGEST_HALF).astype(np.float16).astype(np.float64)


def decoder_layers(decoder: GridDecoder, adapter: Adapter | None, arithmetic: Arithmetic) -> list[Layer]:
    """Return the three layers of `decoder`, specialised by `adapter`, exact and as `arithmetic` stores them."""
    layers = []
    for weight, scale, bias in specialised_layers(decoder, adapter):
        exact = (weight.astype(np.float64), bias.astype(np.float64), None if scale is None else scale.astype(float))
        stored_scale = None if scale is None else _stored(scale, arithmetic)
        layers.append(Layer(*exact, _stored(weight, arithmetic), _stored(bias, arithmetic), stored_scale))
    return layers


@dataclass(frozen=True, eq=False)
class LayerSums:
    """Bounds of a layer's computed sums."""

    local: Array
    """[outputs] error that storage and rounding in this layer add."""
    largest: Array
    """[outputs] largest magnitude of any partial sum."""


def layer_sums(layer: Layer, products: Array, storage: Array, inputs: int, arithmetic: Arithmetic) -> LayerSums:
    """Return bounds of a layer's sums.

    `products` [outputs] are sums over `inputs` inputs of |stored weight| * |input|; `storage` [outputs] are the same sums of
    |exact weight - stored weight| * |input|.
    """
    # Rules 1 to 4 of the derivation. A sum of n products, in any order, is off by gamma_n = n u / (1 - n u) of the sum of
    # their magnitudes (N. Higham, Accuracy and Stability of Numerical Algorithms, 2002, lemma 3.1).
    sum_has_bias = layer.scale is None or layer.stored_scale is None
    bias = np.abs(layer.stored_bias)
    total = products + bias if sum_has_bias else products
    of_products = arithmetic.products.unit * products + inputs * arithmetic.products.smallest
    unit = inputs * arithmetic.sums.unit
    growth = unit / (1.0 - unit) if unit < 1.0 else math.inf
    of_sums = growth * (total + of_products) + inputs * SMALLEST_SINGLE
    changed_bias = np.abs(layer.bias - layer.stored_bias) + SMALLEST_SINGLE
    local, largest = storage + of_products + of_sums, total + of_products + of_sums
    if layer.scale is None or layer.stored_scale is None:
        return LayerSums(local + changed_bias, largest)
    scale, rounding = np.abs(layer.stored_scale), arithmetic.sums
    changed_scale = np.abs(layer.scale - layer.stored_scale) + SMALLEST_SINGLE
    scaled = scale * largest
    of_scaling = rounding.unit * scaled + rounding.smallest
    adapted = scaled + of_scaling + bias
    of_bias = rounding.unit * adapted + rounding.smallest
    adapted_error = np.abs(layer.scale) * local + changed_scale * largest + of_scaling + of_bias + changed_bias
    return LayerSums(adapted_error, np.maximum(largest, adapted + of_bias))


def sums_of_values(layer: Layer, largest: Array, arithmetic: Arithmetic) -> LayerSums:
    """Return bounds of a layer's sums for inputs whose magnitudes are at most `largest` [..., inputs]."""
    changed = np.abs(layer.weight - layer.stored_weight) + SMALLEST_SINGLE
    products, storage = largest @ np.abs(layer.stored_weight).T, largest @ changed.T
    return layer_sums(layer, products, storage, layer.weight.shape[1], arithmetic)


@dataclass(frozen=True, eq=False)
class Hidden:
    """Bounds of a layer's hidden values, after LeakyReLU."""

    low: Array
    """[neurons] smallest exact value."""
    high: Array
    """[neurons] largest exact value."""
    slope_low: Array
    """[neurons] smallest factor by which the activation can multiply an error of the sum: 1 or the leaky slope."""
    slope_high: Array
    """[neurons] largest such factor."""
    rounding: Array
    """[neurons] error that the activation itself adds."""
    largest: Array
    """[neurons] largest magnitude of the computed value."""

    @property
    def slope(self) -> Array:
        """[neurons] centre of the range of slopes."""
        return (self.slope_low + self.slope_high) / 2.0

    @property
    def slope_doubt(self) -> Array:
        """[neurons] half the range of slopes."""
        return (self.slope_high - self.slope_low) / 2.0


def _leaky(values: Array, slope: float) -> Array:
    return np.where(values > 0.0, values, slope * values)


def hidden_values(low: Array, high: Array, error: Array, slope: float, arithmetic: Arithmetic) -> Hidden:
    """Return bounds after the activation, for exact sums in [`low`, `high`] that are off by at most `error`."""
    rounding = arithmetic.sums
    stored_slope = float(np.float16(slope)) if rounding is HALF else float(np.float32(slope))
    below = np.maximum(error - low, 0.0)
    of_slope = below * (abs(stored_slope - slope) + rounding.unit * stored_slope) + rounding.smallest
    ends = np.stack([_leaky(low - error, slope), _leaky(high + error, slope)])
    largest = np.abs(ends).max(axis=0) + of_slope
    # Sums that are halves already are not rounded again.
    of_factor = HALF.unit * largest + HALF.smallest if arithmetic.factors_are_half and rounding is not HALF else 0.0
    return Hidden(
        _leaky(low, slope),
        _leaky(high, slope),
        np.where(low - error >= 0.0, 1.0, slope),
        np.where(high + error <= 0.0, slope, 1.0),
        of_slope + of_factor,
        largest + of_factor,
    )


def effective_weight(layer: Layer) -> Array:
    """Return [outputs, inputs] exact weights, scales multiplied in."""
    return layer.weight if layer.scale is None else layer.scale[:, None] * layer.weight


FLOAT64_ROUNDING = 1.0 + 1e-9
"""Factor that covers the roundings of this file's float64 arithmetic."""


@dataclass(frozen=True)
class ErrorBound:
    """Error bounds of a texture in one precision, or of a pack: the worst of its textures."""

    error: float
    """Largest difference from the exact decode, in [0, 1] of the colour space. It is 1 where numbers may overflow."""
    position: float
    """Part of `error` that comes from the inputs, mostly from positions in fp32."""
    activations: tuple[float, float, float]
    """Largest magnitude of any partial sum in the first, second and third layer, in any order of summation."""
    overflows: bool
    """True if a number may leave the range of its format."""


def _bound(
    layers: list[Layer], bounds: InputBounds, slope: float, arithmetic: Arithmetic, channels: list[int]
) -> ErrorBound:
    # Certified bound by interval arithmetic. Each layer turns ranges of exact inputs into ranges of exact sums. It also adds a
    # local error: storage of weights, and rounding of products, sums and activation. A local error reaches the output through the
    # later layers, each neuron of which multiplies it by a slope in [leaky slope, 1]. All errors of a neuron meet the same slope,
    # so weights are combined across layers before magnitudes are taken; signs then cancel. A slope that the range leaves open is
    # written as centre +- doubt. Derivation and tightness: docs/explanation/accuracy.md#derivation.
    first, second, third = layers
    input_error = bounds.error
    if arithmetic.factors_are_half:
        input_error = input_error + HALF.unit * (bounds.magnitude + bounds.error) + HALF.smallest
    # First layer: latents and lod lie in a box; of the two phases of a wave, only one can be at its largest.
    weight_1 = effective_weight(first)
    centre = weight_1 @ ((bounds.low + bounds.high) / 2.0) + first.bias
    radius = bounds.spread(weight_1)
    sums_1 = layer_sums(
        first,
        bounds.largest_sum(first.stored_weight, input_error),
        bounds.largest_sum(np.abs(first.weight - first.stored_weight) + SMALLEST_SINGLE, input_error),
        first.weight.shape[1],
        arithmetic,
    )
    from_inputs_1 = np.abs(weight_1) @ input_error
    error_1 = from_inputs_1 + sums_1.local
    hidden_1 = hidden_values(centre - radius, centre + radius, error_1, slope, arithmetic)
    carried_1 = hidden_1.slope_high * error_1 + hidden_1.rounding
    # Second layer: hidden values lie in a box.
    weight_2 = effective_weight(second)
    centre = weight_2 @ ((hidden_1.low + hidden_1.high) / 2.0) + second.bias
    radius = np.abs(weight_2) @ ((hidden_1.high - hidden_1.low) / 2.0)
    sums_2 = sums_of_values(second, hidden_1.largest, arithmetic)
    error_2 = np.abs(weight_2) @ carried_1 + sums_2.local
    hidden_2 = hidden_values(centre - radius, centre + radius, error_2, slope, arithmetic)
    # Third layer.
    sums_3 = sums_of_values(third, hidden_2.largest, arithmetic)
    # reach_l: by how much an error at the sums of layer l (0: at the inputs) can change each output.
    middle_2, half_2 = hidden_2.slope, hidden_2.slope_doubt
    middle = (third.weight * middle_2) @ weight_2
    spread = (np.abs(third.weight) * half_2) @ np.abs(weight_2)
    reach_1 = np.abs(middle) + spread
    middle_1, half_1 = hidden_1.slope, hidden_1.slope_doubt
    reach_0 = np.abs((middle * middle_1) @ weight_1) + (
        np.abs(middle) * half_1 + spread * hidden_1.slope_high
    ) @ np.abs(weight_1)
    position = reach_0 @ input_error
    error = (
        position
        + reach_1 @ (hidden_1.slope_high * sums_1.local + hidden_1.rounding)
        + np.abs(third.weight) @ (hidden_2.slope_high * sums_2.local + hidden_2.rounding)
        + sums_3.local
    )
    activations = tuple(float(sums.largest.max()) for sums in (sums_1, sums_2, sums_3))
    singles = max(activations)
    halves = 0.0
    if arithmetic.sums is HALF:
        halves = singles
    elif arithmetic.factors_are_half:
        halves = max(
            float((np.abs(first.stored_weight) * (bounds.magnitude + input_error)).max()),
            float((np.abs(second.stored_weight) * hidden_1.largest).max()),
            float((np.abs(third.stored_weight) * hidden_2.largest).max()),
            float(hidden_1.largest.max()),
            float(hidden_2.largest.max()),
        )
    if arithmetic.factors_are_half:
        halves = max(halves, float((bounds.magnitude + input_error).max()))
    overflows = not (halves <= LARGEST_HALF and singles <= LARGEST_SINGLE)
    worst = float(error[channels].max()) * FLOAT64_ROUNDING
    if overflows or not worst < 1.0:
        worst = 1.0
    inputs = min(float(position[channels].max()) * FLOAT64_ROUNDING, worst)
    return ErrorBound(worst, inputs, (activations[0], activations[1], activations[2]), overflows)


def texture_bound(pack: Pack, texture_index: int, precision: Precision) -> ErrorBound:
    """Return the error bounds of texture `texture_index` of `pack`, which `rescale.stored_pack` returned."""
    texture = grid_parts(pack).textures[texture_index]
    arithmetic = ARITHMETIC[precision]
    layers = decoder_layers(grid_parts(pack).decoders[texture.group], texture.adapter, arithmetic)
    bounds = input_bounds(texture, grid_parts(pack).config)
    # A sum beyond float64 is beyond fp32 too, which `_bound` reports as an overflow.
    with np.errstate(over="ignore", invalid="ignore"):
        return _bound(layers, bounds, grid_parts(pack).config.leaky_slope, arithmetic, texture.places(pack.config))


def worst_of(bounds: list[ErrorBound]) -> ErrorBound:
    """Return the largest value of each field over `bounds`; zeros for an empty list."""
    if not bounds:
        return ErrorBound(0.0, 0.0, (0.0, 0.0, 0.0), False)
    activations = np.array([bound.activations for bound in bounds]).max(axis=0)
    return ErrorBound(
        max(bound.error for bound in bounds),
        max(bound.position for bound in bounds),
        (float(activations[0]), float(activations[1]), float(activations[2])),
        any(bound.overflows for bound in bounds),
    )


def texture_bounds(pack: Pack, precision: Precision, rescale: bool = True) -> list[ErrorBound]:
    """Return the error bounds of every texture of `pack` in `precision`. Without `rescale`, weights are stored unscaled."""
    stored = stored_pack(pack, precision) if rescale else pack
    return [texture_bound(stored, index, precision) for index in range(len(pack.textures))]


def pack_bounds(pack: Pack) -> dict[Precision, ErrorBound]:
    """Return the error bounds of `pack`, the worst of its textures, by precision."""
    return {precision: worst_of(texture_bounds(pack, precision)) for precision in get_args(Precision)}


def _running(layers: list[Layer], inputs: Array, error: Array, slope: float, arithmetic: Arithmetic) -> Array:
    """Return [N, outputs] error bounds for exact `inputs` [N, decoder_inputs] that are off by at most `error` [decoder_inputs]."""
    # Running error analysis (Higham 2002, section 3.3): as `_bound`, but with the exact sums of each texel instead of ranges.
    # So most signs, and with them the slopes of the activations, are known.
    first, second, third = layers
    weight_1, weight_2 = effective_weight(first), effective_weight(second)
    input_error = np.broadcast_to(error, inputs.shape)
    if arithmetic.factors_are_half:
        input_error = input_error + HALF.unit * (np.abs(inputs) + input_error) + HALF.smallest
    magnitude = np.abs(inputs) + input_error
    sums_1 = sums_of_values(first, magnitude, arithmetic)
    exact = inputs @ weight_1.T + first.bias
    error_1 = input_error @ np.abs(weight_1).T + sums_1.local
    hidden_1 = hidden_values(exact, exact, error_1, slope, arithmetic)
    sums_2 = sums_of_values(second, hidden_1.largest, arithmetic)
    exact = hidden_1.low @ weight_2.T + second.bias
    error_2 = (hidden_1.slope_high * error_1 + hidden_1.rounding) @ np.abs(weight_2).T + sums_2.local
    hidden_2 = hidden_values(exact, exact, error_2, slope, arithmetic)
    sums_3 = sums_of_values(third, hidden_2.largest, arithmetic)
    # Where the error may change the sign of a sum, its slope is known up to `doubt` only.
    slope_1, doubt_1 = hidden_1.slope, hidden_1.slope_doubt
    slope_2, doubt_2 = hidden_2.slope, hidden_2.slope_doubt
    local_1 = slope_1 * sums_1.local + doubt_1 * error_1 + hidden_1.rounding
    local_2 = slope_2 * sums_2.local + doubt_2 * error_2 + hidden_2.rounding
    result = sums_3.local + local_2 @ np.abs(third.weight).T
    for output, weight_3 in enumerate(third.weight):
        reach_1 = (slope_2 * weight_3) @ weight_2
        reach_0 = (slope_1 * reach_1) @ weight_1
        result[:, output] += np.einsum("ni,ni->n", np.abs(reach_0), input_error)
        result[:, output] += np.einsum("ni,ni->n", np.abs(reach_1), local_1)
    limit = LARGEST_HALF if arithmetic.factors_are_half else LARGEST_SINGLE
    largest = np.max([sums.largest.max(axis=1) for sums in (sums_1, sums_2, sums_3)], axis=0)
    fits = (largest <= limit) & (magnitude.max(axis=1) <= limit)
    return np.where(fits[:, None] & (result < 1.0), result * FLOAT64_ROUNDING, 1.0)


def running_bounds(
    stored: Pack, texture_index: int, uv: Array, lod: Array, precision: Precision, lod_error: float = 0.0
) -> Array:
    """Return [N, channels] largest differences from the exact decode at `uv` [N, 2] and `lod` [N], where both are fp32 numbers.

    `stored` comes from `ntc.codec.grid.accuracy.rescale.stored_pack`. The decoder's lod may be off by `lod_error`.
    The bound is 1 where numbers may overflow.
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
