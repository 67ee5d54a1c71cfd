"""Data of a pack for shaders, as plain numpy, and the GLSL that reads it: the part that all codecs share. Needs no OpenGL.

Renderers upload and bind it, exporters write it out. Each codec's own part is a `GpuTables`.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from enum import IntEnum
from typing import ClassVar, Final, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ntc.codec.config import Precision, WrapMode
from ntc.codec.latents import LatentLevel, texture_levels
from ntc.codec.maps import CODED_PLANES, plane_channels
from ntc.codec.model import CodecSettings, Decoder, EncodedTexture, Pack

WeightPlace = Literal["uniforms", "storage", "image"]
"""Place of the weights that `run_decoders` reads: a uniform buffer, the storage buffer of all weights, or an image. Decoders too large
for uniform buffers are read from storage."""


@dataclass(frozen=True)
class DecoderVariant:
    """Settings of `run_decoders`, which decodes several pixels with one decoder. None of them changes a result."""

    pixels: int
    """Pixels that one invocation decodes: each weight is fetched once for all of them. More pixels take more registers."""
    unrolled: int
    """Blocks of the first layer that are written out one after the other: where all are, hidden values are stored without a choice."""
    weights: WeightPlace
    together: int
    """Codec `block`. 1: a work group decodes each code that its pixels read once, for all, and path `deferred` all planes in one pass.
    0: each pixel decodes for itself, plane by plane."""


VariantName = Literal["software", "gpu"]
SOFTWARE: Final = DecoderVariant(pixels=4, unrolled=1, weights="image", together=0)
"""Best on llvmpipe, which gathers a vector from a buffer, and from shared memory, number by number."""
GPU: Final = DecoderVariant(pixels=1, unrolled=16, weights="uniforms", together=1)
VARIANTS: Final[Mapping[VariantName, DecoderVariant]] = {"software": SOFTWARE, "gpu": GPU}


class DecodingBinding(IntEnum):
    """Binding points of the shader storage buffers that decoding shaders read."""

    TEXTURES = 1
    LEVELS = 2
    LATENTS = 3
    WEIGHTS = 4


class DecodingUniform(IntEnum):
    """Binding points of the uniform buffers that decoding shaders read."""

    DECODER = 0


class DecodingImage(IntEnum):
    """Image units that decoding shaders read."""

    WEIGHTS = 2
    LATENTS = 7


class WrapCode(IntEnum):
    """Wrap modes as GLSL sees them."""

    REPEAT = 0
    MIRROR = 1
    CLAMP = 2


WRAP_CODES: dict[WrapMode, WrapCode] = {"repeat": WrapCode.REPEAT, "mirror": WrapCode.MIRROR, "clamp": WrapCode.CLAMP}
WEIGHT_COLUMN_BITS = 11
"""Weights in an image lie in rows of 2^11 blocks."""
LATENT_COLUMN_BITS = 13
"""Latents in an image lie in rows of 2^13 words."""
LEVEL_RECORD = np.dtype(
    [
        ("width", "<i4"),
        ("height", "<i4"),
        ("texel_width", "<i4"),
        ("texel_height", "<i4"),
        ("first_cell", "<i4"),
        ("mip_of_cell", "<i4"),
        ("padding_1", "<i4"),
        ("padding_2", "<i4"),
    ]
)
"""One latent level: std430, 32 bytes. `first_cell` counts in the buffer of all latents, in rows (`GpuTables.row_words`);
`mip_of_cell` is as in LatentLevel."""
TextureFields = Sequence[tuple[str, str] | tuple[str, str, tuple[int, ...]]]
_TEXTURE_FIELDS: TextureFields = (
    ("first_level", "<i4"),
    ("levels", "<i4"),
    ("decoder", "<i4"),
    ("channels", "<i4"),
    ("srgb", "<i4"),
    ("adapter", "<i4"),
    ("finest_level", "<i4"),
    ("components", "<i4"),
)
_SCALARS = {np.dtype("<i4"): "int", np.dtype("<u4"): "uint", np.dtype("<f4"): "float"}


class StoredRows(NamedTuple):
    """Place of a level in a texture's latents, counted in rows."""

    first: int
    rows: int


