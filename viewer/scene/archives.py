"""Scenes in zip archives, as Sketchfab and others give them: unpacked into a temporary folder while they are open."""

import tempfile
import weakref
import zipfile
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

from ntc.errors import InputError
from viewer.scene.json_text import printable
from viewer.scene.scene_files import (
    ARCHIVE_SUFFIX,
    MESH_SUFFIXES,
    OTHER_ARCHIVES,
    OTHER_SCENES,
    SCENE_SUFFIXES,
    one_scene,
)

MOST_FILES = 1 << 16
FREE_BYTES = 1 << 28
BYTES_PER_BYTE = 200
"""An archive may hold FREE_BYTES, and beyond, so many for each of its own; pictures and buffers shrink 20 times at best."""
MOST_BYTES = 1 << 34
_CHUNK = 1 << 20


@dataclass(frozen=True, eq=False)
class UnpackedScene:
    """A scene in a temporary folder, which is removed when nothing refers to this any more."""

    scene: Path


def unpacked_scene(archive: Path) -> UnpackedScene:
    """The one scene in the zip archive, unpacked with all that lies beside it.

    Raises InputError for what is no zip archive, holds no scene or several, is encrypted, would unpack to more than a multiple of
    its size, names files outside of itself, or cannot be written.
    """
    try:
        folder = tempfile.TemporaryDirectory(prefix="ntc-viewer-")
    except OSError as error:
        raise InputError(f"{archive}: cannot be unpacked ({error.strerror or error}); set TMPDIR") from error
    try:
        unpacked = UnpackedScene(_unpack_all(archive, Path(folder.name)))
    except BaseException:
        folder.cleanup()
        raise
    weakref.finalize(unpacked, folder.cleanup)
    return unpacked


def _unpack_all(archive: Path, folder: Path) -> Path:
    """Path of the one scene, unpacked into `folder`. Raises InputError."""
    try:
        with zipfile.ZipFile(archive) as content:
            files = _checked_files(content, archive)
            scenes = [Path(name) for name in files if _is_scene(name)]
            if not scenes:
                _refuse_others(archive, files)
            inner = one_scene(scenes, archive, "archive")
            for name, file in files.items():
                _unpack(content, file, folder / name)
            return folder / inner
    except OSError as error:
        raise InputError(
            f"{archive}: cannot be unpacked ({error.strerror or error}); check the path and TMPDIR"
        ) from error
    except InputError:
        raise
    except Exception as error:  # zipfile lets many exceptions through on broken archives.
        raise InputError(
            f"{archive}: the archive cannot be unpacked ({printable(str(error))}); unpack it yourself"
        ) from error


def _is_scene(name: str) -> bool:
    path = PurePosixPath(name)
    # macOS puts a hidden twin of each file beside it.
    hidden = any(part.startswith((".", "__MACOSX")) for part in path.parts)
    return not hidden and path.suffix.lower() in (*SCENE_SUFFIXES, *MESH_SUFFIXES)


def _refuse_others(archive: Path, names: Iterable[str]) -> None:
    """Name a scene in a format that is not read, or an archive, where one lies in `archive`. Raises InputError."""
    for name in names:
        suffix = PurePosixPath(name).suffix.lower()
        if suffix in (ARCHIVE_SUFFIX, *OTHER_ARCHIVES):
            raise InputError(f"{archive}: holds another archive, {printable(name)}; unpack it, then open that")
        if suffix in OTHER_SCENES:
            remedy = "export it as glTF (.glb), for example with Blender"
            raise InputError(f"{archive}: holds {printable(name)}; {suffix[1:].upper()} is not read: {remedy}")


def _checked_files(content: zipfile.ZipFile, archive: Path) -> dict[str, zipfile.ZipInfo]:
    """The files by their names, with slashes."""
    files = [file for file in content.infolist() if not file.is_dir()]
    if len(files) > MOST_FILES:
        raise InputError(
            f"{archive}: {len(files)} files in an archive, at most {MOST_FILES} are read; unpack it yourself"
        )
    allowed = min(MOST_BYTES, FREE_BYTES + BYTES_PER_BYTE * archive.stat().st_size)
    size = sum(file.file_size for file in files)
    if size > allowed:
        raise InputError(f"{archive}: unpacks to {size} bytes, at most {allowed} are read; unpack it yourself")
    named = {file.filename.replace("\\", "/"): file for file in files}
    for name in named:
        path = PurePosixPath(name)
        if path.is_absolute() or ".." in path.parts or ":" in name or "\0" in name:
            raise InputError(f"{archive}: holds {name[:60]!r}, which leads out of the archive; it is not read")
    return named


def _unpack(content: zipfile.ZipFile, file: zipfile.ZipInfo, target: Path) -> None:
    target.parent.mkdir(parents=True, exist_ok=True)
    # `ZipFile.extract` would follow what an earlier entry made; here each entry is a plain file.
    with content.open(file) as source, target.open("wb") as output:
        left = file.file_size
        while left > 0:
            part = source.read(min(_CHUNK, left))
            if not part:
                raise EOFError("a file in it is truncated")
            output.write(part)
            left -= len(part)
