"""The pack: encoded textures and decoders of one grouping, and the `.ntc` file that holds them (docs/pack-format.md)."""

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from ntc.codec.block.config import BlockCodecConfig
from ntc.codec.block.model import BlockDecoder
from ntc.codec.block.universal import UNIVERSAL
from ntc.codec.config import CodecConfig, ColorSpace, WrapMode
from ntc.codec.maps import BASE_ALONE, MapName, channel_places
from ntc.errors import InputError

AnyCodec = CodecConfig | BlockCodecConfig


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


@dataclass(frozen=True, eq=False)
class EncodedTexture:
    """One texture as its pyramid of latents."""

    name: str
    pixel_hash: str
    """Identity of the original image (`ntc.codec.textures.hash_pixels`): the scene's texture is found by it."""
    width: int
    """Encoded width in texels; smaller than the original's when the texture was reduced before encoding."""
    height: int
    """Encoded height in texels."""
    channels: int
    """Channels of the texture, 1 to 12: those of `maps`. The decoder's further outputs are unused."""
    color_space: ColorSpace
    """Space of the decoded numbers of the map `base`, in [0, 1]."""
    wrap: tuple[WrapMode, WrapMode]
    category: str | None
    group: int
    """Index of the decoder that decodes this texture."""
    latents: NDArray[np.uint8]
    """The levels of `ntc.codec.latents.latent_levels`, one after the other. Codec `grid`: [cells, latent_channels] uint8, 0 to
    `CodecConfig.largest_stored`. Codec `block`: [words, 4] uint8, `BlockTexture.words`, little-endian."""
    scale: NDArray[np.float32]
    """Codec `grid`: [latent_channels] float32; latent value = offset + scale * stored integer. Codec `block`: [sum of k * k]
    float32, the parts of `BlockTexture.axes`: for each plane of the codec's maps the rows of its k x k matrix, one after the other."""
    offset: NDArray[np.float32]
    """Codec `grid`: [latent_channels] float32. Codec `block`: [output_channels] float32, `BlockTexture.mean`."""
    adapter: Adapter | None = None
    """Present exactly when the codec is `grid` and has adapters."""
    psnr_db: float | None = None
    """PSNR in dB of mip 0 over 8-bit values of all channels, measured after quantisation by the encoder."""
    maps: tuple[MapName, ...] = BASE_ALONE
    """Those of `AnyCodec.maps` that the texture has; more than `base` alone: a material set."""

    map_psnr_db: tuple[float | None, ...] = ()
    """Of a material set: PSNR in dB of mip 0 of each of `maps`, as `psnr_db`; empty where it is not known."""
    normal_degrees: tuple[float, float] | None = None
    """Of a material set with normals: mean and 95th percentile of the angle in degrees between decoded and original ones."""

    def places(self, config: AnyCodec) -> list[int]:
        """Which of the decoder's outputs stands for each channel. Raises ValueError for maps that the codec lacks."""
        return list(channel_places(self.maps, self.channels, config.maps, config.output_channels))


@dataclass(frozen=True, eq=False)
class Decoder:
    """Weights of one decoder: three linear layers, LeakyReLU after the first two, linear output."""

    weights: tuple[NDArray[np.float32], ...]
    """Per layer [outputs, inputs] float32, the shapes of `CodecConfig.layer_shapes`."""
    biases: tuple[NDArray[np.float32], ...]
    """Per layer [outputs] float32."""


AnyDecoder = Decoder | BlockDecoder
Layer = tuple[NDArray[np.float32], NDArray[np.float32] | None, NDArray[np.float32]]
"""(weight [outputs, inputs], scale [outputs] or None, bias [outputs]): scale * (weight x) + bias."""


def specialised_layers(decoder: Decoder, adapter: Adapter | None) -> list[Layer]:
    """The layers of `decoder` as `adapter` specialises them."""
    layers: list[Layer] = [(weight, None, bias) for weight, bias in zip(decoder.weights, decoder.biases, strict=True)]
    if adapter is not None:
        for number, (scale, bias) in enumerate(zip(adapter.scales, adapter.biases, strict=True)):
            layers[number] = (decoder.weights[number], scale, bias)
        if adapter.output_weight is not None and adapter.output_bias is not None:
            layers[-1] = (adapter.output_weight, None, adapter.output_bias)
    return layers


@dataclass(frozen=True)
class Grouping:
    """Which textures share a decoder. Texture i belongs to group `groups[i]`; groups are 0 .. group_count - 1."""

    name: str
    groups: tuple[int, ...]
    parameters: Mapping[str, Any] = field(default_factory=dict)
    """How the groups were found: JSON values only."""

    @classmethod
    def of_labels(cls, name: str, labels: Sequence[Hashable], parameters: Mapping[str, Any]) -> "Grouping":
        """Textures with equal labels share a group; groups are numbered by their first texture, whatever the labels are."""
        numbers = {label: number for number, label in enumerate(dict.fromkeys(labels))}
        return cls(name, tuple(numbers[label] for label in labels), parameters)

    @property
    def group_count(self) -> int:
        """Number of groups, and so of decoders."""
        return max(self.groups, default=-1) + 1

    @property
    def stored_decoders(self) -> int:
        """Decoders that a pack holds: none where the one that ships with the program serves all textures."""
        return 0 if self.name == UNIVERSAL else self.group_count


@dataclass(frozen=True, eq=False)
class Pack:
    """Everything needed to decode a set of textures; immutable."""

    config: AnyCodec
    grouping: Grouping
    textures: tuple[EncodedTexture, ...]
    decoders: tuple[AnyDecoder, ...]
    """All of the kind that `config` stands for."""
    training: Mapping[str, Any] = field(default_factory=dict)
    """Recipe, steps, seed and library versions, for the record: JSON values only."""
    path: Path | None = None
    """The file it was read from."""

    @property
    def name(self) -> str:
        """What messages call it: its file, else its grouping."""
        return str(self.path or self.grouping.name)

    @property
    def grid_config(self) -> CodecConfig:
        """`config` of a pack of codec `grid`. Raises InputError for another codec."""
        if isinstance(self.config, CodecConfig):
            return self.config
        raise InputError(f"{self.name}: codec {self.config.kind} has no hidden layers; use a pack of codec grid here")

    @property
    def grid_decoders(self) -> tuple[Decoder, ...]:
        """`decoders` of a pack of codec `grid`. Raises InputError for another codec."""
        return cast(tuple[Decoder, ...], self.decoders) if self.grid_config else ()

    @property
    def block_config(self) -> BlockCodecConfig:
        """`config` of a pack of codec `block`. Raises InputError for another codec."""
        if isinstance(self.config, BlockCodecConfig):
            return self.config
        raise InputError(f"{self.name}: codec {self.config.kind} has no basis; use a pack of codec block here")

    @property
    def block_decoders(self) -> tuple[BlockDecoder, ...]:
        """`decoders` of a pack of codec `block`. Raises InputError for another codec."""
        return cast(tuple[BlockDecoder, ...], self.decoders) if self.block_config else ()
