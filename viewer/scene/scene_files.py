"""Scene files: which of a folder's files is meant, and what a file is that is no scene."""

import tempfile
import weakref
import zipfile
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

from ntc.errors import InputError
from ntc.pack import PACK_SUFFIX as PACK_SUFFIX
from viewer.scene.images import has_images
from viewer.scene.json_text import printable

SCENE_SUFFIXES = (".gltf", ".glb")
MESH_SUFFIXES = (".obj", ".ply", ".stl", ".off")
"""Formats that trimesh converts to GLB first."""
PANORAMA_SUFFIXES = (".hdr", ".exr")
SCENES_NAMED = 4
"""Scenes of a folder that a message names."""
PICTURES = {
    b"\x89PNG": "PNG",
    b"\xff\xd8\xff": "JPEG",
    b"RIFF": "WebP",
    b"DDS ": "DDS",
    b"\xabKTX": "KTX",
    b"GIF8": "GIF",
    b"BM": "BMP",
    b"II*\0": "TIFF",
    b"MM\0*": "TIFF",
}
"""First bytes of picture files."""
CAMERAS_FILE = "cameras.json"
"""Beside a scene, also with the scene's name and a dot before it."""
LONGEST_BEGINNING = 16
ARCHIVE_SUFFIX = ".zip"
OTHER_SCENES = (
    ".fbx",
    ".usd",
    ".usda",
    ".usdc",
    ".usdz",
    ".blend",
    ".dae",
    ".3ds",
    ".3mf",
    ".max",
    ".abc",
    ".x3d",
    ".wrl",
)
"""Formats of scenes that are not read."""
OTHER_ARCHIVES = (".7z", ".rar", ".tar", ".tgz", ".gz", ".bz2", ".xz", ".zst")
OPENABLE = "a scene is a .gltf, .glb, .zip with one of them, .obj, .ply, .stl, .off or a folder of images"


def scenes_in(folder: Path) -> tuple[Path, ...]:
    """Return the scenes that lie in `folder`, by name: glTF files and meshes. Raises OSError."""
    files = sorted(path for path in folder.iterdir() if not path.name.startswith(".") and path.is_file())
    return tuple(path for path in files if path.suffix.lower() in (*SCENE_SUFFIXES, *MESH_SUFFIXES))


def scene_file(path: Path) -> Path:
    """Return `path`, or where that is a folder, the one scene in it, and a folder without scenes but with images itself.

    Raises InputError for a folder with neither or with several scenes.
    """
    try:
        if not path.is_dir():
            return path
        found = scenes_in(path)
        if not found and has_images(path):
            return path
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); check the path") from error
    return one_scene(found, path, "folder")


def one_scene(found: Sequence[Path], path: Path, kind: str) -> Path:
    """Return the only one of `found`, the scenes in the folder or archive at `path`; glTF files go before meshes.
    Raises InputError."""
    found = [scene for scene in found if scene.suffix.lower() in SCENE_SUFFIXES] or found
    if len(found) == 1:
        return found[0]
    if not found:
        raise InputError(f"{path}: the {kind} holds no scene; {OPENABLE}")
    names = ", ".join(printable(scene.name) for scene in found[:SCENES_NAMED])
    more = f" and {len(found) - SCENES_NAMED} more" if len(found) > SCENES_NAMED else ""
    raise InputError(f"{path}: the {kind} holds {len(found)} scenes, name one of them: {names}{more}")


def require_scene(path: Path) -> None:
    """Refuse a file that is plainly something else than a scene. Raises InputError that says what it is and what to do with it."""
    suffix = path.suffix.lower()
    if path.parts[:1] in (("http:",), ("https:",)):
        raise InputError(f"{path}: scenes are opened from files; download it, then open the file")
    if suffix in SCENE_SUFFIXES or suffix in MESH_SUFFIXES or suffix == ARCHIVE_SUFFIX or path.is_dir():
        return
    if suffix in OTHER_SCENES:
        raise InputError(
            f"{path}: {suffix[1:].upper()} is not read; export the scene as glTF (.glb), for example with Blender"
        )
    if suffix in OTHER_ARCHIVES:
        raise InputError(f"{path}: {suffix[1:].upper()} is not unpacked; unpack it, then open the folder")
    begins = _beginning(path)
    if begins is None:
        # What cannot be read is told by whoever reads it.
        return
    picture = next((name for magic, name in PICTURES.items() if begins.startswith(magic)), None)
    if suffix == PACK_SUFFIX:
        raise InputError(
            f"{path}: is a pack of encoded textures, not a scene; open its scene, then drop the pack on the window, "
            f"or give both: ntc-viewer SCENE --pack {path}"
        )
    if suffix in PANORAMA_SUFFIXES:
        raise InputError(f"{path}: is a panorama, which lights a scene; open a scene, then drop it on the window")
    if picture is not None:
        raise InputError(f"{path}: is a picture ({picture}), not a scene; open the .gltf or .glb that uses it")
    if path.name == CAMERAS_FILE or path.name.endswith(f".{CAMERAS_FILE}"):
        raise InputError(f"{path}: holds cameras; they are read with the scene that lies beside it: open that")
    if not begins.lstrip(b"\xef\xbb\xbf \t\r\n").startswith((b"{", b"glTF")):
        kind = f"a {suffix} file" if suffix else "a file without a suffix"
        raise InputError(f"{path}: is {kind}, not a scene; {OPENABLE}")


def _beginning(path: Path) -> bytes | None:
    """Return the first bytes of a file; None where it cannot be read, or is empty."""
    try:
        if not path.is_file():
            return None
        with path.open("rb") as file:
            return file.read(LONGEST_BEGINNING) or None
    except OSError:
        return None


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
    """Return the one scene in the zip archive, unpacked with all that lies beside it.

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
    """Return the files by their names, with slashes."""
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
