"""The interface of a codec: everything that differs from codec to codec is a method of `Codec`. CONTRIBUTING tells how to add one."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, ClassVar, Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from ntc.codec.config import UNIVERSAL, Precision, WrapMode
from ntc.codec.encoding import (
    BitsTarget,
    Encoder,
    EncodingChoices,
    EncodingOptions,
    EncodingTask,
    TextureSet,
)
from ntc.codec.gpu import GpuTables
from ntc.codec.maps import MapName
from ntc.codec.model import CodecSettings, Decoder, EncodedTexture, Grouping, Pack
from ntc.codec.textures import SourceTexture
from ntc.errors import InputError

TensorShape = tuple[str, tuple[int | None, ...]]
"""(type as safetensors names it, shape); None: any number."""
Tensors = Mapping[str, NDArray[Any]]


class TorchTwin(Protocol):
    """Decodes the textures of one pack to tensors of torch, float32 (`ntc.codec.torch_texels.TorchTexels`)."""

    def texels(self, texture_index: int, at: Any, lod: Any, wrap: tuple[WrapMode, WrapMode]) -> Any:
        """Return [N, channels] float32 tensor in [0, 1] at `at` [N, 2], wrapped into [0, 1], and finite `lod` [N]: tensors on its
        device."""

    def decode_texels(
        self,
        texture_index: int,
        uv: NDArray[Any],
        lod: NDArray[Any],
        wrap: tuple[WrapMode, WrapMode] | None = None,
    ) -> NDArray[np.float32]:
        """Return [N, channels] float32 in [0, 1] at `uv` [N, 2] and `lod` [N]."""

    def mip(self, texture_index: int, level: int = 0) -> Any:
        """Return [h, w, channels] float32 tensor in [0, 1] on its device: mip `level`, decoded at its texel centres."""

    def decode_image(self, texture_index: int, level: int = 0) -> NDArray[np.uint8]:
        """Return [h, w, channels] uint8 in the texture's colour space: mip `level`, decoded at its texel centres."""


@dataclass(frozen=True)
class TextureBytes:
    """Stored bytes of one texture by what they are for."""

    latents: int
    constants: int
    """Value ranges, means and axes."""
    adapter: int = 0


@dataclass(frozen=True)
class ChosenPrecision:
    """A precision and why it was taken."""

    precision: Precision
    reason: str


SAMPLED_TEXELS = 2048
"""Texels whose bounds are told besides those of all texels."""


@dataclass(frozen=True)
class CertifiedError:
    """Bounds of the error of a pack in one precision, in [0, 1] (docs/explanation/accuracy.md)."""

    error: float
    """Error bound of every possible texel; 1 where numbers may overflow."""
    sampled: float
    """The largest bound among SAMPLED_TEXELS texels."""
    largest_sum: float
    """Largest magnitude of any sum on the way."""
    overflows: bool
    """True if a number may leave the range of the format it is kept in."""


