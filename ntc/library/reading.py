"""The packs that a library gives for some textures: of each shard only those are read."""

from collections.abc import Container, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from ntc.codec.model import Grouping, Pack
from ntc.errors import InputError
from ntc.library.index import LibraryIndex, read_index
from ntc.library.joining import joined_pack
from ntc.library.records import Shard
from ntc.pack.partial import read_textures

Shards = Sequence[tuple[Shard, frozenset[str]]]
"""Shards, and the pixel hashes of the textures that each is to give."""


def library_packs(folder: Path, wanted: Container[str], most: int | None = None) -> list[Pack]:
    """The textures of the library in `folder` whose pixel hash is `wanted`: a pack for each way in which they were encoded.

    Those that hold the most textures come first, `most` of them (None: all). Raises InputError where the library, or a shard, cannot
    be read.
    """
    index = read_index(folder)
    chosen = list(index.shards_with(wanted).values())[:most]
    return [read_shards(index, shards) for shards in chosen]


def read_shards(index: LibraryIndex, shards: Shards) -> Pack:
    """What `shards`, all of one settings key, give, as one pack. Raises InputError."""
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
    """`pack` with its textures in the order of `places`, by pixel hash; those that it does not name come last."""
    textures = sorted(pack.textures, key=lambda texture: places.get(texture.pixel_hash, len(places)))
    grouping = Grouping(pack.grouping.name, tuple(each.group for each in textures), pack.grouping.parameters)
    return replace(pack, textures=tuple(textures), grouping=grouping)
