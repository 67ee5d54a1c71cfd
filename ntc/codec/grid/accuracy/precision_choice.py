"""Choosing a precision: the fastest one whose error is not visible."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ntc.codec.codec import ChosenPrecision
from ntc.codec.config import Precision
from ntc.codec.grid.accuracy.error_bound import texture_bounds, worst_of
from ntc.codec.grid.accuracy.half_reference import as_stored, decode_texels_in_half
from ntc.codec.grid.accuracy.rescale import stored_pack
from ntc.codec.grid.accuracy.running_error import running_bounds
from ntc.codec.grid.model import Adapter, GridDecoder, grid_parts
from ntc.codec.grid.reference import decoder_inputs, run_decoder
from ntc.codec.latents import latent_levels
from ntc.codec.model import Pack
from ntc.codec.reference import decode_texels

Array = NDArray[np.float64]
HALF_STEP = 0.5 / 255.0
"""Errors below this change an 8-bit value by one step at most."""
MEASURED_TEXELS = 4096
"""Texels of all textures together that are decoded to measure an error."""
LEAST_OF_A_TEXTURE = 32
UNMEASURED_FACTOR = 3.0
"""The error of a texel that was not measured is taken to be at most this many times the largest measured one: 1.6 to 2.4 times
were found (docs/explanation/accuracy.md)."""


def _stored_decoder(decoder: GridDecoder) -> GridDecoder:
    return GridDecoder(tuple(map(as_stored, decoder.weights)), tuple(map(as_stored, decoder.biases)))


def _stored_adapter(adapter: Adapter | None) -> Adapter | None:
    if adapter is None:
        return None
    output = adapter.output_weight, adapter.output_bias
    weight, bias = (None if part is None else as_stored(part) for part in output)
    return Adapter(as_stored(adapter.scales), as_stored(adapter.biases), weight, bias)


def sampled_places(pack: Pack, texture_index: int, count: int, random: np.random.Generator) -> tuple[Array, Array]:
    """([N, 2] uv, [N] lod) at random over one texture, float64 numbers that are fp32 exactly."""
    texture = grid_parts(pack).textures[texture_index]
    levels = len(latent_levels(texture.width, texture.height, pack.config))
    uv, lod = random.uniform(0.0, 1.0, (count, 2)), random.uniform(0.0, levels - 1, count)
    return uv.astype(np.float32).astype(np.float64), lod.astype(np.float32).astype(np.float64)


def _each(pack: Pack, texels: int) -> int:
    return max(LEAST_OF_A_TEXTURE, texels // max(1, len(pack.textures)))


def sampled_bound(pack: Pack, precision: Precision, texels: int = MEASURED_TEXELS, seed: int = 0) -> float:
    """The largest certified error of `texels` single texels (`ntc.codec.grid.accuracy.running_error`), without decoding them."""
    random = np.random.default_rng(seed)
    stored, worst = stored_pack(pack, precision), 0.0
    for index in range(len(pack.textures)):
        uv, lod = sampled_places(pack, index, _each(pack, texels), random)
        worst = max(worst, float(running_bounds(stored, index, uv, lod, precision).max()))
    return worst


def measured_error(pack: Pack, precision: Precision, texels: int = MEASURED_TEXELS, seed: int = 0) -> float:
    """Largest difference from float64 at random places and levels of detail of every texture, `texels` of them or a few more.

    For `fp32` and `fp16` the arithmetic is float64: what is measured is storage.
    """
    random = np.random.default_rng(seed)
    stored = stored_pack(pack, precision)
    worst = 0.0
    for index, texture in enumerate(grid_parts(pack).textures):
        uv, lod = sampled_places(pack, index, _each(pack, texels), random)
        exact = decode_texels(pack, index, uv, lod)
        if precision in ("fp16-arithmetic", "fp16-accumulate"):
            found = decode_texels_in_half(stored, index, uv, lod, precision == "fp16-accumulate", rescale=False)
        else:
            inputs = decoder_inputs(pack, texture, uv, lod, texture.wrap)
            own = grid_parts(stored).textures[index]
            decoder, adapter = grid_parts(stored).decoders[texture.group], own.adapter
            if precision == "fp16":
                decoder, adapter = _stored_decoder(decoder), _stored_adapter(adapter)
            found = np.clip(run_decoder(decoder, inputs, grid_parts(pack).config.leaky_slope, adapter), 0.0, 1.0)
            found = found[:, texture.places(pack.config)]
        worst = max(worst, float(np.abs(found - exact).max(initial=0.0)))
    return worst


def chosen_precision(pack: Pack, fastest_first: Sequence[Precision], limit: float = HALF_STEP) -> ChosenPrecision:
    """The first of these precisions whose certified error is at most `limit`, or measured one well below it; fp32 needs neither.

    A precision in which numbers may overflow is never taken.
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