class Codec(ABC):
    """A way to encode, store and decode textures. Codecs hold no state: every method takes what it works on."""

    settings_type: ClassVar[type[CodecSettings]]
    """Frozen dataclass; its fields are what files hold."""
    added_fields: ClassVar[frozenset[str]] = frozenset({"maps"})
    """Fields of the settings that older files lack; they then have their defaults."""
    shipped: ClassVar[Mapping[str, int]] = MappingProxyType({})
    """Parameters that a grouping `universal` records of the decoder that ships with the program; empty where none does."""
    uncertified: ClassVar[str] = "certified bounds of the error: the codec has none"
    """Text that `info` prints where there are no `certified_errors`."""
    trains: ClassVar[bool]
    """True if textures are trained in steps, by a recipe, while losses fall; else they are encoded one by one."""
    default_target: ClassVar[BitsTarget | None] = None
    """Target of an encoding where the user asks for none. None: the codec takes no target."""
    default_maps: ClassVar[Literal["all", "base"]] = "base"
    """Maps that are encoded where none are asked for: whole materials, or base colours alone."""
    psnr_title: ClassVar[str]
    """Title of the PSNRs under way (`TrainingProgress.psnr_db`): of samples, or of mip 0 of the textures done."""
    table_text: ClassVar[str] = "half precision"
    """Text for the table of memory: the contents of decoders on the GPU."""

    def target_of(self, maps: Sequence[MapName]) -> BitsTarget | None:
        """Return what textures of `maps` are encoded to where no target is asked for; None: the codec takes no target."""
        del maps
        return self.default_target

    # Files: tensors of a texture or decoder by name, "{}" standing for its number (docs/reference/pack-format.md).

    def former_format(self, fields: Mapping[str, Any]) -> int | None:
        """Return the format of a pack with these fields of settings, where it is one that is no longer read; else None."""
        del fields
        return None

    @abstractmethod
    def texture_shapes(self, settings: CodecSettings, width: int, height: int) -> dict[str, TensorShape]:
        """Return the type and shape of every tensor of a texture of `width` x `height` texels."""

    @abstractmethod
    def decoder_shapes(self, settings: CodecSettings) -> dict[str, TensorShape]:
        """Return the type and shape of every tensor of a decoder."""

    @abstractmethod
    def texture_tensors(self, texture: EncodedTexture, settings: CodecSettings) -> dict[str, NDArray[Any]]:
        """Return the tensors of a texture, contiguous."""

    @abstractmethod
    def decoder_tensors(self, decoder: Decoder, settings: CodecSettings) -> dict[str, NDArray[Any]]:
        """Return the tensors of a decoder, contiguous."""

    @abstractmethod
    def read_texture(self, tensors: Tensors, known: Mapping[str, Any], settings: CodecSettings) -> EncodedTexture:
        """Return the texture of these tensors, which have the expected shapes and are finite; `known` are the fields of
        EncodedTexture.

        Raises ValueError, which names the tensor, for what no encoder writes.
        """

    @abstractmethod
    def read_decoder(self, tensors: Tensors, settings: CodecSettings) -> Decoder:
        """Return the decoder of these tensors, as `read_texture` reads a texture."""

    def shipped_decoder(self, decoders: int, parameters: Mapping[str, Any], settings: CodecSettings) -> Decoder:
        """Return the decoder of a grouping `universal` of so many decoders with these parameters. Raises ValueError where none
        ships."""
        del decoders, parameters
        raise ValueError(f"grouping {UNIVERSAL}: no decoder of codec {settings.kind} ships with the program")

    def stored_decoders(self, grouping: str, decoders: int, settings: CodecSettings) -> int:
        """Return how many of so many decoders a pack of that grouping stores something of: none of the one that ships whole."""
        del settings
        return 0 if grouping == UNIVERSAL else decoders

    def shipped_groups(self, textures: Sequence[SourceTexture], most: int | None = None) -> tuple[int, ...]:
        """Return the group of each texture in grouping `universal`: at most `most` groups, or as many as the codec finds good."""
        del most
        return (0,) * len(textures)

    @abstractmethod
    def texture_bytes(self, texture: EncodedTexture, settings: CodecSettings) -> TextureBytes:
        """Return the bytes that a texture takes in a file, names and header left out."""

    @abstractmethod
    def decoder_bytes(self, decoder: Decoder, settings: CodecSettings) -> int:
        """Return the bytes that a decoder takes in a file."""

    # Decoding.

    @abstractmethod
    def reference_values(
        self,
        pack: Pack,
        texture_index: int,
        uv: NDArray[np.float64],
        lod: NDArray[np.float64],
        wrap: tuple[WrapMode, WrapMode],
    ) -> NDArray[np.float64]:
        """Return [N, output_channels] float64, not clamped, at `uv` [N, 2] and `lod` [N]: the slow twin of every other decoder."""

    def reference_mip(self, pack: Pack, texture_index: int, level: int) -> NDArray[np.float64] | None:
        """Return [h, w, channels] float64 in [0, 1] of mip `level`, where the codec has a faster way than texel by texel; else
        None."""
        del pack, texture_index, level
        return None

    def libntc_tables(self, pack: Pack) -> bytes | None:
        """Return the shipped tables that libntc needs to open `pack`, b"" for none; None where libntc does not decode the codec."""
        del pack
        return None

    def coverage_image(self, pack: Pack, texture_index: int, level: int) -> NDArray[np.uint8] | None:
        """Return [h, w] uint8 of the map `alpha` of mip `level`, which the texture has, where the codec decodes one map in a fraction
        of a second; else None. Renderers then draw what the original image covers."""
        del pack, texture_index, level
        return None

    @abstractmethod
    def torch_twin(
        self,
        pack: Pack,
        device: str,
        interruption: Callable[[], None] = lambda: None,
    ) -> TorchTwin:
        """Return a decoder of `pack` to tensors of torch. `interruption` is called before each piece of an image; what it raises
        ends the decode."""

    # Precision.

    def stored_pack(self, pack: Pack, precision: Precision) -> Pack:
        """Return what of `pack` is stored for decoding in `precision`, before numbers are rounded to halves."""
        del precision
        return pack

    def chosen_precision(self, pack: Pack, fastest_first: Sequence[Precision]) -> ChosenPrecision:
        """Return the first of these precisions whose error changes an 8-bit value by one step at most, or fp32."""
        del fastest_first
        return ChosenPrecision("fp32", f"codec {pack.config.kind} decodes in fp32 at every precision")

    def certified_errors(self, pack: Pack) -> Mapping[Precision, CertifiedError]:
        """Return the bounds of the error by precision, from the pack alone: the same on every machine. Empty where there are none."""
        del pack
        return {}

    # Graphics processors.

    @abstractmethod
    def gpu_tables(self, settings: CodecSettings, precision: Precision = "fp32") -> GpuTables:
        """Return what shaders read of packs with these settings, and the GLSL that reads it."""

    # Encoding.

    @abstractmethod
    def refusals(self, choices: EncodingChoices) -> list[str]:
        """Return lines about choices of the user that the codec does not have; empty: it can do what is asked for."""

    @abstractmethod
    def settings_for(self, textures: TextureSet, choices: EncodingChoices) -> CodecSettings:
        """Return the settings that such textures are encoded with. Raises InputError for a target out of reach."""

    @abstractmethod
    def options_for(self, choices: EncodingChoices) -> EncodingOptions:
        """Return the options that textures are encoded with."""

    def live_options_for(self, choices: EncodingChoices) -> EncodingOptions:
        """Return the options of an encoding that somebody watches: each group is the same whichever others are encoded."""
        return self.options_for(choices)

    def job_options_for(self, choices: EncodingChoices) -> EncodingOptions:
        """Return the options of one of many jobs, which has one core to itself."""
        return self.options_for(choices)

    def texture_bits(self, settings: CodecSettings, size: tuple[int, int]) -> tuple[float, float] | None:
        """Return the least and most bits per texel of mip 0 that the latents of a texture of `size` can take in a pack of these
        settings; None where a texture cannot be encoded anew with other bits than the others."""
        del settings, size
        return None

    def reencoding_options(self, pack: Pack, texture: int, bits: float) -> EncodingOptions:
        """Return the options that encode one texture of `pack` anew with `bits` bits per texel, and leave all others as they are.
        Raises InputError for bits out of reach."""
        del texture, bits
        raise InputError(f"codec {pack.config.kind}: cannot encode one texture again; retrain its group")

    @abstractmethod
    def recorded_options(self, options: EncodingOptions) -> dict[str, Any]:
        """Return what of `options` decides about the numbers of an encoding: JSON values."""

    @abstractmethod
    def encoder(self, task: EncodingTask) -> Encoder:
        """Return the work of an encoding. Raises InputError for a device that is missing."""

    def compiled_functions(self) -> Mapping[Any, tuple[Any, ...]]:
        """Return the functions of an encoder that numba compiles, each with the types of its arguments."""
        return {}

    @abstractmethod
    def starting_pack(self, textures: Sequence[SourceTexture], grouping: Grouping, settings: CodecSettings) -> Pack:
        """Return a pack that is shown until the first snapshots: flat colours. Latents have their largest size, so that what comes
        fits into as much memory."""

    def encode_with_decoders(self, textures: Sequence[SourceTexture], known: Pack, options: EncodingOptions) -> Pack:
        """Encode `textures` with the decoders of the pack `known`: each with the one that suits it best.

        Raises InputError where the codec has no way to do that.
        """
        del textures, options
        raise InputError(
            f"{known.name}: codec {known.config.kind} cannot encode with the decoders of another pack; use another codec"
        )

    # What people read.

    def settings_json(self, settings: CodecSettings) -> dict[str, Any]:
        """Return what reports tell of the settings besides their fields."""
        del settings
        return {}

    def settings_lines(self, settings: CodecSettings) -> list[str]:
        """Return lines about the settings for a terminal."""
        del settings
        return []

    def decoder_text(self, settings: CodecSettings) -> str:
        """Return the shape of decoders, as text that follows their number."""
        del settings
        return ""


def texture_fields(source: SourceTexture, group: int) -> dict[str, Any]:
    """Return the fields that `EncodedTexture` has of `source` in `group`; its quality is not yet known."""
    width, height = source.size
    return {
        "name": source.name,
        "pixel_hash": source.pixel_hash,
        "width": width,
        "height": height,
        "channels": source.channels,
        "color_space": source.color_space,
        "wrap": source.wrap,
        "category": source.category,
        "group": group,
        "maps": source.maps,
    }
