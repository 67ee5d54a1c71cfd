"""The packs that a library gives for some textures: which packs can be one, and the one that they make."""

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
from ntc.library.index import LibraryIndex, Shard, read_index
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


def settings_of(pack: Pack) -> str:
    """Return the key that `pack` records, else one of what it records of its encoding."""
    recorded = pack.training.get(SETTINGS)
    if isinstance(recorded, str):
        return recorded
    parameters = dict(pack.grouping.parameters) if pack.grouping.name == UNIVERSAL else {}
    return settings_key(pack.config, pack.grouping.name, {**pack.training, **parameters})


def joined_pack(packs: Sequence[Pack]) -> Pack:
    """Return the textures and decoders of all `packs` (one or more) in their order as one pack; of a texture that several hold, the
    first.

    Raises InputError for packs whose codecs or groupings differ, and for more textures or decoders than a pack may hold.
    """
    first = packs[0]
    stored = codec_of(first.config).stored_decoders(first.grouping.name, len(first.decoders), first.config)
    ships = stored < len(first.decoders)
    textures: dict[str, EncodedTexture] = {}
    decoders: list[Decoder] = list(first.decoders) if ships else []
    for pack in packs:
        same = (pack.config, pack.grouping.name) == (first.config, first.grouping.name)
        if not same or (ships and pack.grouping.parameters != first.grouping.parameters):
            raise InputError(f"{pack.name}: has another codec or grouping than {first.name}; they cannot be joined")
        own = [texture for texture in pack.textures if texture.pixel_hash not in textures]
        base = 0 if ships else len(decoders)
        if not ships:
            used = {group: base + number for number, group in enumerate(sorted({each.group for each in own}))}
            decoders += [pack.decoders[group] for group in used]
        for texture in own:
            textures[texture.pixel_hash] = texture if ships else replace(texture, group=used[texture.group])
    if max(len(textures), len(decoders)) > LARGEST_COUNT:
        raise InputError(f"{len(textures)} textures: a pack holds at most {LARGEST_COUNT}; ask for fewer")
    groups = tuple(texture.group for texture in textures.values())
    parameters = first.grouping.parameters if ships or len(packs) == 1 else {"joined": True}
    record = {
        name: value for name, value in first.training.items() if all(p.training.get(name) == value for p in packs)
    }
    return Pack(
        first.config,
        Grouping(first.grouping.name, groups, parameters),
        tuple(textures.values()),
        tuple(decoders),
        record,
    )


Shards = Sequence[tuple[Shard, frozenset[str]]]
"""Shards, and the pixel hashes of the textures that each is to give."""


def library_packs(folder: Path, wanted: Container[str], most: int | None = None) -> list[Pack]:
    """Return the textures of the library in `folder` whose pixel hash is `wanted`: a pack for each way in which they were encoded.

    Those that hold the most textures come first, `most` of them (None: all). Raises InputError where the library, or a shard, cannot
    be read.
    """
    index = read_index(folder)
    chosen = list(index.shards_with(wanted).values())[:most]
    return [read_shards(index, shards) for shards in chosen]


def read_shards(index: LibraryIndex, shards: Shards) -> Pack:
    """Return what `shards`, all of one settings key, give, as one pack. Raises InputError."""
    packs = [_read(index, shard, wanted) for shard, wanted in shards]
    return replace(joined_pack(packs), path=index.folder)


def _read(index: LibraryIndex, shard: Shard, wanted: frozenset[str]) -> Pack:
    pack = read_textures(index.path(shard), wanted)
    if len(pack.textures) < len(wanted):
        raise InputError(
            f"{index.path(shard)}: lacks textures that the library's index names; "
            f"run: ntc-viewer library verify {index.folder}"
        )
    return pack


def in_order(pack: Pack, places: Mapping[str, int]) -> Pack:
    """Return `pack` with its textures in the order of `places`, by pixel hash; those that it does not name come last."""
    textures = sorted(pack.textures, key=lambda texture: places.get(texture.pixel_hash, len(places)))
    grouping = Grouping(pack.grouping.name, tuple(each.group for each in textures), pack.grouping.parameters)
    return replace(pack, textures=tuple(textures), grouping=grouping)
