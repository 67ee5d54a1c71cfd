"""`ntc-viewer library`: adds packs and textures to a library, lists what it holds, verifies and compacts it, takes packs out."""

import json
import sys
from collections.abc import Iterable
from pathlib import Path

from ntc.errors import InputError
from ntc.library.index import read_index
from ntc.library.reading import library_packs
from ntc.library.writer import LibraryWriter, compact, problems
from ntc.pack.file import read_pack, write_pack
from viewer.cli.options import LibraryOptions
from viewer.cli.sources import load_with_progress
from viewer.cli.table import Cell, Column, Table
from viewer.locations import named_scene
from viewer.scene.json_text import counted, printable
from viewer.scene.scene_files import PACK_SUFFIX
from viewer.state.pack_files import wanted_textures

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
    """Return the lines of `library list` and of `info` for the library in `folder`. Raises InputError."""
    rows = list(_rows(folder))
    if as_json:
        return [json.dumps(rows, indent=1)]
    index = read_index(folder)
    size = sum(shard.bytes for shard in index.shards.values())
    total = f"{counted(len(index.shards), 'shard')}, {counted(len(rows), 'texture')}, {size / 1e6:.2f} MB"
    damaged = [f"note: line {number} of the index is damaged; run verify" for number in index.damaged_lines]
    return [*Table(COLUMNS, rows).text().splitlines(), f"{folder}: {total}", *damaged]


PROBLEMS_FOUND = 1
"""Exit status of `verify` where something is not as it was written."""


def _refuse_further(options: LibraryOptions) -> None:
    """Raises InputError for what the action does not take."""
    if options.action in ("list", "verify", "compact") and options.files:
        raise InputError(f"library {options.action}: takes the library alone, not {options.files[0]}")
    if options.action != "extract" and options.out is not None:
        raise InputError(f"library {options.action}: --out {options.out}: only extract writes a pack")
    if options.json and options.action != "list":
        raise InputError(f"library {options.action}: --json: only list prints JSON")


def _add(options: LibraryOptions) -> list[str]:
    if not options.files:
        raise InputError("library add: name the packs to add")
    packs = [read_pack(path) for path in options.files]
    with LibraryWriter(options.folder) as writer:
        lines = []
        for path, pack in zip(options.files, packs, strict=True):
            added = writer.add_pack(pack)
            lines.append(
                f"{path}: {counted(len(pack.textures), 'texture')}{'' if added else '; the library holds them already'}"
            )
        index = writer.index
        return [
            *lines,
            f"{options.folder}: {counted(len(index.shards), 'shard')}, {counted(len(index.places), 'texture')}",
        ]


def _assign(options: LibraryOptions) -> list[str]:
    if len(options.files) != 1:
        raise InputError("library assign: name one scene or folder of images")
    # Encoding takes torch, which takes a second to import.
    from viewer.cli.library_assign import assign

    return assign(options.folder, options.files[0])


def _compact(options: LibraryOptions) -> list[str]:
    with LibraryWriter(options.folder) as writer:
        done = compact(writer)
    lines = [f"left out: {line}" for line in done.dropped]
    if done.adopted:
        lines.append(f"added to the index: {counted(done.adopted, 'whole shard')} that it lacked")
    return [
        *lines,
        f"{options.folder}: {counted(done.shards_before, 'shard')} became {done.shards}, with {counted(done.textures, 'texture')}",
    ]


def _extract(options: LibraryOptions) -> list[str]:
    if options.out is None or options.out.suffix != PACK_SUFFIX or len(options.files) > 1:
        raise InputError(f"library extract: name one scene or none, and the pack to write by --out F{PACK_SUFFIX}")
    wanted = {pixel_hash for _, pixel_hash in read_index(options.folder).places}
    if options.files:
        wanted &= wanted_textures(load_with_progress(named_scene(options.files[0])))
    packs = library_packs(options.folder, wanted, most=1)
    if not packs:
        raise InputError(f"{options.folder}: holds no texture of {options.files[0]}; encode the scene first")
    write_pack(options.out, packs[0])
    return [f"wrote {options.out} ({len(packs[0].textures)} of {counted(len(wanted), 'texture')})"]


def library(options: LibraryOptions) -> int:
    """Run `ntc-viewer library`. Raises InputError for bad input."""
    _refuse_further(options)
    found = False
    match options.action:
        case "add":
            lines = _add(options)
        case "assign":
            lines = _assign(options)
        case "list":
            lines = library_lines(options.folder, options.json)
        case "verify":
            lines = list(problems(options.folder))
            found = bool(lines)
            lines = lines or [f"{options.folder}: all is as it was written"]
        case "compact":
            lines = _compact(options)
        case "extract":
            lines = _extract(options)
    sys.stdout.write("\n".join(lines) + "\n")
    return PROBLEMS_FOUND if found else 0
