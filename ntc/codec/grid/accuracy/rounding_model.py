"""What each precision rounds, and how far one layer's sums and activations are off because of it (docs/explanation/accuracy.md).

Arrays of neurons may have a leading axis of texels.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ntc.codec.config import LARGEST_HALF, Precision
from ntc.codec.grid.accuracy.input_bounds import SINGLE_UNIT
from ntc.codec.grid.model import Adapter, GridDecoder, specialised_layers

Array = NDArray[np.float64]
HALF_UNIT = 2.0**-11 * (1.0 + 2.0**-10)
"""Relative error of a rounding to a half, and a little more: emulated halves round to fp32 first."""
SMALLEST_HALF_ERROR = 2.0**-25
"""Error of a half below 2^-14, where halves lie 2^-24 apart."""
SMALLEST_SINGLE = 2.0**-126
"""fp32 numbers below this may count as 0."""
LARGEST_SINGLE = 3.0e38


@dataclass(frozen=True)
class Rounding:
    """A result is off by at most `unit` of its magnitude plus `smallest`."""

    unit: float
    smallest: float


SINGLE = Rounding(SINGLE_UNIT, SMALLEST_SINGLE)
HALF = Rounding(HALF_UNIT, SMALLEST_HALF_ERROR)


@dataclass(frozen=True)
class Arithmetic:
    """What a precision rounds to what."""

    stored_as_half: bool
    products: Rounding
    sums: Rounding

    @property
    def factors_are_half(self) -> bool:
        """Whether inputs and hidden values are rounded before they are multiplied."""
        return self.products is HALF


ARITHMETIC: Mapping[Precision, Arithmetic] = {
    "fp32": Arithmetic(False, SINGLE, SINGLE),
    "fp16": Arithmetic(True, SINGLE, SINGLE),
    "fp16-arithmetic": Arithmetic(True, HALF, SINGLE),
    "fp16-accumulate": Arithmetic(True, HALF, HALF),
}


@dataclass(frozen=True, eq=False)
class Layer:
    """scale * (weight x) + bias, exactly and as it is stored."""

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
    """The three layers of `decoder` as `adapter` specialises them."""
    layers = []
    for weight, scale, bias in specialised_layers(decoder, adapter):
        exact = (weight.astype(np.float64), bias.astype(np.float64), None if scale is None else scale.astype(float))
        stored_scale = None if scale is None else _stored(scale, arithmetic)
        layers.append(Layer(*exact, _stored(weight, arithmetic), _stored(bias, arithmetic), stored_scale))
    return layers


@dataclass(frozen=True, eq=False)
class LayerSums:
    """Of a layer's computed sums."""

    local: Array
    """[outputs] what storage and rounding of this layer add to their error."""
    largest: Array
    """[outputs] bound of every partial sum."""


def layer_sums(layer: Layer, products: Array, storage: Array, inputs: int, arithmetic: Arithmetic) -> LayerSums:
    """`products` [outputs]: sums of magnitudes of stored weights times inputs; `storage` alike of what storing changed."""
    own = layer.scale is None or layer.stored_scale is None
    bias = np.abs(layer.stored_bias)
    total = products + bias if own else products
    of_products = arithmetic.products.unit * products + inputs * arithmetic.products.smallest
    # Any order of n additions: each rounding is of a partial sum, and no path through them is longer than n.
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
    own_error = np.abs(layer.scale) * local + changed_scale * largest + of_scaling + of_bias + changed_bias
    return LayerSums(own_error, np.maximum(largest, adapted + of_bias))


def sums_of_values(layer: Layer, largest: Array, arithmetic: Arithmetic) -> LayerSums:
    """Sums of a layer that reads values of at most the magnitudes `largest` [..., inputs]."""
    changed = np.abs(layer.weight - layer.stored_weight) + SMALLEST_SINGLE
    products, storage = largest @ np.abs(layer.stored_weight).T, largest @ changed.T
    return layer_sums(layer, products, storage, layer.weight.shape[1], arithmetic)


@dataclass(frozen=True, eq=False)
class Hidden:
    """Hidden values after LeakyReLU."""

    low: Array
    high: Array
    slope_low: Array
    """[neurons] smallest slope that an error in the sum can meet on its way out: 1 or the leaky slope."""
    slope_high: Array
    rounding: Array
    """[neurons] what the activation itself adds to the error."""
    largest: Array
    """[neurons] largest magnitude of the computed value."""

    @property
    def slope(self) -> Array:
        """[neurons] slope that an error meets, up to `slope_doubt`."""
        return (self.slope_low + self.slope_high) / 2.0

    @property
    def slope_doubt(self) -> Array:
        """[neurons] half the range of slopes."""
        return (self.slope_high - self.slope_low) / 2.0


def _leaky(values: Array, slope: float) -> Array:
    return np.where(values > 0.0, values, slope * values)


def hidden_values(low: Array, high: Array, error: Array, slope: float, arithmetic: Arithmetic) -> Hidden:
    """The activation of sums in [`low`, `high`] that are off by at most `error`."""
    rounding = arithmetic.sums
    kept = float(np.float16(slope)) if rounding is HALF else float(np.float32(slope))
    below = np.maximum(error - low, 0.0)
    of_slope = below * (abs(kept - slope) + rounding.unit * kept) + rounding.smallest
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
    """[outputs, inputs] exact weights, scales multiplied in."""
    return layer.weight if layer.scale is None else layer.scale[:, None] * layer.weight
