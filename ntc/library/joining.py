"""Which packs of a library can be joined, and the pack that they make."""

import hashlib
import json
from collections.abc import Container, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from ntc.codec.config import UNIVERSAL
from ntc.codec.model import CodecSettings, Decoder, EncodedTexture, Grouping, Pack
from ntc.codec.registry import codec_of
from ntc.errors import InputError
from ntc.pack.file import read_textures
from ntc.pack.schema import LARGEST_COUNT, codec_json

SETTINGS = "settings"
"""Entry of a pack's training record: the key of what was asked for."""
KEY_DIGITS = 16


def settings_key(config: CodecSettings, grouping: str, asked: Mapping[str, Any]) -> str:
    """Return the key of encodings that are alike: the codec's settings, the name of the grouping, and whatever else decides about the
    numbers.

    `asked` holds JSON values. Equal keys stand for equal settings of the codec, so that such packs can be joined.
    """
    content = json.dumps([codec_json(config), grouping, dict(asked)], sort_keys=True)
    return hashlib.sha256(content.encode()).hexdigest()[:KEY_DIGITS]


def settings_of(
    config: CodecSettings, grouping: str, parameters: Mapping[str, Any], training: Mapping[str, Any]
) -> str:
    """Return the key that a pack's `training` records, else one of what it records of its encoding."""
    recorded = training.get(SETTINGS)
    if isinstance(recorded, str) and recorded.isascii():
        return recorded
    return settings_key(config, grouping, {**training, **(parameters if grouping == UNIVERSAL else {})})


def joined_pack(packs: Sequence[Pack]) -> Pack:
    """Return the textures and decoders of all `packs` (one or more) in their order as one pack; of a texture that several hold, the
    first.

    Raises InputError for packs whose codecs or groupings differ, and for more textures or decoders than a pack may hold.
    """
    first, codec = packs[0], codec_of(packs[0].config)
    ships = codec.stored_decoders(first.grouping.name, len(first.decoders), first.config) < len(first.decoders)
    textures: dict[str, EncodedTexture] = {}
    decoders: list[Decoder] = list(first.decoders) if ships else []
    numbers: dict[tuple[bytes, ...], int] = {}

    def number(decoder: Decoder) -> int:
        # Packs that were encoded with decoders of one other pack have them in common.
        content = tuple(each.tobytes() for each in codec.decoder_tensors(decoder, first.config).values())
        if content not in numbers:
            numbers[content] = len(decoders)
            decoders.append(decoder)
        return numbers[content]

    for pack in packs:
        same = (pack.config, pack.grouping.name) == (first.config, first.grouping.name)
        if not same or (ships and pack.grouping.parameters != first.grouping.parameters):
            raise InputError(f"{pack.name}: has another codec or grouping than {first.name}; they cannot be joined")
        own = [texture for texture in pack.textures if texture.pixel_hash not in textures]
        groups = sorted({texture.group for texture in own})
        renumbered = {group: group if ships else number(pack.decoders[group]) for group in groups}
        textures |= {each.pixel_hash: replace(each, group=renumbered[each.group]) for each in own}
    if max(len(textures), len(decoders)) > LARGEST_COUNT:
        raise InputError(f"{len(textures)} textures: a pack holds at most {LARGEST_COUNT}; ask for fewer")
    parameters = first.grouping.parameters if ships or len(packs) == 1 else {"joined": True}
    record = {
        name: value for name, value in first.training.items() if all(p.training.get(name) == value for p in packs)
    }
    return Pack(
        first.config,
        Grouping(first.grouping.name, tuple(texture.group for texture in textures.values()), parameters),
        tuple(textures.values()),
        tuple(decoders),
        record,
    )


def joined_textures(folder: Path, packs: Mapping[str, Container[str]]) -> Pack:
    """Return textures of `packs`, all of one settings key, as one pack: by path below `folder`, with the pixel hashes to read of each.

    Raises InputError.
    """
    return replace(joined_pack([read_textures(folder / name, wanted) for name, wanted in packs.items()]), path=folder)


def in_order(pack: Pack, places: Mapping[str, int]) -> Pack:
    """Return `pack` with its textures in the order of `places`, by pixel hash; those that it does not name come last."""
    textures = sorted(pack.textures, key=lambda texture: places.get(texture.pixel_hash, len(places)))
    grouping = Grouping(pack.grouping.name, tuple(each.group for each in textures), pack.grouping.parameters)
    return replace(pack, textures=tuple(textures), grouping=grouping)
