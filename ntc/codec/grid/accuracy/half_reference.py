"""The decoder network in half precision, step by step as shaders/ntc/half.glsl rounds: numpy float32 and float16."""

import numpy as np
from numpy.typing import NDArray

from ntc.codec.config import LARGEST_HALF
from ntc.codec.grid.accuracy.rescale import stored_pack
from ntc.codec.grid.model import Adapter, GridDecoder, grid_parts, specialised_layers
from ntc.codec.grid.reference import decoder_inputs
from ntc.codec.model import Pack

Single = NDArray[np.float32]


def to_half(values: Single) -> Single:
    """`values` rounded to the nearest half, ties to even; infinite beyond the range of halves."""
    with np.errstate(over="ignore"):
        return values.astype(np.float16).astype(np.float32)


def as_stored(weights: Single) -> Single:
    """`weights` as halves; those beyond the range of halves become the largest one, as on the GPU."""
    return to_half(np.clip(weights, -LARGEST_HALF, LARGEST_HALF))


def run_decoder_in_half(
    decoder: GridDecoder, inputs: Single, leaky_slope: float, adapter: Adapter | None = None, accumulate: bool = False
) -> Single:
    """[N, outputs] float32, not clamped, for `inputs` [N, decoder_inputs].

    Products of hidden layers are halves. With `accumulate` their sums are, too, two for each neuron: of inputs with even and with odd
    numbers. Outputs are computed in single precision.
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
            own = column % 2 if accumulate else 0
            halves[own] = rounded(halves[own] + to_half(values[:, column, None] * weight[:, column]))
        sums = rounded(halves[0] + halves[1])
        if scale is not None:
            sums = rounded(rounded(as_stored(scale) * sums) + as_stored(bias))
        sums = np.maximum(sums, rounded(slope * sums))
        values = to_half(sums)
    # What the last hidden layer gives is not rounded before it is multiplied.
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
    """[N, channels] float32 in [0, 1] at `uv` [N, 2] and `lod` [N], as `ntc.codec.reference.decode_texels`, in half precision.

    With `rescale`, as the viewer does, weights are rescaled so that nothing overflows (`rescale`); NaN becomes 0.
    """
    if rescale:
        pack = stored_pack(pack, "fp16-accumulate" if accumulate else "fp16-arithmetic")
    texture = grid_parts(pack).textures[texture_index]
    inputs = decoder_inputs(pack, texture, uv, lod, texture.wrap).astype(np.float32)
    decoder = grid_parts(pack).decoders[texture.group]
    with np.errstate(over="ignore", invalid="ignore"):
        values = run_decoder_in_half(decoder, inputs, grid_parts(pack).config.leaky_slope, texture.adapter, accumulate)
    return np.clip(np.where(np.isnan(values), np.float32(0.0), values), 0.0, 1.0)[:, texture.places(pack.config)]
