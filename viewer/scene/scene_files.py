"""Which files are scenes, which of a folder's files is meant, and what a file is that is none."""

from collections.abc import Sequence
from pathlib import Path

from ntc.errors import InputError
from viewer.scene.json_text import printable

SCENE_SUFFIXES = (".gltf", ".glb")
MESH_SUFFIXES = (".obj", ".ply", ".stl", ".off")
"""Formats that trimesh converts to GLB first."""
PANORAMA_SUFFIXES = (".hdr", ".exr")
PACK_SUFFIX = ".ntc"
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
"""How files of pictures begin."""
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
OPENABLE = "a scene is a .gltf, .glb, .zip with one of them, .obj, .ply, .stl or .off"


def scenes_in(folder: Path) -> tuple[Path, ...]:
    """The scenes that lie in `folder`, by name: glTF files and meshes. Raises OSError."""
    files = sorted(path for path in folder.iterdir() if not path.name.startswith(".") and path.is_file())
    return tuple(path for path in files if path.suffix.lower() in (*SCENE_SUFFIXES, *MESH_SUFFIXES))


def scene_file(path: Path) -> Path:
    """`path`, or where that is a folder, the one scene in it. Raises InputError for a folder with none or several."""
    try:
        if not path.is_dir():
            return path
        found = scenes_in(path)
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); check the path") from error
    return one_scene(found, path, "folder")


def one_scene(found: Sequence[Path], path: Path, kind: str) -> Path:
    """The only one of `found`, the scenes in the folder or archive at `path`; glTF files go before meshes. Raises InputError."""
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
    if suffix in SCENE_SUFFIXES or suffix in MESH_SUFFIXES or suffix == ARCHIVE_SUFFIX:
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
    """The first bytes of a file; None where it cannot be read, or is empty."""
    try:
        if not path.is_file():
            return None
        with path.open("rb") as file:
            return file.read(LONGEST_BEGINNING) or None
    except OSError:
        return None
