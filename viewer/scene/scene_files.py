"""Scene files: the choice of the scene in a folder or archive, and messages for files that are no scene."""

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
"""Most scenes of a folder that a message names."""
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
"""Name of the cameras file beside a scene, or `SCENE.` and this name."""
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
    """Return the glTF files and meshes in `folder`, sorted by name. Raises OSError."""
    files = sorted(path for path in folder.iterdir() if not path.name.startswith(".") and path.is_file())
    return tuple(path for path in files if path.suffix.lower() in (*SCENE_SUFFIXES, *MESH_SUFFIXES))


def scene_file(path: Path) -> Path:
    """Return the scene that `path` means: the only scene in a folder, else `path`, also for a folder of images.

    Raises InputError for a folder with neither or with several scenes.
    """
    try:
        if not path.is_dir():
            return path
        scenes = scenes_in(path)
        if not scenes and has_images(path):
            return path
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); check the path") from error
    return one_scene(scenes, path, "folder")


def one_scene(scenes: Sequence[Path], path: Path, kind: str) -> Path:
    """Return the only glTF file of `scenes`, or without glTF files the only mesh. `path`: the folder or archive that holds them.
    Raises InputError for none and for several."""
    scenes = [scene for scene in scenes if scene.suffix.lower() in SCENE_SUFFIXES] or scenes
    if len(scenes) == 1:
        return scenes[0]
    if not scenes:
        raise InputError(f"{path}: the {kind} holds no scene; {OPENABLE}")
    names = ", ".join(printable(scene.name) for scene in scenes[:SCENES_NAMED])
    more = f" and {len(scenes) - SCENES_NAMED} more" if len(scenes) > SCENES_NAMED else ""
    raise InputError(f"{path}: the {kind} holds {len(scenes)} scenes, name one of them: {names}{more}")


def require_scene(path: Path) -> None:
    """Refuse a file that is something else than a scene. Raises InputError that says what it is and what to do with it."""
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
        # The reader of the file reports that it cannot be read.
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
"""Limit of the unpacked bytes of an archive: FREE_BYTES, and BYTES_PER_BYTE for each byte of the archive. Pictures and buffers
shrink 20 times at best."""
MOST_BYTES = 1 << 34
_CHUNK = 1 << 20


@dataclass(frozen=True, eq=False)
class UnpackedScene:
    """Scene in a temporary folder. The folder is removed when nothing refers to this object any more."""

    scene: Path


def unpacked_scene(archive: Path) -> UnpackedScene:
    """Return the only scene in the zip archive, unpacked with the files beside it.

    Raises InputError for a file that is no zip archive, holds no scene or several, is encrypted, would unpack to more than a multiple
    of its size, or names files outside of itself, and where no temporary file can be written.
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
    """Return the path of the only scene, unpacked into `folder`. Raises InputError."""
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
    # macOS adds a hidden file with metadata beside each file.
    hidden = any(part.startswith((".", "__MACOSX")) for part in path.parts)
    return not hidden and path.suffix.lower() in (*SCENE_SUFFIXES, *MESH_SUFFIXES)


def _refuse_others(archive: Path, names: Iterable[str]) -> None:
    """Refuse an archive that holds another archive, or a scene in an unsupported format. Raises InputError that names it."""
    for name in names:
        suffix = PurePosixPath(name).suffix.lower()
        if suffix in (ARCHIVE_SUFFIX, *OTHER_ARCHIVES):
            raise InputError(f"{archive}: holds another archive, {printable(name)}; unpack it, then open that")
        if suffix in OTHER_SCENES:
            remedy = "export it as glTF (.glb), for example with Blender"
            raise InputError(f"{archive}: holds {printable(name)}; {suffix[1:].upper()} is not read: {remedy}")


def _checked_files(content: zipfile.ZipFile, archive: Path) -> dict[str, zipfile.ZipInfo]:
    """Return the files of the archive by name, with slashes. Raises InputError for too many, too large or escaping ones."""
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
    # `ZipFile.extract` would follow links that an earlier entry made; here each entry is a plain file.
    with content.open(file) as source, target.open("wb") as output:
        left = file.file_size
        while left > 0:
            part = source.read(min(_CHUNK, left))
            if not part:
                raise EOFError("a file in it is truncated")
            output.write(part)
            left -= len(part)
