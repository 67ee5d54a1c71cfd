"""What codec `grid` stores: grids of latents and an adapter of a texture, the network that a group shares."""

from dataclasses import dataclass
from typing import cast

import numpy as np
from numpy.typing import NDArray

from ntc.codec.grid.config import GridConfig
from ntc.codec.model import Decoder, EncodedTexture, Pack
from ntc.errors import InputError


@dataclass(frozen=True, eq=False)
class Adapter:
    """What specialises a shared decoder for one texture: hidden layer l computes leaky(scales[l] * (W x) + biases[l]).

    The biases stand in place of the decoder's own, so that they cost nothing to decode. Values are exact in half precision.
    """

    scales: NDArray[np.float32]
    """[2, hidden_width] float32."""
    biases: NDArray[np.float32]
    """[2, hidden_width] float32."""
    output_weight: NDArray[np.float32] | None = None
    """[outputs, hidden_width] float32, in place of the decoder's output layer, where codec.adapter_output is set."""
    output_bias: NDArray[np.float32] | None = None
    """[outputs] float32."""


@dataclass(frozen=True, eq=False, kw_only=True)
class GridTexture(EncodedTexture):
    """One texture as its pyramid of latent grids."""

    latents: NDArray[np.uint8]
    """[cells, latent_channels] uint8, 0 to `GridConfig.largest_stored`: the levels of `ntc.codec.latents.latent_levels`, one after the
    other."""
    scale: NDArray[np.float32]
    """[latent_channels] float32; latent value = offset + scale * stored integer."""
    offset: NDArray[np.float32]
    """[latent_channels] float32."""
    adapter: Adapter | None = None
    """Present exactly when the codec has adapters."""


@dataclass(frozen=True, eq=False)
class GridDecoder(Decoder):
    """Weights of one decoder: three linear layers, LeakyReLU after the first two, linear output."""

    weights: tuple[NDArray[np.float32], ...]
    """Per layer [outputs, inputs] float32, the shapes of `GridConfig.layer_shapes`."""
    biases: tuple[NDArray[np.float32], ...]
    """Per layer [outputs] float32."""


Layer = tuple[NDArray[np.float32], NDArray[np.float32] | None, NDArray[np.float32]]
"""(weight [outputs, inputs], scale [outputs] or None, bias [outputs]): scale * (weight x) + bias."""


def specialised_layers(decoder: GridDecoder, adapter: Adapter | None) -> list[Layer]:
    """The layers of `decoder` as `adapter` specialises them."""
    layers: list[Layer] = [(weight, None, bias) for weight, bias in zip(decoder.weights, decoder.biases, strict=True)]
    if adapter is not None:
        for number, (scale, bias) in enumerate(zip(adapter.scales, adapter.biases, strict=True)):
            layers[number] = (decoder.weights[number], scale, bias)
        if adapter.output_weight is not None and adapter.output_bias is not None:
            layers[-1] = (adapter.output_weight, None, adapter.output_bias)
    return layers


@dataclass(frozen=True, eq=False)
class GridParts:
    """A pack of codec `grid`, with its parts as what they are."""

    config: GridConfig
    textures: tuple[GridTexture, ...]
    decoders: tuple[GridDecoder, ...]


def grid_parts(pack: Pack) -> GridParts:
    """The parts of a pack of codec `grid`. Raises InputError for another codec."""
    if not isinstance(pack.config, GridConfig):
        raise InputError(f"{pack.name}: codec {pack.config.kind} has no hidden layers; use a pack of codec grid here")
    textures, decoders = cast(tuple[GridTexture, ...], pack.textures), cast(tuple[GridDecoder, ...], pack.decoders)
    return GridParts(pack.config, textures, decoders)
