"""Writing the pack of a run to a file, in a thread."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from ntc.errors import InputError
from ntc.pack.diff import changed_textures, same_shape
from ntc.pack.file import read_pack, write_pack
from ntc.pack.model import Pack
from viewer.scene.model import Scene
from viewer.state.pack_files import PACK_SUFFIX, same_place

Stamp = tuple[int, int, int]
"""Number, time and length of a file."""


def default_path(scene: Scene, pack: Pack) -> Path:
    """`SCENE.GROUPING.ntc` beside the scene, or with a number where that is taken. Raises InputError for a scene without file."""
    if scene.path is None:
        raise InputError("the scene comes from no file; name the file that the pack is to be written to")
    stem = f"{scene.path.stem}.{pack.grouping.name}"
    number, path = 1, scene.path.with_name(f"{stem}{PACK_SUFFIX}")
    while path.exists():
        number += 1
        path = scene.path.with_name(f"{stem}-{number}{PACK_SUFFIX}")
    return path


def checked_path(path: Path) -> Path:
    """Raises InputError for a name that no pack can have."""
    if path.suffix != PACK_SUFFIX:
        raise InputError(f"{path}: a pack's name ends in {PACK_SUFFIX}")
    if path.is_dir():
        raise InputError(f"{path}: is a folder; name a file")
    return path


def is_as_opened(path: Path, opened: Sequence[Pack]) -> bool:
    """Whether the file at `path` holds what one of these packs, which were read from there or written to it, holds."""
    try:
        present = read_pack(path)
    except InputError:
        return False
    return any(
        pack.grouping == present.grouping and same_shape(pack, present) and not changed_textures(pack, present)
        for pack in opened
    )


def stamp_of(path: Path) -> Stamp | None:
    """What changes when the file does; None without one."""
    try:
        status = path.stat()
    except OSError:
        return None
    return status.st_ino, status.st_mtime_ns, status.st_size


def save_pack(path: Path, pack: Pack, opened: Sequence[Pack] = (), written: Stamp | None = None) -> Pack:
    """Write `pack` and return it with its path.

    Raises InputError where the file cannot be written, and where it is that of one of the `opened` packs but holds something else
    by now: somebody else's work. `written`: the stamp of the file as it was written last by this program.
    """
    own = [other for other in opened if other.path is not None and same_place(other.path, path)]
    present = stamp_of(path)
    if own and present is not None and present != written and not is_as_opened(path, own):
        raise InputError(
            f"{path}: has changed since it was opened; accept under another name (training.accept FILE), or open it again first"
        )
    write_pack(path, pack)
    return replace(pack, path=path)
