"""Writing the pack of a run to a file."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from ntc.codec.model import Pack
from ntc.errors import InputError
from ntc.io import numbered_path
from ntc.pack.diff import changed_textures, same_shape
from ntc.pack.file import read_pack, write_pack
from viewer.locations import DATA_FOLDER_VARIABLE, packs_folder
from viewer.scene.scene_files import PACK_SUFFIX
from viewer.state.pack_files import same_place

FileStamp = tuple[int, int, int]
"""Inode, time of the last change in ns, and bytes of a file: differs when the file has been written anew."""


def default_path(scene_path: Path | None, pack: Pack) -> Path:
    """`SCENE.GROUPING.ntc` beside the scene, or in the user's data folder for a built-in one, which is made where it is not there.

    Raises InputError for a scene without file.
    """
    if scene_path is None:
        raise InputError("the scene was not read from a file; name the file to write the pack to")
    folder = packs_folder(scene_path)
    if folder != scene_path.parent:
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InputError(f"{folder}: cannot be created ({error.strerror}); set {DATA_FOLDER_VARIABLE}") from error
    return folder / f"{scene_path.stem}.{pack.grouping.name}{PACK_SUFFIX}"


def save_numbered(path: Path, pack: Pack) -> Pack:
    """Write `pack` to `path`, with a number where that exists, and return it with its path. Raises InputError.

    No file is replaced, also where two programs write at once.
    """
    while True:
        free = numbered_path(path)
        try:
            free.touch(exist_ok=False)
        except FileExistsError:
            continue
        except OSError as error:
            raise InputError(f"{free}: cannot be written ({error.strerror}); choose a writable folder") from error
        try:
            write_pack(free, pack)
        except BaseException:
            free.unlink(missing_ok=True)
            raise
        return replace(pack, path=free)


def checked_path(path: Path) -> Path:
    """`path`. Raises InputError for a name that no pack can have."""
    if path.suffix != PACK_SUFFIX:
        raise InputError(f"{path}: a pack's name ends in {PACK_SUFFIX}")
    if path.is_dir():
        raise InputError(f"{path}: is a folder; name a file")
    return path


def _is_as_opened(path: Path, opened: Sequence[Pack]) -> bool:
    """Whether the file at `path` still holds one of these packs, which were read from there or written to it."""
    try:
        present = read_pack(path)
    except InputError:
        return False
    return any(
        pack.grouping == present.grouping and same_shape(pack, present) and not changed_textures(pack, present)
        for pack in opened
    )


def file_stamp(path: Path) -> FileStamp | None:
    """The stamp of the file at `path`; None without one."""
    try:
        status = path.stat()
    except OSError:
        return None
    return status.st_ino, status.st_mtime_ns, status.st_size


def save_pack(path: Path, pack: Pack, opened: Sequence[Pack] = (), written: FileStamp | None = None) -> Pack:
    """Write `pack` and return it with its path.

    Raises InputError where the file cannot be written, and where it is that of one of the `opened` packs but another program has
    changed it since. `written` is the stamp of the file as this program wrote it last.
    """
    own = [other for other in opened if other.path is not None and same_place(other.path, path)]
    present = file_stamp(path)
    if own and present is not None and present != written and not _is_as_opened(path, own):
        raise InputError(
            f"{path}: has changed since it was opened; accept under another name (training.accept FILE), or open it again first"
        )
    write_pack(path, pack)
    return replace(pack, path=path)
