"""Writing the pack of a run to a file, in a thread."""

from dataclasses import replace
from pathlib import Path

from ntc.errors import InputError
from ntc.pack import Pack
from ntc.pack_file import write_pack
from viewer.pack_files import PACK_SUFFIX
from viewer.scene.model import Scene


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


def save_pack(path: Path, pack: Pack) -> Pack:
    """Write `pack` and return it with its path. Raises InputError where the file cannot be written."""
    write_pack(path, pack)
    return replace(pack, path=path)
