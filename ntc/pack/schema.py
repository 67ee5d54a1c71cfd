"""The JSON metadata of a `.ntc` file: types with limits, reading and writing (docs/reference/pack-format.md#metadata)."""

import json
import math
import re
from dataclasses import asdict, dataclass, fields
from typing import Annotated, Any, Literal, NoReturn, TypeVar, cast

import msgspec
from msgspec import Meta

from ntc.codec.config import ColorSpace, WrapMode
from ntc.codec.maps import BASE_ALONE, LARGEST_CHANNELS, MapName, channel_places
from ntc.codec.model import CodecSettings, Pack
from ntc.codec.quality import finite_or_none
from ntc.codec.registry import FIRST_NAME, MODULES, codec_named
from ntc.errors import FormerFormatError, MetadataError

FORMAT_VERSION = 1
METADATA_KEY = "ntc"
KIND = "kind"
"""Field of `codec` with the codec's name. Files of codec `grid` lack it."""
LARGEST_SIDE = 32768
"""Largest side of a texture in texels."""
LARGEST_COUNT = 65535
"""Largest number of textures in a pack: the visibility buffer has 16 bits for a texture id."""
LARGEST_DECIBELS = 1000.0
LARGEST_DEGREES = 180.0

# Text that can be printed. JSON may hold half of a surrogate pair, which no output accepts.
Text = Annotated[str, Meta(max_length=4096, pattern="^[^\ud800-\udfff]*$")]
Side = Annotated[int, Meta(ge=1, le=LARGEST_SIDE)]
Decibels = Annotated[float, Meta(ge=-LARGEST_DECIBELS, le=LARGEST_DECIBELS)]
Degrees = Annotated[float, Meta(ge=0.0, le=LARGEST_DEGREES)]
T = TypeVar("T")


class TextureMetadata(msgspec.Struct, frozen=True):
    """Metadata of a texture: an EncodedTexture without its group and its arrays."""

    name: Text
    pixel_hash: Text
    width: Side
    height: Side
    channels: Annotated[int, Meta(ge=1, le=LARGEST_CHANNELS)]
    color_space: ColorSpace
    wrap: tuple[WrapMode, WrapMode]
    category: Text | None
    psnr_db: Decibels | None
    maps: tuple[MapName, ...] = BASE_ALONE
    map_psnr_db: tuple[Decibels | None, ...] = ()
    normal_degrees: tuple[Degrees, Degrees] | None = None
    code_mips: Literal[1, 2] | None = None


class GroupingMetadata(msgspec.Struct, frozen=True):
    """Metadata of the grouping."""

    name: Annotated[Text, Meta(min_length=1)]
    groups: tuple[int, ...]
    parameters: dict[str, Any]


@dataclass(frozen=True)
class PackMetadata:
    """Metadata of a pack: a Pack without its arrays."""

    codec: CodecSettings
    grouping: GroupingMetadata
    decoders: int
    textures: tuple[TextureMetadata, ...]
    training: dict[str, Any]


class _Document(msgspec.Struct, frozen=True):
    """The metadata after parsing, before the codec's fields are checked."""

    codec: dict[str, Any]
    grouping: GroupingMetadata
    decoders: Annotated[int, Meta(ge=0, le=LARGEST_COUNT)]
    textures: Annotated[tuple[TextureMetadata, ...], Meta(max_length=LARGEST_COUNT)]
    training: dict[str, Any]


class _Kind(msgspec.Struct, frozen=True):
    kind: str = FIRST_NAME


class _Version(msgspec.Struct):
    format_version: int


SET_FIELDS: dict[str, Any] = {
    "maps": BASE_ALONE,
    "map_psnr_db": (),
    "normal_degrees": None,
    "tables": None,
    "code_mips": None,
}
"""Fields that older files lack, and the values that an absent field means."""


def _without_set_fields(described: dict[str, Any]) -> dict[str, Any]:
    """Return `described` without fields that have the value of an absent field: packs of single textures then have no new fields."""
    return {name: value for name, value in described.items() if name not in SET_FIELDS or value != SET_FIELDS[name]}


def codec_json(config: CodecSettings) -> dict[str, Any]:
    """Return the settings of a codec as JSON values, as the metadata hold them."""
    # Files of codec `grid` have no field with its name.
    settings = _without_set_fields(asdict(cast(Any, config)))
    return settings if config.kind == FIRST_NAME else {KIND: config.kind, **settings}


