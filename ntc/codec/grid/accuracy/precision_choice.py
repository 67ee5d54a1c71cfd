"""Precision `auto`: the fastest precision whose error is not visible.

Errors are measured with a decoder in numpy that rounds to halves as shaders/ntc/half.glsl does.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ntc.codec.codec import ChosenPrecision
from ntc.codec.config import LARGEST_HALF, Precision
from ntc.codec.grid.accuracy.error_bound import running_bounds, texture_bounds, worst_of
from ntc.codec.grid.accuracy.rescale import stored_pack
from ntc.codec.grid.model import Adapter, GridDecoder, grid_parts, specialised_layers
from ntc.codec.grid.reference import decoder_inputs, run_decoder
from ntc.codec.latents import texture_levels
from ntc.codec.model import Pack
from ntc.codec.reference import decode_texels

Single = NDArray[np.float32]


def to_half(values: Single) -> Single:
    """Round `values` to the nearest half, ties to even; infinite beyond the range of halves."""
    with np.errstate(over="ignore"):
        return values.astype(np.float16).astype(np.float32)


def as_stored(weights: Single) -> Single:
    """Round `weights` to halves; those beyond the range of halves become the largest half, as on the GPU."""
    return to_half(np.clip(weights, -LARGEST_HALF, LARGEST_HALF))


def run_decoder_in_half(
    decoder: GridDecoder, inputs: Single, leaky_slope: float, adapter: Adapter | None = None, accumulate: bool = False
) -> Single:
    """Run the network in half precision: [N, outputs] float32, not clamped, for `inputs` [N, decoder_inputs].

    Products of hidden layers are halves. With `accumulate`, sums are halves too: two for each neuron, one over the inputs with even
    numbers and one over the others. The output layer is computed in single precision.
    """
    rounded = to_half if accumulate else (lambda values: values)
    slope = rounded(np.full(1, leaky_slope, np.float32))
    values = to_half(inputs)
    *hidden, (last_weight, _, last_bias) = specialised_layers(decoder, adapter)
    for exact_weight, scale, bias in hidden:
        weight = as_stored(exact_weight)
        first_sum = np.float32(0.0) if scale is not None else as_stored(bias)
        start = np.broadcast_to(first_sum, (len(values), len(weight))).astype(np.float32)
        halves = [start, np.zeros_like(start)]
        for column in range(weight.shape[1]):
            parity = column % 2 if accumulate else 0
            halves[parity] = rounded(halves[parity] + to_half(values[:, column, None] * weight[:, column]))
        sums = rounded(halves[0] + halves[1])
        if scale is not None:
            sums = rounded(rounded(as_stored(scale) * sums) + as_stored(bias))
        sums = np.maximum(sums, rounded(slope * sums))
        values = to_half(sums)
    # The last hidden values are not rounded: the output layer multiplies in single precision.
    result: Single = sums @ as_stored(last_weight).T + as_stored(last_bias)
    return result


def decode_texels_in_half(
    pack: Pack,
    texture_index: int,
    uv: NDArray[np.float64],
    lod: NDArray[np.float64],
    accumulate: bool,
    rescale: bool = True,
) -> Single:
    """Decode in half precision: [N, channels] float32 in [0, 1] at `uv` [N, 2] and `lod` [N].

    With `rescale`, weights are rescaled as in the viewer, to avoid overflow. NaN becomes 0.
    """
    if rescale:
        pack = stored_pack(pack, "fp16-accumulate" if accumulate else "fp16-arithmetic")
    texture = grid_parts(pack).textures[texture_index]
    inputs = decoder_inputs(pack, texture, uv, lod, texture.wrap).astype(np.float32)
    decoder = grid_parts(pack).decoders[texture.group]
    with np.errstate(over="ignore", invalid="ignore"):
        values = run_decoder_in_half(decoder, inputs, grid_parts(pack).config.leaky_slope, texture.adapter, accumulate)
    return np.clip(np.where(np.isnan(values), np.float32(0.0), values), 0.0, 1.0)[:, texture.places(pack.config)]


Array = NDArray[np.float64]
HALF_STEP = 0.5 / 255.0
"""Errors below this change an 8-bit value by one step at most."""
MEASURED_TEXELS = 4096
"""Texels of all textures together that are decoded to measure an error."""
LEAST_OF_A_TEXTURE = 32
"""Texels of each texture that are measured, however many textures there are."""
UNMEASURED_FACTOR = 3.0
"""Assumed ratio of the largest error of all texels to the largest measured one. On whole images it was 1.6 to 2.4
(docs/explanation/accuracy.md)."""


def _stored_adapter(adapter: Adapter | None) -> Adapter | None:
    if adapter is None:
        return None
    output = adapter.output_weight, adapter.output_bias
    weight, bias = (None if part is None else as_stored(part) for part in output)
    return Adapter(as_stored(adapter.scales), as_stored(adapter.biases), weight, bias)


def sampled_places(pack: Pack, texture_index: int, count: int, random: np.random.Generator) -> tuple[Array, Array]:
    """Return random places ([N, 2] uv, [N] lod) on one texture: float64 numbers that fp32 holds exactly."""
    texture = grid_parts(pack).textures[texture_index]
    levels = len(texture_levels(texture, pack.config))
    uv, lod = random.uniform(0.0, 1.0, (count, 2)), random.uniform(0.0, levels - 1, count)
    return uv.astype(np.float32).astype(np.float64), lod.astype(np.float32).astype(np.float64)


def _texels_of_each(pack: Pack, texels: int) -> int:
    return max(LEAST_OF_A_TEXTURE, texels // max(1, len(pack.textures)))


def sampled_bound(pack: Pack, precision: Precision, texels: int = MEASURED_TEXELS, seed: int = 0) -> float:
    """Return the largest certified error at about `texels` random texels of `pack` (`error_bound.running_bounds`)."""
    random = np.random.default_rng(seed)
    stored, worst = stored_pack(pack, precision), 0.0
    for index in range(len(pack.textures)):
        uv, lod = sampled_places(pack, index, _texels_of_each(pack, texels), random)
        worst = max(worst, float(running_bounds(stored, index, uv, lod, precision).max()))
    return worst


def measured_error(pack: Pack, precision: Precision, texels: int = MEASURED_TEXELS, seed: int = 0) -> float:
    """Return the largest difference from the float64 decode at about `texels` random places of `pack`, every texture among them.

    For `fp32` and `fp16` the arithmetic is float64, so only the error of stored weights is measured.
    """
    random = np.random.default_rng(seed)
    stored = stored_pack(pack, precision)
    worst = 0.0
    for index, texture in enumerate(grid_parts(pack).textures):
        uv, lod = sampled_places(pack, index, _texels_of_each(pack, texels), random)
        exact = decode_texels(pack, index, uv, lod)
        if precision in ("fp16-arithmetic", "fp16-accumulate"):
            decoded = decode_texels_in_half(stored, index, uv, lod, precision == "fp16-accumulate", rescale=False)
        else:
            inputs = decoder_inputs(pack, texture, uv, lod, texture.wrap)
            decoder = grid_parts(stored).decoders[texture.group]
            adapter = grid_parts(stored).textures[index].adapter
            if precision == "fp16":
                parts = (tuple(map(as_stored, part)) for part in (decoder.weights, decoder.biases))
                decoder, adapter = GridDecoder(*parts), _stored_adapter(adapter)
            decoded = np.clip(run_decoder(decoder, inputs, grid_parts(pack).config.leaky_slope, adapter), 0.0, 1.0)
            decoded = decoded[:, texture.places(pack.config)]
        worst = max(worst, float(np.abs(decoded - exact).max(initial=0.0)))
    return worst


def chosen_precision(pack: Pack, fastest_first: Sequence[Precision], limit: float = HALF_STEP) -> ChosenPrecision:
    """Return the first precision whose certified error is at most `limit`, or whose measured error is well below it.

    A precision in which numbers may overflow is never chosen. fp32 needs no proof.
    """
    for precision in fastest_first:
        if precision == "fp32":
            break
        bound = worst_of(texture_bounds(pack, precision))
        if bound.overflows:
            continue
        if bound.error <= limit:
            return ChosenPrecision(precision, f"error at most {bound.error:.1e}, certified")
        measured = measured_error(pack, precision)
        if measured * UNMEASURED_FACTOR <= limit:
            return ChosenPrecision(precision, f"largest error measured {measured:.1e}")
    return ChosenPrecision("fp32", "halves would show, are not supported, or are slower")
