"""`ntc-viewer library`: adds packs to a library, lists and verifies its content, and extracts textures as one pack."""

import json
import sys
from collections.abc import Iterator
from pathlib import Path

from ntc.errors import InputError
from ntc.library.index import Library, library_packs
from ntc.pack.file import pack_bytes, read_pack, write_pack
from viewer.cli.options import LibraryOptions
from viewer.cli.sources import load_with_progress
from viewer.locations import named_scene
from viewer.scene.json_text import counted, printable
from viewer.scene.scene_files import PACK_SUFFIX
from viewer.scene.text_table import Cell, Column, Table
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
    Column("pack", "pack"),
)
HAS_PROBLEMS = 1
"""Exit status of `verify` where a pack is damaged."""


def _rows(library: Library) -> Iterator[dict[str, Cell]]:
    for (settings, _), (name, texture) in library.textures.items():
        yield {
            "name": printable(texture.name),
            "pixel_hash": texture.pixel_hash,
            "width": texture.width,
            "height": texture.height,
            "bits_per_texel": texture.bits_per_texel,
            "psnr_db": texture.psnr_db,
            "grouping": printable(library.packs[name].grouping),
            "settings": settings,
            "pack": printable(name),
        }


def library_lines(folder: Path, as_json: bool) -> list[str]:
    """Return the lines of `library list` and of `info` for the library in `folder`. Raises InputError."""
    library = Library(folder)
    rows = list(_rows(library))
    if as_json:
        return [json.dumps(rows, indent=1)]
    size = sum(pack.stamp[0] for pack in library.packs.values())
    total = f"{counted(len(library.packs), 'pack')}, {counted(len(rows), 'texture')}, {size / 1e6:.2f} MB"
    left_out = [f"left out: {problem}" for problem in library.unreadable.values()]
    return [*Table(COLUMNS, rows).text().splitlines(), f"{folder}: {total}", *left_out]


def _refuse_further(options: LibraryOptions) -> None:
    """Refuse options that the action does not have. Raises InputError."""
    if options.action in ("list", "verify") and options.files:
        raise InputError(f"library {options.action}: takes the library alone, not {options.files[0]}")
    if options.action != "extract" and options.out is not None:
        raise InputError(f"library {options.action}: --out {options.out}: only extract writes a pack")
    if options.json and options.action != "list":
        raise InputError(f"library {options.action}: --json: only list prints JSON")


def _add(options: LibraryOptions) -> list[str]:
    if not options.files:
        raise InputError("library add: name the packs to add")
    packs = [read_pack(path) for path in options.files]
    library, lines = Library.to_write(options.folder), []
    for path, pack in zip(options.files, packs, strict=True):
        added = library.add(pack_bytes(pack))
        textures = counted(len(pack.textures), "texture")
        lines.append(f"{path}: {textures}{'' if added else '; the library holds them already'}")
    library.save()
    total = f"{counted(len(library.packs), 'pack')}, {counted(len(library.textures), 'texture')}"
    return [*lines, f"{options.folder}: {total}"]


def _extract(options: LibraryOptions) -> list[str]:
    if options.out is None or options.out.suffix != PACK_SUFFIX or len(options.files) > 1:
        raise InputError(f"library extract: name one scene or none, and the pack to write by --out F{PACK_SUFFIX}")
    wanted = wanted_textures(load_with_progress(named_scene(options.files[0]))) if options.files else None
    packs = library_packs(options.folder, wanted, most=1)
    if not packs:
        raise InputError(f"{options.folder}: holds no texture of {options.files[0]}; encode the scene first")
    write_pack(options.out, packs[0])
    return [f"wrote {options.out} ({counted(len(packs[0].textures), 'texture')})"]


def library(options: LibraryOptions) -> int:
    """Run `ntc-viewer library`. Raises InputError for bad input."""
    _refuse_further(options)
    has_problems = False
    match options.action:
        case "add":
            lines = _add(options)
        case "list":
            lines = library_lines(options.folder, options.json)
        case "verify":
            lines = list(Library(options.folder).problems())
            has_problems = bool(lines)
            lines = lines or [f"{options.folder}: all packs are as they were written"]
        case "extract":
            lines = _extract(options)
    sys.stdout.write("\n".join(lines) + "\n")
    return HAS_PROBLEMS if has_problems else 0