def metadata_json(pack: Pack) -> str:
    """Return the metadata of `pack` as JSON text; the same pack gives the same text. Raises ValueError for numbers that are not
    finite."""
    textures = [{name: getattr(t, name) for name in TextureMetadata.__struct_fields__} for t in pack.textures]
    for texture in textures:
        # The PSNR of equal images is infinite, which JSON cannot hold.
        texture["psnr_db"] = finite_or_none(texture["psnr_db"])
        texture["map_psnr_db"] = tuple(map(finite_or_none, texture["map_psnr_db"]))
    grouping = {name: getattr(pack.grouping, name) for name in GroupingMetadata.__struct_fields__}
    document = {
        "format_version": FORMAT_VERSION,
        "codec": codec_json(pack.config),
        "grouping": {**grouping, "parameters": dict(pack.grouping.parameters)},
        "decoders": len(pack.decoders),
        "textures": list(map(_without_set_fields, textures)),
        "training": dict(pack.training),
    }
    return json.dumps(document, sort_keys=True, allow_nan=False)


def _reject_constant(name: str) -> NoReturn:
    raise MetadataError(f"the metadata contains {name}, which is not a finite number")


def _finite_number(text: str) -> float:
    number = float(text)
    return number if math.isfinite(number) else _reject_constant(text[:60])


def _converted(document: Any, kind: type[T], place: str = "metadata") -> T:
    """Return `document` converted to `kind`. Raises MetadataError with the first missing or wrong field, below `place`."""
    try:
        return msgspec.convert(document, kind)
    except (ValueError, OverflowError, RecursionError) as error:
        message, _, path = str(error).partition(" - at `$")
        field = f"{place}{path.rstrip('`')}"
        missing = re.fullmatch("Object missing required field `(.*)`", message)
        raise MetadataError(f"{field}.{missing[1]} is missing" if missing else f"{field}: {message}") from error


def _codec(document: dict[str, Any]) -> CodecSettings:
    """Return codec settings from their JSON fields. Raises MetadataError, FormerFormatError."""
    place = "metadata.codec"
    given = {name: value for name, value in document.items() if name != KIND}
    kind = _converted(document, _Kind, place).kind
    if kind not in MODULES:
        raise MetadataError(f"{place}.kind: Invalid enum value '{kind[:60]}'")
    codec = codec_named(kind)
    if former := codec.former_format(given):
        raise FormerFormatError(f"format {former} of codec {kind}, no longer read: encode again with this version")
    config = _converted(given, codec.settings_type, place)
    known = {field.name for field in fields(cast(Any, codec.settings_type))}
    if not known - codec.added_fields <= set(given) <= known:
        raise MetadataError(f"{place} has fields {sorted(given)[:12]}, expected {sorted(known)}")
    return config


def parse_metadata(text: str) -> PackMetadata:
    """Return the metadata in the JSON `text` of a file. Raises MetadataError with the first wrong field."""
    try:
        document = json.loads(text, parse_constant=_reject_constant, parse_float=_finite_number)
    except (ValueError, RecursionError) as error:
        # Python raises ValueError for integers of thousands of digits.
        raise MetadataError("the metadata is not JSON") from error
    version = _converted(document, _Version).format_version
    if version != FORMAT_VERSION:
        raise MetadataError(f"format version {version}, this program reads {FORMAT_VERSION}")
    parsed = _converted(document, _Document)
    metadata = PackMetadata(_codec(parsed.codec), parsed.grouping, parsed.decoders, parsed.textures, parsed.training)
    for index, texture in enumerate(metadata.textures):
        try:
            channel_places(texture.maps, texture.channels, metadata.codec.maps, metadata.codec.output_channels)
        except ValueError as error:
            raise MetadataError(
                f"metadata.textures[{index}].channels is {texture.channels}, the codec has "
                f"{metadata.codec.output_channels} output channels: {error}"
            ) from error
        if texture.code_mips is not None and texture.code_mips >= metadata.codec.mips_a_cell:
            most = metadata.codec.mips_a_cell
            raise MetadataError(
                f"metadata.textures[{index}].code_mips is {texture.code_mips}, the codec has {most} mips per code"
            )
        if len(texture.map_psnr_db) not in (0, len(texture.maps)):
            raise MetadataError(f"metadata.textures[{index}].map_psnr_db: does not fit {len(texture.maps)} maps")
    groups = metadata.grouping.groups
    if len(groups) != len(metadata.textures) or not all(0 <= group < metadata.decoders for group in groups):
        raise MetadataError(
            f"metadata.grouping.groups: expected {len(metadata.textures)} decoder indices below {metadata.decoders}"
        )
    return metadata
