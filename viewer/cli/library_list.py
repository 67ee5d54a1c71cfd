"""What a library holds, as a table or as JSON."""

import json
from collections.abc import Iterable
from pathlib import Path

from ntc.library.index import read_index
from viewer.cli.table import Cell, Column, Table
from viewer.scene.json_text import counted, printable

COLUMNS = (
    Column("name", "texture"),
    Column("pixel_hash", "pixel hash"),
    Column("width", "width"),
    Column("height", "height"),
    Column("bits_per_texel", "bits/texel"),
    Column("psnr_db", "PSNR dB"),
    Column("grouping", "grouping"),
    Column("settings", "settings"),
    Column("shard", "shard"),
)


def _rows(folder: Path) -> Iterable[dict[str, Cell]]:
    index = read_index(folder)
    for shard in index.shards.values():
        for texture in shard.textures:
            if index.places.get((shard.settings, texture.pixel_hash)) == shard.digest:
                yield {
                    "name": printable(texture.name),
                    "pixel_hash": texture.pixel_hash,
                    "width": texture.width,
                    "height": texture.height,
                    "bits_per_texel": texture.bits_per_texel,
                    "psnr_db": texture.psnr_db,
                    "grouping": printable(shard.grouping),
                    "settings": shard.settings,
                    "shard": index.path(shard).name,
                }


def library_lines(folder: Path, as_json: bool) -> list[str]:
    """What `library list` and `info` print of the library in `folder`. Raises InputError."""
    rows = list(_rows(folder))
    if as_json:
        return [json.dumps(rows, indent=1)]
    index = read_index(folder)
    size = sum(shard.bytes for shard in index.shards.values())
    total = f"{counted(len(index.shards), 'shard')}, {counted(len(rows), 'texture')}, {size / 1e6:.2f} MB"
    damaged = [f"note: line {number} of the index is damaged; run verify" for number in index.damaged_lines]
    return [*Table(COLUMNS, rows).text().splitlines(), f"{folder}: {total}", *damaged]
