"""Check of certified bounds against the errors of random texels, in arithmetic that rounds like shaders."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ntc.codec.config import Precision
from ntc.codec.grid.accuracy.error_bound import running_bounds, texture_bounds
from ntc.codec.grid.accuracy.precision_choice import as_stored, run_decoder_in_half
from ntc.codec.grid.accuracy.rescale import stored_pack
from ntc.codec.grid.model import Adapter, GridDecoder, grid_parts
from ntc.codec.grid.reference import decoder_inputs, run_decoder
from ntc.codec.latents import texture_levels
from ntc.codec.model import Pack

TEXELS_AT_ONCE = 1 << 14
Single = NDArray[np.float32]


@dataclass(frozen=True)
class BoundCheck:
    """Result of the check of one pack in one precision."""

    pack: str
    precision: Precision
    texels: int
    largest: float
    """Largest error."""
    largest_bound: float
    """Largest bound of a single texel."""
    whole_bound: float
    """Largest bound of a whole texture."""
    largest_share: float
    """Largest quotient of a texel's error and its bound; must be at most 1."""
    beyond: int
    """Number of values whose error exceeds the texel's bound, or whose bound exceeds the texture's; must be 0."""


def run_decoder_in_single(
    decoder: GridDecoder, inputs: Single, leaky_slope: float, adapter: Adapter | None, halves: bool
) -> Single:
    """Return [N, outputs] float32, not clamped, computed in fp32 with the order of sums of numpy's matrix product.

    With `halves`, weights are rounded to halves first.
    """

    def stored(part: Single) -> Single:
        return as_stored(part) if halves else part

    values, slope, last = inputs, np.float32(leaky_slope), len(decoder.weights) - 1
    for layer, (weight, bias) in enumerate(zip(decoder.weights, decoder.biases, strict=True)):
        if adapter is not None and layer < last:
            values = values @ stored(weight).T * stored(adapter.scales[layer]) + stored(adapter.biases[layer])
        elif adapter is not None and adapter.output_weight is not None and adapter.output_bias is not None:
            values = values @ stored(adapter.output_weight).T + stored(adapter.output_bias)
        else:
            values = values @ stored(weight).T + stored(bias)
        if layer < last:
            values = np.maximum(values, slope * values)
    return values


def _decoded(stored: Pack, texture: int, inputs: NDArray[np.float64], precision: Precision) -> Single:
    grid_pack = grid_parts(stored)
    encoded, slope = grid_pack.textures[texture], grid_pack.config.leaky_slope
    decoder, single = grid_pack.decoders[encoded.group], inputs.astype(np.float32)
    with np.errstate(over="ignore", invalid="ignore", under="ignore"):
        if precision in ("fp16-arithmetic", "fp16-accumulate"):
            accumulate = precision == "fp16-accumulate"
            values = run_decoder_in_half(decoder, single, slope, encoded.adapter, accumulate)
        else:
            values = run_decoder_in_single(decoder, single, slope, encoded.adapter, precision == "fp16")
    return np.clip(np.where(np.isnan(values), np.float32(0.0), values), 0.0, 1.0)[:, : encoded.channels]


def check_bounds(name: str, pack: Pack, precision: Precision, texels: int, seed: int = 0) -> BoundCheck:
    """Compare bounds and errors at about `texels` random texels, divided among the textures of `pack`."""
    random = np.random.default_rng(seed)
    stored, grid_pack = stored_pack(pack, precision), grid_parts(pack)
    wholes = [bound.error for bound in texture_bounds(pack, precision)]
    done = beyond = 0
    largest = largest_bound = share = 0.0
    for index, texture in enumerate(grid_pack.textures):
        levels = len(texture_levels(texture, pack.config))
        left = max(1, texels // len(pack.textures))
        while left > 0:
            count = min(left, TEXELS_AT_ONCE)
            uv = random.uniform(-2.0, 2.0, (count, 2)).astype(np.float32).astype(np.float64)
            lod = random.uniform(-0.5, levels - 0.5, count).astype(np.float32).astype(np.float64)
            inputs = decoder_inputs(pack, texture, uv, lod, texture.wrap)
            exact = run_decoder(
                grid_pack.decoders[texture.group], inputs, grid_pack.config.leaky_slope, texture.adapter
            )
            error = np.abs(_decoded(stored, index, inputs, precision) - np.clip(exact[:, : texture.channels], 0.0, 1.0))
            bound = running_bounds(stored, index, uv, lod, precision)
            beyond += int((error > bound).sum()) + int((bound > wholes[index] * (1.0 + 1e-6)).sum())
            largest, largest_bound = max(largest, float(error.max())), max(largest_bound, float(bound.max()))
            share = max(share, float((error / bound).max()))
            done, left = done + count, left - count
    return BoundCheck(name, precision, done, largest, largest_bound, max(wholes, default=0.0), share, beyond)
