"""The JSON metadata of a `.ntc` file: between Pack objects and plain JSON, with every field checked (docs/pack-format.md)."""

import json
import math
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, fields
from typing import Any, NoReturn

from ntc.codec.config import CodecConfig
from ntc.metrics.metrics import finite_or_none
from ntc.pack.model import Grouping, Pack

FORMAT_VERSION = 1
METADATA_KEY = "ntc"
ADDED_FIELDS = {"adapters", "adapter_output", "weight_bits"}
SWITCHES = {"adapters", "adapter_output"}
"""Fields of the codec that the first files of this version lack: they mean the default."""
LARGEST_SIDE = 32768
"""Texels: the largest texture side a pack may name."""
LARGEST_COUNT = 65535
"""Most textures of a pack; the visibility buffer has 16 bits for a texture id."""
LARGEST_DECIBELS = 1000.0
WRAP_MODES = ("repeat", "mirror", "clamp")
COLOR_SPACES = ("srgb", "linear")


class MetadataError(Exception):
    """What is wrong with the metadata, naming the field."""


@dataclass(frozen=True)
class TextureMetadata:
    """An EncodedTexture without its arrays."""

    name: str
    pixel_hash: str
    width: int
    height: int
    channels: int
    color_space: Any
    wrap: Any
    category: str | None
    psnr_db: float | None


@dataclass(frozen=True)
class PackMetadata:
    """A Pack without its arrays."""

    config: CodecConfig
    grouping: Grouping
    decoders: int
    textures: tuple[TextureMetadata, ...]
    training: Mapping[str, Any]


def metadata_json(pack: Pack) -> str:
    """The metadata of `pack`; the same pack gives the same text."""
    return json.dumps(
        {
            "format_version": FORMAT_VERSION,
            "codec": asdict(pack.config),
            "grouping": {
                "name": pack.grouping.name,
                "parameters": dict(pack.grouping.parameters),
                "groups": list(pack.grouping.groups),
            },
            "decoders": len(pack.decoders),
            "textures": [
                {
                    "name": texture.name,
                    "pixel_hash": texture.pixel_hash,
                    "width": texture.width,
                    "height": texture.height,
                    "channels": texture.channels,
                    "color_space": texture.color_space,
                    "wrap": list(texture.wrap),
                    "category": texture.category,
                    "psnr_db": finite_or_none(texture.psnr_db),
                }
                for texture in pack.textures
            ],
            "training": dict(pack.training),
        },
        sort_keys=True,
        allow_nan=False,
    )


def _fail(message: str) -> NoReturn:
    raise MetadataError(message)


def _field(owner: Any, key: str, where: str, check: Callable[[Any], bool], expected: str) -> Any:
    if not isinstance(owner, dict):
        _fail(f"{where} is not an object")
    if key not in owner:
        _fail(f"{where}.{key} is missing")
    if not check(owner[key]):
        _fail(f"{where}.{key} is {str(owner[key])[:60]!r}, expected {expected}")
    return owner[key]


def _is_text(value: Any) -> bool:
    """A text that can be printed: JSON can spell half of a surrogate pair, which no output accepts."""
    return isinstance(value, str) and len(value) <= 4096 and not any("\ud800" <= letter <= "\udfff" for letter in value)


def _is_count(low: int, high: int) -> Callable[[Any], bool]:
    return lambda value: isinstance(value, int) and not isinstance(value, bool) and low <= value <= high


def _is_object(value: Any) -> bool:
    return isinstance(value, dict)


def _is_optional_decibels(value: Any) -> bool:
    if value is None:
        return True
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) <= LARGEST_DECIBELS


