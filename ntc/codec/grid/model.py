"""Data of codec `grid`: its settings, a texture (grids of latents and an adapter), and a decoder (the network that a group shares)."""

from dataclasses import dataclass
from typing import ClassVar, Literal, cast

import numpy as np
from numpy.typing import NDArray

from ntc.codec.maps import BASE_ALONE, MapName, maps_fit, ordered_maps
from ntc.codec.model import CodecSettings, Decoder, EncodedTexture, Pack
from ntc.errors import InputError


@dataclass(frozen=True)
class GridConfig(CodecSettings):
    """The settings of codec `grid`: shapes of latent grids and decoders, the same for all textures of a pack (paper, Sec. 4).

    The decoder reads `latent_channels` + `positional_inputs` + `lod_inputs` numbers and has two hidden layers.
    """

    kind: ClassVar[str] = "grid"

    latent_channels: int = 4
    """Channels of a latent cell: a multiple of 4, at most 16."""
    downscale: int = 4
    """Texels per latent cell along one side: 4 gives 256x256 cells for 1024x1024 texels."""
    levels: int | None = None
    """Number of latent levels, one per mip. None: down to 4x4 cells. 1: mip 0 alone, as in the paper."""
    positional_octaves: int = 3
    """Octaves of the triangle-wave positional encoding, with periods of 2, 4, 8, ... texels."""
    hidden_width: int = 64
    """Neurons of each of the two hidden layers: a multiple of 4."""
    leaky_slope: float = 0.01
    """Slope of LeakyReLU for negative inputs."""
    output_channels: int = 3
    """Channels that decoders write, 1 to 13: those of `maps`. A texture with fewer uses the first ones."""
    latent_bits: Literal[4, 8] = 8
    """Bits of a stored latent value. 8 channels of 4 bits take as many bytes as 4 channels of 8 bits."""
    weight_bits: Literal[16, 32] = 32
    """Bits of a stored decoder weight: half or single precision."""
    adapters: bool = False
    """True if each texture has an adapter: scales and biases of the hidden layers, which specialise the shared decoder."""
    adapter_output: bool = False
    """True if adapters also hold an output layer, which replaces the decoder's."""
    maps: tuple[MapName, ...] = BASE_ALONE
    """Maps that the outputs hold (`ntc.codec.maps`): all maps that any texture of the pack has."""

    def __post_init__(self) -> None:
        checks = {
            "latent_channels": self.latent_channels in (4, 8, 12, 16),
            "downscale": 1 <= self.downscale <= 64,
            "levels": self.levels is None or 1 <= self.levels <= 16,
            "positional_octaves": 1 <= self.positional_octaves <= 8,
            "hidden_width": 4 <= self.hidden_width <= 256 and self.hidden_width % 4 == 0,
            "leaky_slope": 0.0 <= self.leaky_slope < 1.0,
            "maps": ordered_maps(self.maps),
            "output_channels": maps_fit(self.maps, self.output_channels),
            "latent_bits": self.latent_bits in (4, 8),
            "weight_bits": self.weight_bits in (16, 32),
            "adapters": isinstance(self.adapters, bool),
            "adapter_output": isinstance(self.adapter_output, bool) and (self.adapters or not self.adapter_output),
        }
        for field, valid in checks.items():
            if not valid:
                raise ValueError(f"codec.{field} = {getattr(self, field)!r:.80} is out of range")

    @property
    def positional_inputs(self) -> int:
        """Number of inputs of the positional encoding: octaves x 2 phases x 2 axes."""
        return self.positional_octaves * 4

    @property
    def lod_inputs(self) -> int:
        """Number of lod inputs: 1 if textures have several latent levels, else 0, as in the paper."""
        return 0 if self.levels == 1 else 1

    @property
    def decoder_inputs(self) -> int:
        """Number of inputs of the decoder, in the order latents, positional encoding, lod."""
        return self.latent_channels + self.positional_inputs + self.lod_inputs

    @property
    def largest_stored(self) -> int:
        """Largest stored latent: stored latents are integers from 0 to this."""
        return (1 << self.latent_bits) - 1

    @property
    def cell_bytes(self) -> int:
        """Bytes of a stored latent cell."""
        return self.latent_channels * self.latent_bits // 8

    @property
    def smallest_top_cells(self) -> int:
        """Cells of the longer side at which the pyramid ends: its last level is the first with at most so many."""
        return 4

    @property
    def layer_shapes(self) -> tuple[tuple[int, int], ...]:
        """Shapes of the three linear layers, each (outputs, inputs)."""
        width = self.hidden_width
        return ((width, self.decoder_inputs), (width, width), (self.output_channels, width))

    @property
    def multiply_adds(self) -> int:
        """Multiply-adds of one decode; 5312 for 16-64-64-3."""
        return sum(outputs * inputs for outputs, inputs in self.layer_shapes)


