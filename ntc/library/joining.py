"""Which packs can be one, and the one that they make."""

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from ntc.codec.config import UNIVERSAL
from ntc.codec.model import CodecSettings, Decoder, EncodedTexture, Grouping, Pack
from ntc.errors import InputError
from ntc.pack.schema import LARGEST_COUNT, codec_json

SETTINGS = "settings"
"""Entry of a pack's training record: the key of what was asked for."""
KEY_DIGITS = 16


def settings_key(config: CodecSettings, grouping: str, asked: Mapping[str, Any]) -> str:
    """Key of encodings that are alike: the codec's settings, the name of the grouping, and whatever else decides about the numbers.

    `asked` holds JSON values. Equal keys stand for equal settings of the codec, so that such packs can be joined.
    """
    content = json.dumps([codec_json(config), grouping, dict(asked)], sort_keys=True)
    return hashlib.sha256(content.encode()).hexdigest()[:KEY_DIGITS]


def settings_of(pack: Pack) -> str:
    """The key that `pack` records, else one of what it records of its encoding."""
    recorded = pack.training.get(SETTINGS)
    if isinstance(recorded, str):
        return recorded
    parameters = dict(pack.grouping.parameters) if pack.grouping.name == UNIVERSAL else {}
    return settings_key(pack.config, pack.grouping.name, {**pack.training, **parameters})


def joined_pack(packs: Sequence[Pack]) -> Pack:
    """The textures and decoders of all `packs` (one or more) in their order as one pack; of a texture that several hold, the first.

    Raises InputError for packs whose codecs or groupings differ, and for more textures or decoders than a pack may hold.
    """
    first = packs[0]
    ships = first.grouping.name == UNIVERSAL
    textures: dict[str, EncodedTexture] = {}
    decoders: list[Decoder] = list(first.decoders) if ships else []
    for pack in packs:
        same = (pack.config, pack.grouping.name) == (first.config, first.grouping.name)
        if not same or (ships and pack.grouping.parameters != first.grouping.parameters):
            raise InputError(f"{pack.name}: is not encoded as {first.name} is; they cannot be one pack")
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
