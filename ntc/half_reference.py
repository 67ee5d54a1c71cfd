"""The decoder network in half precision, step by step as shaders/ntc/half.glsl rounds: numpy float32 and float16."""

import numpy as np
from numpy.typing import NDArray

from ntc.pack import Adapter, Decoder, Pack
from ntc.reference import decoder_inputs

Single = NDArray[np.float32]


def to_half(values: Single) -> Single:
    """`values` rounded to the nearest half, ties to even; infinite beyond the range of halves."""
    with np.errstate(over="ignore"):
        return values.astype(np.float16).astype(np.float32)


def run_decoder_in_half(
    decoder: Decoder, inputs: Single, leaky_slope: float, adapter: Adapter | None = None, accumulate: bool = False
) -> Single:
    """[N, outputs] float32, not clamped, for `inputs` [N, decoder_inputs].

    Products are halves. With `accumulate` sums are, too, and everything else that is computed; otherwise it is single.
    """
    rounded = to_half if accumulate else (lambda values: values)
    slope = rounded(np.full(1, leaky_slope, np.float32))
    values = to_half(inputs)
    last = len(decoder.weights) - 1
    for index, (weight, bias) in enumerate(zip(decoder.weights[:-1], decoder.biases[:-1], strict=True)):
        weight, bias = to_half(weight), to_half(bias)
        adapted = adapter is not None
        sums = np.broadcast_to(np.float32(0.0) if adapted else bias, (len(values), len(weight))).astype(np.float32)
        for column in range(weight.shape[1]):
            sums = rounded(sums + to_half(values[:, column, None] * weight[:, column]))
        if adapter is not None:
            scaled = rounded(to_half(adapter.scales[index]) * sums)
            sums = rounded(scaled + to_half(adapter.biases[index]))
        sums = np.maximum(sums, rounded(slope * sums))
        values = to_half(sums)
    weight, bias = decoder.weights[last], decoder.biases[last]
    if adapter is not None and adapter.output_weight is not None and adapter.output_bias is not None:
        weight, bias = adapter.output_weight, adapter.output_bias
    weight = to_half(weight)
    result = np.broadcast_to(to_half(bias), (len(values), len(bias))).astype(np.float32)
    for first in range(0, weight.shape[1], 4):
        products = to_half(values[:, None, first : first + 4] * weight[:, first : first + 4])
        pairs = rounded(products[..., 0::2] + products[..., 1::2])
        result = rounded(result + rounded(pairs[..., 0] + pairs[..., 1]))
    return result


def decode_texels_in_half(
    pack: Pack, texture_index: int, uv: NDArray[np.float64], lod: NDArray[np.float64], accumulate: bool
) -> Single:
    """[N, channels] float32 in [0, 1] at `uv` [N, 2] and `lod` [N], as `ntc.reference.decode_texels`, in half precision."""
    texture = pack.textures[texture_index]
    inputs = decoder_inputs(pack, texture, uv, lod, texture.wrap).astype(np.float32)
    decoder = pack.decoders[texture.group]
    values = run_decoder_in_half(decoder, inputs, pack.config.leaky_slope, texture.adapter, accumulate)
    return np.clip(values, 0.0, 1.0)[:, : texture.channels]