class GpuTables(ABC):
    """Data that shaders read of packs with one codec's settings, stored in one precision.

    Decoders lie in one buffer, in blocks of four numbers: each decoder, then the adapter of each texture.
    """

    number_type: Literal["f4", "f2", "u4"]
    """Type of the numbers, as moderngl names it."""
    precision: Precision = "fp32"
    """Precision of the arithmetic; a codec may have no use for less than it is asked for."""
    decoder_blocks: int
    """Number of blocks of one decoder."""
    adapter_blocks: int = 0
    """Number of blocks of one texture's adapter."""
    loop_length: int = 1
    """Value of the uniform `network_blocks` in shaders."""
    row_words: int = 1
    """32-bit words of a row of latents."""
    shares_decoders: ClassVar[bool] = False
    """True if the codec's GLSL has `run_decoders`, which decodes several pixels of one decoder at once."""
    decodes_quads: ClassVar[bool] = False
    """True if the codec's GLSL has `block_texels`, which decodes four texels of a block at once."""
    together_shader: str = ""
    """Shader file that defines `decode_together`: a work group decodes each code that its pixels read once. "": there is none."""

    def __init__(self, settings: CodecSettings) -> None:
        self.settings = settings

    @property
    def block_bytes(self) -> int:
        """Bytes of four numbers."""
        return 8 if self.number_type == "f2" else 16

    # What is uploaded.

    @abstractmethod
    def decoder_data(self, decoder: Decoder) -> bytes:
        """Return the blocks of one decoder."""

    def adapter_data(self, texture: EncodedTexture) -> bytes:
        """Return the blocks of a texture's adapter."""
        del texture
        return b""

    def all_data(self, pack: Pack, textures: Sequence[EncodedTexture]) -> bytes:
        """Return all blocks of `pack` for those of its textures that are used."""
        decoders = map(self.decoder_data, pack.decoders)
        data = b"".join([*decoders, *map(self.adapter_data, textures)])
        return data or bytes(self.block_bytes)

    @property
    def texture_record(self) -> np.dtype:
        """One encoded texture: std430. `decoder` is -1 for a texture that the pack does not hold; `adapter` is the first block of its
        adapter, `finest_level` the finest mip whose latents are on the GPU. `components` has a bit for each component that the texture
        has, four for each of CODED_PLANES. The codec's own fields follow."""
        return np.dtype([*_TEXTURE_FIELDS, *self.record_fields])

    @property
    @abstractmethod
    def record_fields(self) -> TextureFields:
        """The codec's own fields of a texture's record."""

    @abstractmethod
    def fill_record_fields(self, record: np.void, texture: EncodedTexture) -> None:
        """Write the codec's own fields of a texture's record."""

    def fill_record(self, record: np.void, texture: EncodedTexture, first_level: int, adapter: int) -> None:
        """Write a texture's record: `first_level` is the row of its finest mip, `adapter` the first block of its adapter."""
        levels = texture_levels(texture, self.settings)
        record["first_level"], record["levels"] = first_level, len(levels)
        record["decoder"], record["channels"] = texture.group, texture.channels
        record["srgb"] = texture.color_space == "srgb"
        record["components"] = sum(
            1 << (4 * CODED_PLANES.index(plane) + component)
            for plane, channels in plane_channels(texture.maps, texture.channels).items()
            for component in channels
        )
        record["adapter"] = adapter
        self.fill_record_fields(record, texture)

    @abstractmethod
    def level_rows(self, texture: EncodedTexture) -> tuple[StoredRows, ...]:
        """Return the place of each level in the texture's latents, finest first. Raises ValueError for latents that no encoder
        writes."""

    @abstractmethod
    def latent_words(self, texture: EncodedTexture, rows: slice) -> NDArray[np.uint32]:
        """Return [rows, row_words] uint32: rows of the texture's latents."""

    # GLSL.

    @property
    @abstractmethod
    def shader(self) -> str:
        """The shader file of the codec: it defines `decode_at` (shaders/ntc/decode.glsl)."""

    @abstractmethod
    def defines(self) -> list[str]:
        """Return lines of GLSL with the codec's settings, for `generated/codec.glsl`."""

    def includes(self, variant: DecoderVariant) -> dict[str, str]:
        """Return the generated includes of the decoding shaders, by name."""
        lines = [
            "// Generated for the settings of one codec.",
            f"#define SHARES_DECODERS {int(self.shares_decoders)}",
            f"#define DECODES_TOGETHER {int(bool(self.together_shader) and variant.together)}",
            f"#define CELL_WORDS {self.row_words}",
            *defines_by_plane(self.settings, lambda place, _: {"PLANE_PLACE": str(place)}),
            *self.defines(),
            glsl_struct("TextureRecord", self.texture_record),
            "",
        ]
        return {
            "generated/decoding.glsl": decoding_layout_glsl(),
            "generated/codec.glsl": "\n".join(lines),
            "generated/decoder.glsl": f'#include "{self.shader}"\n',
            "generated/together.glsl": f'#include "{self.together_shader}"\n' if self.together_shader else "",
            "generated/shared_decoder.glsl": f"#define PIXELS {variant.pixels}\n",
        }