def _codec(document: Any) -> CodecConfig:
    codec = _field(document, "codec", "metadata", _is_object, "an object")
    known = {field.name for field in fields(CodecConfig)}
    if not known - ADDED_FIELDS <= set(codec) <= known:
        _fail(f"codec has fields {sorted(codec)[:12]}, expected {sorted(known)}")
    for name, value in codec.items():
        if name in SWITCHES:
            if not isinstance(value, bool):
                _fail(f"codec.{name} is {str(value)[:60]!r}, expected true or false")
            continue
        whole = isinstance(value, int) and not isinstance(value, bool)
        if not (whole or (name == "levels" and value is None) or (name == "leaky_slope" and isinstance(value, float))):
            _fail(f"codec.{name} is {str(value)[:60]!r}, expected a number")
    try:
        return CodecConfig(**codec)
    except ValueError as error:
        _fail(str(error))


def _texture(document: Any, index: int, config: CodecConfig) -> TextureMetadata:
    where = f"textures[{index}]"
    side = _is_count(1, LARGEST_SIDE)
    wrap = _field(
        document,
        "wrap",
        where,
        lambda value: isinstance(value, list) and len(value) == 2 and all(mode in WRAP_MODES for mode in value),
        f"two of {WRAP_MODES}",
    )
    return TextureMetadata(
        name=_field(document, "name", where, _is_text, "a text"),
        pixel_hash=_field(document, "pixel_hash", where, _is_text, "a text"),
        width=_field(document, "width", where, side, f"1 to {LARGEST_SIDE}"),
        height=_field(document, "height", where, side, f"1 to {LARGEST_SIDE}"),
        channels=_field(
            document, "channels", where, _is_count(1, config.output_channels), "the codec's output channels or fewer"
        ),
        color_space=_field(
            document, "color_space", where, lambda value: value in COLOR_SPACES, f"one of {COLOR_SPACES}"
        ),
        wrap=(wrap[0], wrap[1]),
        category=_field(document, "category", where, lambda value: value is None or _is_text(value), "a text or null"),
        psnr_db=_field(document, "psnr_db", where, _is_optional_decibels, "a number of dB or null"),
    )


def _reject_constant(name: str) -> NoReturn:
    _fail(f"the metadata contains {name}, which is not a finite number")


def _finite_number(text: str) -> float:
    number = float(text)
    return number if math.isfinite(number) else _reject_constant(text[:60])


def parse_metadata(text: str) -> PackMetadata:
    """Metadata from the text of a file. Raises MetadataError naming the first field that is wrong."""
    try:
        document = json.loads(text, parse_constant=_reject_constant, parse_float=_finite_number)
    except (ValueError, RecursionError) as error:
        # ValueError beside JSONDecodeError: Python refuses to read integers of thousands of digits.
        raise MetadataError("the metadata is not JSON") from error
    version = _field(document, "format_version", "metadata", _is_count(0, 2**31), "a number")
    if version != FORMAT_VERSION:
        _fail(f"format version {version}, this program reads {FORMAT_VERSION}")
    config = _codec(document)
    textures = _field(
        document, "textures", "metadata", lambda v: isinstance(v, list) and len(v) <= LARGEST_COUNT, "a list"
    )
    decoders = _field(document, "decoders", "metadata", _is_count(0, LARGEST_COUNT), f"0 to {LARGEST_COUNT}")
    grouping = _field(document, "grouping", "metadata", _is_object, "an object")
    in_range = _is_count(0, decoders - 1)
    groups = _field(
        grouping,
        "groups",
        "grouping",
        lambda value: isinstance(value, list) and len(value) == len(textures) and all(map(in_range, value)),
        f"{len(textures)} decoder indices below {decoders}",
    )
    return PackMetadata(
        config=config,
        grouping=Grouping(
            name=_field(grouping, "name", "grouping", lambda value: _is_text(value) and value != "", "a text"),
            groups=tuple(groups),
            parameters=_field(grouping, "parameters", "grouping", _is_object, "an object"),
        ),
        decoders=decoders,
        textures=tuple(_texture(texture, index, config) for index, texture in enumerate(textures)),
        training=_field(document, "training", "metadata", _is_object, "an object"),
    )
