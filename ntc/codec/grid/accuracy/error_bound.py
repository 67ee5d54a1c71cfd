"""Bounds of the distance of a decoded value from the exact one, from weights alone (docs/explanation/accuracy.md)."""

from dataclasses import dataclass
from typing import get_args

import numpy as np
from numpy.typing import NDArray

from ntc.codec.config import LARGEST_HALF, Precision
from ntc.codec.grid.accuracy.input_bounds import InputBounds, input_bounds
from ntc.codec.grid.accuracy.rescale import stored_pack
from ntc.codec.grid.accuracy.rounding_model import (
    ARITHMETIC,
    HALF,
    LARGEST_SINGLE,
    SMALLEST_SINGLE,
    Arithmetic,
    Layer,
    decoder_layers,
    effective_weight,
    hidden_values,
    layer_sums,
    sums_of_values,
)
from ntc.codec.grid.model import grid_parts
from ntc.codec.model import Pack

Array = NDArray[np.float64]
OWN_ROUNDING = 1.0 + 1e-9
"""Factor for the roundings of these float64 sums themselves."""


@dataclass(frozen=True)
class ErrorBound:
    """Bounds of a texture in one precision; of a pack, the worst of its textures."""

    error: float
    """Largest difference from the exact decode, in [0, 1] of the colour space; 1, the largest possible, where numbers may overflow."""
    position: float
    """The part of `error` that comes from inputs, most of it because positions are fp32 numbers."""
    activations: tuple[float, float, float]
    """Largest magnitude of any sum in the first, second and third layer, in whatever order it is summed."""
    overflows: bool
    """Whether a number may leave the range of the format it is kept in."""


def _bound(
    layers: list[Layer], bounds: InputBounds, slope: float, arithmetic: Arithmetic, channels: list[int]
) -> ErrorBound:
    first, second, third = layers
    read = bounds.error
    if arithmetic.factors_are_half:
        read = read + HALF.unit * (bounds.magnitude + bounds.error) + HALF.smallest
    # First layer: inputs lie in a box, waves in pairs.
    weight_1 = effective_weight(first)
    centre = weight_1 @ ((bounds.low + bounds.high) / 2.0) + first.bias
    radius = bounds.spread(weight_1)
    sums_1 = layer_sums(
        first,
        bounds.largest_sum(first.stored_weight, read),
        bounds.largest_sum(np.abs(first.weight - first.stored_weight) + SMALLEST_SINGLE, read),
        first.weight.shape[1],
        arithmetic,
    )
    from_inputs_1 = np.abs(weight_1) @ read
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
    # Errors on their way out meet slopes, the same for all of them: so weights are summed up before magnitudes are taken.
    middle_2, half_2 = hidden_2.slope, hidden_2.slope_doubt
    middle = (third.weight * middle_2) @ weight_2
    spread = (np.abs(third.weight) * half_2) @ np.abs(weight_2)
    reach_1 = np.abs(middle) + spread
    middle_1, half_1 = hidden_1.slope, hidden_1.slope_doubt
    reach_0 = np.abs((middle * middle_1) @ weight_1) + (
        np.abs(middle) * half_1 + spread * hidden_1.slope_high
    ) @ np.abs(weight_1)
    position = reach_0 @ read
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
            float((np.abs(first.stored_weight) * (bounds.magnitude + read)).max()),
            float((np.abs(second.stored_weight) * hidden_1.largest).max()),
            float((np.abs(third.stored_weight) * hidden_2.largest).max()),
            float(hidden_1.largest.max()),
            float(hidden_2.largest.max()),
        )
    if arithmetic.factors_are_half:
        halves = max(halves, float((bounds.magnitude + read).max()))
    overflows = not (halves <= LARGEST_HALF and singles <= LARGEST_SINGLE)
    worst = float(error[channels].max()) * OWN_ROUNDING
    if overflows or not worst < 1.0:
        worst = 1.0
    inputs = min(float(position[channels].max()) * OWN_ROUNDING, worst)
    return ErrorBound(worst, inputs, (activations[0], activations[1], activations[2]), overflows)


def texture_bound(pack: Pack, texture_index: int, precision: Precision) -> ErrorBound:
    """Of the pack's texture `texture_index`, for weights as they stand: `pack` is what `rescale.stored_pack` gave."""
    texture = grid_parts(pack).textures[texture_index]
    arithmetic = ARITHMETIC[precision]
    layers = decoder_layers(grid_parts(pack).decoders[texture.group], texture.adapter, arithmetic)
    bounds = input_bounds(texture, grid_parts(pack).config)
    # Sums that leave float64 are sums that leave fp32.
    with np.errstate(over="ignore", invalid="ignore"):
        return _bound(layers, bounds, grid_parts(pack).config.leaky_slope, arithmetic, texture.places(pack.config))


def worst_of(bounds: list[ErrorBound]) -> ErrorBound:
    """The largest of each bound; zeros for an empty list."""
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
    """Of every texture of `pack`, decoded in `precision`. Without `rescale`, weights are stored unscaled (`rescale`)."""
    stored = stored_pack(pack, precision) if rescale else pack
    return [texture_bound(stored, index, precision) for index in range(len(pack.textures))]


def pack_bounds(pack: Pack) -> dict[Precision, ErrorBound]:
    """The worst of all textures of `pack`, by precision."""
    return {precision: worst_of(texture_bounds(pack, precision)) for precision in get_args(Precision)}
