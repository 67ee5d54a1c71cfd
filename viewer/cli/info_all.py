"""`ntc-viewer info --all DIR`: every scene and pack below a folder in one table."""

import json
import os
import sys
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Literal

from ntc.errors import InputError
from ntc.io import is_partial
from ntc.pack.file import read_pack
from viewer.cli.table import Column, Table
from viewer.scene.json_text import counted, printable
from viewer.scene.load import load_scene
from viewer.scene.scene_files import PACK_SUFFIX

KINDS = {".gltf": "glTF", ".glb": "GLB", PACK_SUFFIX: "pack"}
"""Kind of file by suffix; other files are skipped."""

Outcome = Literal["read", "refused", "crashed"]


@dataclass(frozen=True)
class FileInfo:
    """Result of reading one file."""

    file: str
    """Path below the folder."""
    kind: str
    outcome: Outcome
    message: str = ""
    """Why it was not read: one line."""
    triangles: int | None = None
    textures: int | None = None
    honoured: tuple[str, ...] = ()
    ignored: tuple[str, ...] = ()
    missing: tuple[str, ...] = ()

    def row(self) -> dict[str, str | int | None]:
        """The file as a row of the table."""
        return {
            "file": self.file,
            "kind": self.kind,
            "result": self.outcome if not self.message else f"{self.outcome}: {self.message}",
            "triangles": self.triangles,
            "textures": self.textures,
            **{key: "; ".join(getattr(self, key)) or None for key in ("honoured", "ignored", "missing")},
        }


COLUMNS = tuple(
    Column(key, key) for key in ("file", "kind", "result", "triangles", "textures", "honoured", "ignored", "missing")
)


def files_below(folder: Path) -> list[Path]:
    """Every scene and pack below `folder`, sorted by path; links are not followed. Raises InputError."""

    def refuse(error: OSError) -> None:
        if isinstance(error, FileNotFoundError) and Path(error.filename) != folder:
            # Deleted since its parent was listed.
            return
        raise InputError(f"{error.filename}: cannot be listed ({error.strerror}); check the path") from error

    found: list[Path] = []
    for place, _, names in os.walk(folder, onerror=refuse):
        paths = (Path(place, name) for name in names)
        found.extend(
            path
            for path in paths
            if path.suffix.lower() in KINDS and not is_partial(path) and path.is_file() and not path.is_symlink()
        )
    return sorted(found)


def describe_file(path: Path, name: str) -> FileInfo:
    """Read the file at `path`, called `name` in the table; errors become part of the result."""
    kind = KINDS[path.suffix.lower()]
    name = printable(name)
    try:
        if kind == "pack":
            pack = read_pack(path)
            facts = (f"grouping {printable(pack.grouping.name)}, {counted(len(pack.decoders), 'decoder')}",)
            return FileInfo(name, kind, "read", textures=len(pack.textures), honoured=facts)
        scene = load_scene(path)
    except InputError as error:
        # The table names the file already.
        return FileInfo(name, kind, "refused", str(error).removeprefix(f"{path}: "))
    except Exception as error:  # noqa: BLE001  A crash on one file is a row of the table, not its end.
        return FileInfo(name, kind, "crashed", printable(f"{type(error).__name__}: {error}"))
    report = scene.report
    return FileInfo(
        file=name,
        kind=kind,
        outcome="read",
        triangles=report.used["triangles"],
        textures=report.used["textures"],
        honoured=report.honoured,
        ignored=report.ignored,
        missing=report.missing,
    )


def describe_all(folder: Path) -> Iterator[FileInfo]:
    """All scenes and packs below `folder`, with progress on a terminal. Raises InputError where it cannot be listed."""
    paths = files_below(folder)
    on_terminal = sys.stderr.isatty()
    for number, path in enumerate(paths, 1):
        name = path.relative_to(folder).as_posix()
        if on_terminal:
            sys.stderr.write(f"\r\x1b[K{number} of {len(paths)}: {printable(name)[:60]}")
            sys.stderr.flush()
        yield describe_file(path, name)
    if on_terminal and paths:
        sys.stderr.write("\r\x1b[K")


def info_all(folder: Path, as_json: bool) -> int:
    """Run `ntc-viewer info --all`. Refusing a file is no failure of the command. Raises InputError for a bad folder."""
    if not folder.is_dir():
        raise InputError(f"{folder}: not a folder; info FILE describes one file")
    files = list(describe_all(folder))
    counts = {outcome: sum(file.outcome == outcome for file in files) for outcome in ("read", "refused", "crashed")}
    if as_json:
        content: dict[str, Any] = {"folder": str(folder), **counts, "files": [asdict(file) for file in files]}
        sys.stdout.write(json.dumps(content, indent=2) + "\n")
        return 0
    if files:
        sys.stdout.write(Table(COLUMNS, [file.row() for file in files]).markdown() + "\n")
    sys.stdout.write(
        f"{counted(len(files), 'file')}: " + ", ".join(f"{count} {what}" for what, count in counts.items()) + "\n"
    )
    return 0
