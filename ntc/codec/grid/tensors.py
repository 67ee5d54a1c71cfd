"""The tensors of codec `grid` in a file (docs/reference/pack-format.md). "{}" in a name is the number of a texture or decoder."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ntc.codec.codec import Tensors, TensorShape
from ntc.codec.grid.config import GridConfig
from ntc.codec.grid.model import Adapter, GridDecoder, GridTexture
from ntc.codec.grid.quantize import packed_cells, unpacked_cells
from ntc.codec.latents import latent_cell_count

HIDDEN_LAYERS = 2


def texture_shapes(config: GridConfig, width: int, height: int) -> dict[str, TensorShape]:
    """Type and shape of the tensors of a texture: cells, their range, and the adapter."""
    channels = config.latent_channels
    shapes: dict[str, TensorShape] = {
        "latents.{}": ("U8", (latent_cell_count(width, height, config), config.cell_bytes)),
        "latents.{}.scale": ("F32", (channels,)),
        "latents.{}.offset": ("F32", (channels,)),
    }
    if config.adapters:
        shapes["adapter.{}.scales"] = ("F16", (HIDDEN_LAYERS, config.hidden_width))
        shapes["adapter.{}.biases"] = ("F16", (HIDDEN_LAYERS, config.hidden_width))
    if config.adapter_output:
        shapes["adapter.{}.output.weight"] = ("F16", (config.output_channels, config.hidden_width))
        shapes["adapter.{}.output.bias"] = ("F16", (config.output_channels,))
    return shapes


def decoder_shapes(config: GridConfig) -> dict[str, TensorShape]:
    """Type and shape of the tensors of a decoder: weights and biases of its layers."""
    kind, shapes = f"F{config.weight_bits}", dict[str, TensorShape]()
    for layer, (outputs, inputs) in enumerate(config.layer_shapes):
        shapes[f"decoder.{{}}.{layer}.weight"] = (kind, (outputs, inputs))
        shapes[f"decoder.{{}}.{layer}.bias"] = (kind, (outputs,))
    return shapes


def texture_tensors(texture: GridTexture, config: GridConfig) -> dict[str, NDArray[Any]]:
    """The tensors of a texture, contiguous."""
    tensors: dict[str, NDArray[Any]] = {
        "latents.{}": packed_cells(texture.latents, config.latent_bits),
        "latents.{}.scale": np.ascontiguousarray(texture.scale),
        "latents.{}.offset": np.ascontiguousarray(texture.offset),
    }
    if texture.adapter is not None:
        tensors["adapter.{}.scales"] = texture.adapter.scales.astype(np.float16)
        tensors["adapter.{}.biases"] = texture.adapter.biases.astype(np.float16)
        if texture.adapter.output_weight is not None and texture.adapter.output_bias is not None:
            tensors["adapter.{}.output.weight"] = texture.adapter.output_weight.astype(np.float16)
            tensors["adapter.{}.output.bias"] = texture.adapter.output_bias.astype(np.float16)
    return tensors


def read_texture(tensors: Tensors, known: Mapping[str, Any], config: GridConfig) -> GridTexture:
    """The texture of these tensors."""
    adapter = None
    if config.adapters:
        parts = ("scales", "biases", "output.weight", "output.bias") if config.adapter_output else ("scales", "biases")
        adapter = Adapter(*(tensors[f"adapter.{{}}.{part}"].astype(np.float32) for part in parts))
    return GridTexture(
        **known,
        latents=unpacked_cells(tensors["latents.{}"], config.latent_bits),
        scale=tensors["latents.{}.scale"],
        offset=tensors["latents.{}.offset"],
        adapter=adapter,
    )


def decoder_tensors(decoder: GridDecoder, config: GridConfig) -> dict[str, NDArray[Any]]:
    """The tensors of a decoder, contiguous."""
    kind = np.float16 if config.weight_bits == 16 else np.float32
    tensors: dict[str, NDArray[Any]] = {}
    for layer, (weight, bias) in enumerate(zip(decoder.weights, decoder.biases, strict=True)):
        tensors[f"decoder.{{}}.{layer}.weight"] = np.ascontiguousarray(weight, kind)
        tensors[f"decoder.{{}}.{layer}.bias"] = np.ascontiguousarray(bias, kind)
    return tensors


def read_decoder(tensors: Tensors, config: GridConfig) -> GridDecoder:
    """The decoder of these tensors."""
    layers = range(len(config.layer_shapes))
    weights, biases = (
        tuple(tensors[f"decoder.{{}}.{layer}.{part}"].astype(np.float32) for layer in layers)
        for part in ("weight", "bias")
    )
    return GridDecoder(weights, biases)