LOD_INPUT_SCALE = 0.125
"""Scale of the decoder's lod input, which keeps it near [0, 1] for textures of up to 32768 texels a side."""


@dataclass(frozen=True, eq=False)
class Adapter:
    """Numbers that specialise a shared decoder for one texture: hidden layer l computes leaky(scales[l] * (W x) + biases[l]).

    The biases replace the decoder's, so they take no time to decode. Values are exact in half precision.
    """

    scales: NDArray[np.float32]
    """[2, hidden_width] float32."""
    biases: NDArray[np.float32]
    """[2, hidden_width] float32."""
    output_weight: NDArray[np.float32] | None = None
    """[outputs, hidden_width] float32, replaces the decoder's output layer. None unless `GridConfig.adapter_output`."""
    output_bias: NDArray[np.float32] | None = None
    """[outputs] float32. None unless `GridConfig.adapter_output`."""


@dataclass(frozen=True, eq=False, kw_only=True)
class GridTexture(EncodedTexture):
    """One encoded texture: its pyramid of latent grids, and its adapter."""

    latents: NDArray[np.uint8]
    """[cells, latent_channels] uint8, 0 to `GridConfig.largest_stored`: all levels of `ntc.codec.latents.latent_levels` in
    sequence."""
    scale: NDArray[np.float32]
    """[latent_channels] float32; latent value = offset + scale * stored integer."""
    offset: NDArray[np.float32]
    """[latent_channels] float32."""
    adapter: Adapter | None = None
    """The adapter; None unless `GridConfig.adapters`."""


@dataclass(frozen=True, eq=False)
class GridDecoder(Decoder):
    """Weights of one decoder: three linear layers, LeakyReLU after the first two, linear output."""

    weights: tuple[NDArray[np.float32], ...]
    """Weights of each layer, [outputs, inputs] float32, with the shapes of `GridConfig.layer_shapes`."""
    biases: tuple[NDArray[np.float32], ...]
    """Biases of each layer, [outputs] float32."""


Layer = tuple[NDArray[np.float32], NDArray[np.float32] | None, NDArray[np.float32]]
"""(weight [outputs, inputs], scale [outputs] or None, bias [outputs]): scale * (weight x) + bias."""


def specialised_layers(decoder: GridDecoder, adapter: Adapter | None) -> list[Layer]:
    """Return the layers of `decoder`, specialised by `adapter`."""
    layers: list[Layer] = [(weight, None, bias) for weight, bias in zip(decoder.weights, decoder.biases, strict=True)]
    if adapter is not None:
        for number, (scale, bias) in enumerate(zip(adapter.scales, adapter.biases, strict=True)):
            layers[number] = (decoder.weights[number], scale, bias)
        if adapter.output_weight is not None and adapter.output_bias is not None:
            layers[-1] = (adapter.output_weight, None, adapter.output_bias)
    return layers


@dataclass(frozen=True, eq=False)
class GridParts:
    """The parts of a pack of codec `grid`, with their exact types."""

    config: GridConfig
    textures: tuple[GridTexture, ...]
    decoders: tuple[GridDecoder, ...]


def grid_parts(pack: Pack) -> GridParts:
    """Return the parts of a pack of codec `grid`. Raises InputError for another codec."""
    if not isinstance(pack.config, GridConfig):
        raise InputError(f"{pack.name}: codec {pack.config.kind} has no hidden layers; use a pack of codec grid here")
    textures, decoders = cast(tuple[GridTexture, ...], pack.textures), cast(tuple[GridDecoder, ...], pack.decoders)
    return GridParts(pack.config, textures, decoders)
