"""`ntc-viewer library assign`: textures that a library lacks, encoded with decoders that it has."""

from dataclasses import replace
from pathlib import Path

from ntc.codec.config import UNIVERSAL
from ntc.codec.model import Pack
from ntc.codec.registry import codec_of
from ntc.errors import InputError
from ntc.library.index import LibraryIndex, Shard, read_index
from ntc.library.reading import SETTINGS
from ntc.library.writer import LibraryWriter
from ntc.pack.file import read_pack
from viewer.cli.encode import read_source
from viewer.scene.json_text import counted
from viewer.scene.source_textures import MapChoice

MOST_DECODERS = 64
"""Most decoders that a texture is tried with; of more, so many evenly spread ones."""


def _shards(index: LibraryIndex) -> list[Shard]:
    """Return the shards of the settings under which the library holds the most textures with decoders of its own."""
    counts: dict[str, int] = {}
    for shard in index.shards.values():
        if shard.grouping != UNIVERSAL:
            counts[shard.settings] = counts.get(shard.settings, 0) + len(shard.textures)
    if not counts:
        return []
    most = max(sorted(counts), key=lambda settings: counts[settings])
    return [shard for shard in index.shards.values() if shard.settings == most]


def _packs(index: LibraryIndex, shards: list[Shard]) -> list[Pack]:
    """Packs with up to MOST_DECODERS decoders or a few more, spread evenly over `shards`."""
    step = max(1, len(shards) // MOST_DECODERS)
    return [read_pack(index.path(shard)) for shard in shards[::step]]


def assign(folder: Path, source: Path) -> list[str]:
    """Encode the textures of `source` that the library lacks with decoders that it has, add them, and tell the drift.

    Raises InputError, for a library without decoders of its own too.
    """
    # A library that is not there is not made.
    read_index(folder)
    with LibraryWriter(folder) as writer:
        shards = _shards(writer.index)
        packs = _packs(writer.index, shards)
        if not any(pack.decoders for pack in packs):
            raise InputError(f"{folder}: holds no decoder to encode with; encode a first set of textures into it")
        config = packs[0].config
        maps: MapChoice = "base" if config.maps == ("base",) else "all"
        textures = read_source(source, None, maps).textures
        missing = [each for each in textures if not writer.index.holds(shards[0].settings, each.pixel_hash)]
        if not missing:
            return [f"{source}: the library holds all {counted(len(textures), 'texture')}"]
        found = codec_of(config).encode_with_decoders(missing, packs, MOST_DECODERS)
        record = {**found.pack.training, SETTINGS: shards[0].settings}
        writer.add_pack(replace(found.pack, training=record))
    return [
        f"{source}: {len(missing)} of {counted(len(textures), 'texture')} added, "
        f"with {len(found.pack.decoders)} of {counted(found.tried, 'decoder')}",
        f"drift: {found.frozen_db:.2f} dB with the library's decoders, {found.fresh_db:.2f} dB in a fresh group: "
        f"{found.fresh_db - found.frozen_db:.2f} dB lost ({counted(found.compared, 'texture')} compared at equal bits)",
    ]
