"""Joining packs of a library: the key of packs that can be joined, and the joined pack."""

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
"""Entry of a pack's training record with its settings key."""
KEY_DIGITS = 16
"""Hexadecimal digits of a settings key."""


def settings_key(config: CodecSettings, grouping: str, options: Mapping[str, Any]) -> str:
    """Return the key of encoding settings: a digest of codec settings, name of the grouping, and all other `options` (JSON values).

    Packs with equal keys have equal codec settings, so they can be joined.
    """
    content = json.dumps([codec_json(config), grouping, dict(options)], sort_keys=True)
    return hashlib.sha256(content.encode()).hexdigest()[:KEY_DIGITS]


def settings_of(
    config: CodecSettings, grouping: str, parameters: Mapping[str, Any], training: Mapping[str, Any]
) -> str:
    """Return the settings key in a pack's `training` record, else the key of that record."""
    recorded = training.get(SETTINGS)
    if isinstance(recorded, str) and recorded.isascii():
        return recorded
    return settings_key(config, grouping, {**training, **(parameters if grouping == UNIVERSAL else {})})


def joined_pack(packs: Sequence[Pack]) -> Pack:
    """Return one pack with the textures and decoders of `packs` (one or more), in their order. If several packs hold a texture, the
    first counts.

    Raises InputError for packs whose codecs or groupings differ, and for more textures or decoders than a pack may hold.
    """
    first, codec = packs[0], codec_of(packs[0].config)
    ships = codec.stored_decoders(first.grouping.name, len(first.decoders), first.config) < len(first.decoders)
    textures: dict[str, EncodedTexture] = {}
    decoders: list[Decoder] = list(first.decoders) if ships else []
    numbers: dict[tuple[bytes, ...], int] = {}

    def number(decoder: Decoder) -> int:
        # Packs that were encoded with the decoders of another pack share them.
        content = tuple(each.tobytes() for each in codec.decoder_tensors(decoder, first.config).values())
        if content not in numbers:
            numbers[content] = len(decoders)
            decoders.append(decoder)
        return numbers[content]

    for pack in packs:
        same = (pack.config, pack.grouping.name) == (first.config, first.grouping.name)
        if not same or (ships and pack.grouping.parameters != first.grouping.parameters):
            raise InputError(f"{pack.name}: has another codec or grouping than {first.name}; they cannot be joined")
        new = [texture for texture in pack.textures if texture.pixel_hash not in textures]
        groups = sorted({texture.group for texture in new})
        renumbered = {group: group if ships else number(pack.decoders[group]) for group in groups}
        textures |= {each.pixel_hash: replace(each, group=renumbered[each.group]) for each in new}
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
    """Return one pack of textures of several packs with one settings key.

    `packs` are the pixel hashes to read, by path of the pack below `folder`. Raises InputError as `read_textures` does.
    """
    return replace(joined_pack([read_textures(folder / name, wanted) for name, wanted in packs.items()]), path=folder)


def in_order(pack: Pack, places: Mapping[str, int]) -> Pack:
    """Return `pack` with its textures sorted by `places`, which are indices by pixel hash. Textures without a place come last."""
    textures = sorted(pack.textures, key=lambda texture: places.get(texture.pixel_hash, len(places)))
    grouping = Grouping(pack.grouping.name, tuple(each.group for each in textures), pack.grouping.parameters)
    return replace(pack, textures=tuple(textures), grouping=grouping)
