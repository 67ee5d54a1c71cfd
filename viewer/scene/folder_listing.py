"""Lists of the files of a folder that can be opened, and typed paths: filtered and completed.
This module reads folders, never the files in them."""

import os
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import takewhile
from pathlib import Path
from typing import Literal

from ntc.errors import InputError
from viewer.scene.scene_files import ARCHIVE_SUFFIX, MESH_SUFFIXES, PACK_SUFFIX, PANORAMA_SUFFIXES, SCENE_SUFFIXES

EntryKind = Literal["folder", "scene", "pack", "panorama"]
MOST_LISTED = 2000
"""Most entries of one folder that are listed."""
_KINDS: dict[str, EntryKind] = {
    **dict.fromkeys((*SCENE_SUFFIXES, *MESH_SUFFIXES, ARCHIVE_SUFFIX), "scene"),
    **dict.fromkeys(PANORAMA_SUFFIXES, "panorama"),
    PACK_SUFFIX: "pack",
}


@dataclass(frozen=True)
class FolderEntry:
    """A folder, or a file that can be opened."""

    path: Path
    kind: EntryKind
    size: int = 0
    """Bytes; 0 for folders."""

    @property
    def name(self) -> str:
        """Name of the entry in the list: folders end in a slash."""
        return f"{self.path.name}/" if self.kind == "folder" else self.path.name


def list_folder(folder: Path) -> tuple[FolderEntry, ...]:
    """Return the folders in `folder`, then the files that can be opened, each sorted by name. Raises InputError.

    Hidden entries, and names that cannot be shown or typed, are left out.
    """
    listed: list[FolderEntry] = []
    try:
        with os.scandir(folder) as entries:
            for entry in entries:
                if not entry.name.startswith(".") and entry.name.isprintable():
                    listed += _entry(entry)
                if len(listed) == MOST_LISTED:
                    break
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else error
        raise InputError(f"{folder}: cannot be read ({reason}); check the path") from error
    return tuple(sorted(listed, key=lambda entry: (entry.kind != "folder", entry.name.lower())))


def _entry(entry: os.DirEntry[str]) -> list[FolderEntry]:
    path = Path(entry.path)
    try:
        if entry.is_dir():
            return [FolderEntry(path, "folder")]
        kind = _KINDS.get(path.suffix.lower())
        return [FolderEntry(path, kind, entry.stat().st_size)] if kind is not None and entry.is_file() else []
    except OSError:
        # A broken link, or an entry that was removed in the meantime.
        return []


def matching(entries: Sequence[FolderEntry], text: str) -> tuple[FolderEntry, ...]:
    """Return the entries that have every word of `text` in their names."""
    words = text.casefold().split()
    return tuple(entry for entry in entries if all(word in entry.name.casefold() for word in words))


def is_path(text: str) -> bool:
    """Return whether typed text is a path. Other text is part of a name to search for."""
    return "/" in text or os.sep in text or text.startswith("~")


def typed_folder(text: str, base: Path) -> tuple[Path, str]:
    """Return (folder, beginning of a name in it) of a typed path; relative ones start at `base`."""
    folder, name = os.path.split(os.path.expanduser(text))  # noqa: PTH111 - keeps what is no user, and a slash
    return base / folder, name


def completed(text: str, base: Path) -> str:
    """Return a typed path, completed by the beginning that all matching entries share; `text` where none matches."""
    folder, beginning = typed_folder(text, base)
    try:
        fitting = [entry for entry in list_folder(folder) if entry.name.startswith(beginning)]
    except InputError:
        return text
    common = _common_beginning([entry.name for entry in fitting])
    return text[: len(text) - len(beginning)] + common if len(common) > len(beginning) else text


def _common_beginning(names: Sequence[str]) -> str:
    """Return the longest common prefix of `names`; "" for no names."""
    if not names:
        return ""
    # All other names lie between the first and the last in alphabetical order, so those two decide.
    first, last = min(names), max(names)
    same = (one == other for one, other in zip(first, last, strict=False))
    return first[: sum(takewhile(bool, same))]
