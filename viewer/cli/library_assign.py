"""`ntc-viewer library assign`: textures that a library lacks, encoded with decoders that it has."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from ntc.codec.block.config import BlockConfig
from ntc.codec.block.encoding.frozen import encode_with_decoders, measured_drift
from ntc.codec.block.model import BlockDecoder, block_parts
from ntc.codec.config import UNIVERSAL
from ntc.codec.model import Pack
from ntc.errors import InputError
from ntc.library.index import LibraryIndex, read_index
from ntc.library.joining import SETTINGS
from ntc.library.records import Shard
from ntc.library.writer import LibraryWriter
from ntc.pack.file import read_pack
from viewer.cli.encode import read_source
from viewer.scene.source_textures import MapChoice

MOST_DECODERS = 64
"""That a texture is tried with; of more, so many evenly spread ones."""
COMPARED = 16
"""Textures that are also encoded in a fresh group, to tell the drift."""


def _shards(index: LibraryIndex) -> list[Shard]:
    """The shards of the settings under which the library holds the most textures with decoders of its own."""
    counts: dict[str, int] = {}
    for shard in index.shards.values():
        if shard.grouping != UNIVERSAL:
            counts[shard.settings] = counts.get(shard.settings, 0) + len(shard.textures)
    if not counts:
        return []
    most = max(sorted(counts), key=lambda settings: counts[settings])
    return [shard for shard in index.shards.values() if shard.settings == most]


def _decoders(index: LibraryIndex, shards: list[Shard]) -> Iterator[tuple[Pack, BlockDecoder]]:
    """(its pack, decoder) of up to MOST_DECODERS decoders. Raises InputError for codec `grid`."""
    step = max(1, len(shards) // MOST_DECODERS)
    packs = [read_pack(index.path(shard)) for shard in shards[::step]]
    found = [(pack, decoder) for pack in packs for decoder in block_parts(pack).decoders]
    chosen = np.unique(np.linspace(0, len(found) - 1, min(len(found), MOST_DECODERS)).astype(int))
    yield from (found[place] for place in chosen)


def assign(folder: Path, source: Path) -> list[str]:
    """Encode the textures of `source` that the library lacks with decoders that it has, add them, and tell the drift.

    Raises InputError, for a library without decoders of its own too.
    """
    # A library that is not there is not made.
    read_index(folder)
    with LibraryWriter(folder) as writer:
        shards = _shards(writer.index)
        pairs = list(_decoders(writer.index, shards))
        if not pairs:
            raise InputError(f"{folder}: holds no decoder to encode with; encode a first set of textures into it")
        first = pairs[0][0]
        config: BlockConfig = block_parts(first).config
        maps: MapChoice = "base" if config.maps == ("base",) else "all"
        textures = read_source(source, None, maps).textures
        missing = [each for each in textures if not writer.index.holds(shards[0].settings, each.pixel_hash)]
        if not missing:
            return [f"{source}: the library holds all {len(textures)} textures"]
        decoders = [decoder for _, decoder in pairs]
        pack = encode_with_decoders(missing, decoders, config, first.grouping.name)
        drift = measured_drift(missing, decoders, config, COMPARED)
        record = {**pack.training, SETTINGS: shards[0].settings}
        writer.add_pack(replace(pack, training=record))
    return [
        f"{source}: {len(missing)} of {len(textures)} textures were added, with {len(pack.decoders)} of {len(decoders)} decoders",
        f"drift: {drift.frozen_db:.2f} dB with the library's decoders, {drift.fresh_db:.2f} dB in a fresh group: "
        f"{drift.loss_db:.2f} dB lost ({drift.textures} textures compared at equal bits)",
    ]