def level_records(pyramid: Sequence[LatentLevel]) -> NDArray[np.void]:
    """Return [levels] LEVEL_RECORD of one texture; `first_cell` is left 0."""
    records = np.zeros(len(pyramid), LEVEL_RECORD)
    for record, level in zip(records, pyramid, strict=True):
        record["width"], record["height"] = level.width, level.height
        record["texel_width"], record["texel_height"] = level.texel_width, level.texel_height
        record["mip_of_cell"] = level.mip_of_cell
    return records


def glsl_struct(name: str, record: np.dtype, nested: Mapping[np.dtype, str] | None = None) -> str:
    """Return the GLSL struct that has the layout of `record` under std430; `nested` names the structs of records in it."""
    lines = [f"struct {name} {{"]
    for field in record.names or ():
        kind = record[field]
        base, shape = kind.base, kind.shape
        if nested and base in nested:
            lines.append(f"    {nested[base]} {field}[{shape[0]}];")
        elif shape == ():
            lines.append(f"    {_SCALARS[base]} {field};")
        elif len(shape) == 1:
            lines.append(f"    vec{shape[0]} {field};")
        else:
            lines.append(f"    vec{shape[1]} {field}[{shape[0]}];")
    return "\n".join([*lines, "};"])


def glsl_codes(*enumerations: tuple[type[IntEnum], str]) -> list[str]:
    """Return a define for each member of (enumeration, prefix)."""
    return [f"#define {prefix}{member.name} {member.value}" for codes, prefix in enumerations for member in codes]


def decoding_layout_glsl() -> str:
    """Return the include `generated/decoding.glsl`: what decoding shaders of every codec read, with or without a scene."""
    lines = [
        "// Generated from ntc/codec/gpu.py.",
        *glsl_codes(
            (DecodingBinding, "BINDING_"),
            (DecodingUniform, "UNIFORM_"),
            (DecodingImage, "IMAGE_"),
            (WrapCode, "WRAP_"),
        ),
        *(f"#define PLANE_{plane.upper()} {number}" for number, plane in enumerate(CODED_PLANES)),
        f"#define WEIGHT_COLUMN_BITS {WEIGHT_COLUMN_BITS}",
        f"#define LATENT_COLUMN_BITS {LATENT_COLUMN_BITS}",
        glsl_struct("LevelRecord", LEVEL_RECORD),
    ]
    return "\n".join(lines) + "\n"


def defines_by_plane(
    settings: CodecSettings, values: Callable[[int, Mapping[int, int]], Mapping[str, str]]
) -> list[str]:
    """Return defines that differ from plane to plane, as `by_plane`: `values` returns expressions by name, with parameters if any.

    With ANY_PLANE 1, PLANE is a variable, and the defines choose by it.
    """
    found = {
        CODED_PLANES.index(plane): values(place, channels)
        for place, (plane, channels) in enumerate(plane_channels(settings.maps, settings.output_channels).items())
    }
    chosen = dict(next(reversed(found.values())))
    for number, own in list(reversed(found.items()))[1:]:
        chosen = {
            name: value if value == own[name] else f"(PLANE == {number} ? {own[name]} : {value})"
            for name, value in chosen.items()
        }
    return [
        "#if ANY_PLANE",
        *(f"#define {name} {value}" for name, value in chosen.items()),
        "#else",
        *by_plane(settings, lambda place, channels: [f"#define {n} {v}" for n, v in values(place, channels).items()]),
        "#endif",
    ]


def by_plane(settings: CodecSettings, lines: Callable[[int, Mapping[int, int]], list[str]]) -> list[str]:
    """Return GLSL that differs from plane to plane: `lines` gets the plane's number among those of the codec, and the channel of each
    of its components."""
    found = []
    for place, (plane, channels) in enumerate(plane_channels(settings.maps, settings.output_channels).items()):
        found += [f"#{'elif' if place else 'if'} PLANE == {CODED_PLANES.index(plane)}", *lines(place, channels)]
    return [*found, "#endif"]
