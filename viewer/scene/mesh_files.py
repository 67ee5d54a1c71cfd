"""Meshes in other formats than glTF, converted to GLB by trimesh: OBJ with its materials and pictures, PLY, STL and OFF."""

import base64
import io
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ntc.codec.mips import srgb_to_linear
from ntc.errors import InputError
from ntc.io import read_file
from viewer.scene.images import decode_image
from viewer.scene.json_text import printable

LARGEST_FILE = 1 << 30
"""Most bytes of a material library or a picture."""
PLAIN_PICTURES = (".png", ".jpg", ".jpeg")
READ = frozenset({"newmtl", "kd", "ka", "ks", "ns", "map_kd", "illum", "ni"})
"""Statements of an MTL file that are read, or that have no visible effect."""
ARGUMENTS = {"-mm": 2, "-o": 3, "-s": 3, "-t": 3}
"""Most numbers behind an option of a picture; other options have one word."""
OPAQUE = {"d": 1.0, "tr": 0.0}
"""Values of the statements of transparency that mean an opaque material."""


@dataclass(frozen=True)
class ConvertedMesh:
    """Mesh converted to GLB, and lines about the conversion for the load report."""

    glb: bytes
    honoured: tuple[str, ...] = ()
    ignored: tuple[str, ...] = ()
    missing: tuple[str, ...] = ()


class MeshFolder:
    """Resolver of trimesh for files beside a mesh. It never leaves the folder, and records files that are missing."""

    def __init__(self, path: Path) -> None:
        self.file_name = path.name
        self._folder = path.parent.resolve()
        self.missing: dict[str, str] = {}
        """Reason why a file could not be read, by its name."""
        self.ignored: Counter[str] = Counter()
        """Statements of material libraries without effect."""

    def get(self, name: str) -> bytes:
        """Return the content of the file `name`; of a material library only the statements that trimesh reads. Raises OSError."""
        name = name.strip().strip('"').replace("\\", "/")
        try:
            path = (self._folder / name).resolve()
            if not path.is_relative_to(self._folder):
                # Exporters write absolute paths; the file then mostly lies beside the mesh.
                path = (self._folder / name.rsplit("/", 1)[-1]).resolve()
            if not path.is_relative_to(self._folder) or not path.is_file():
                raise FileNotFoundError(2, "no such file beside the scene")
            if path.stat().st_size > LARGEST_FILE:
                raise OSError(27, f"more than {LARGEST_FILE} bytes")
            data = read_file(path)
        except (OSError, ValueError) as error:
            self.missing[name] = getattr(error, "strerror", None) or "not a path"
            raise OSError(2, self.missing[name]) from error
        if path.suffix.lower() == ".mtl":
            return "\n".join(self._statements(as_text(data))).encode()
        return self._picture(data, name)

    def _picture(self, data: bytes, name: str) -> bytes:
        """Return a picture in a format that trimesh reads; it drops others silently. Raises OSError."""
        from PIL import Image

        try:
            pixels = decode_image(data, name)
        except InputError as error:
            self.missing[name] = str(error).removeprefix(f"{name}: ")
            raise OSError(22, self.missing[name]) from error
        if Path(name).suffix.lower() in PLAIN_PICTURES:
            return data
        buffer = io.BytesIO()
        Image.fromarray(pixels).save(buffer, "PNG")
        return buffer.getvalue()

    __getitem__ = get

    def _statements(self, text: str) -> Iterator[str]:
        for line in text.splitlines():
            words = line.split()
            key = words[0].lower() if words else ""
            if key == "map_kd":
                name, options = _picture(line.split(None, 1)[1] if len(words) > 1 else "")
                self.ignored.update(f"MTL map_Kd {option}" for option in options)
                yield f"map_Kd {name}"
                continue
            yield line
            if key and not key.startswith("#") and key not in READ and not _says_opaque(words):
                self.ignored[f"MTL {printable(words[0])}"] += 1


def as_text(data: bytes) -> str:
    """Return `data` decoded as UTF-8, or else as Latin-1, which old exporters write."""
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        return data.decode("latin-1")


def _says_opaque(words: list[str]) -> bool:
    try:
        return float(words[1]) == OPAQUE[words[0].lower()]
    except (KeyError, IndexError, ValueError):
        return False


def _picture(text: str) -> tuple[str, list[str]]:
    """Return (file name, options in front of it) of the arguments of a statement that names a picture."""
    options: list[str] = []
    rest = text.strip()
    while rest.startswith("-"):
        option, _, rest = rest.partition(" ")
        numbers = ARGUMENTS.get(option.lower())
        if numbers is None:
            rest = rest.strip().partition(" ")[2]
        for _ in range(numbers or 0):
            first, _, after = rest.strip().partition(" ")
            if not _is_number(first):
                break
            rest = after
        rest = rest.strip()
        options.append(printable(option))
    return rest, options


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


def _as_surfaces(geometry: Mapping[str, Any], tree: dict[str, Any]) -> None:
    """Adapt the materials and vertex colours of the glTF document `tree` that trimesh made of `geometry`.

    These formats have no metalness, which is 1 in glTF by default, and all their surfaces are double-sided. Their vertex colours are
    sRGB and those of glTF linear, so they are converted, to 16 bits, because 8 would merge dark colours.
    """
    materials = tree.setdefault("materials", [])
    for mesh in tree["meshes"]:
        visual = geometry[mesh["name"]].visual if mesh.get("name") in geometry else None
        for primitive in mesh["primitives"]:
            color = primitive["attributes"].get("COLOR_0")
            if color is not None and visual is not None and visual.kind == "vertex":
                _recolour(tree, tree["accessors"][color], np.asarray(visual.vertex_colors))
            if "material" not in primitive:
                primitive["material"] = len(materials)
                materials.append({})
    for material in materials:
        material.setdefault("pbrMetallicRoughness", {}).setdefault("metallicFactor", 0.0)
        material["doubleSided"] = True


def _recolour(tree: dict[str, Any], accessor: dict[str, Any], colors: NDArray[np.uint8]) -> None:
    """Store `colors` [V, 4] sRGB in `accessor` as linear colours of 16 bits."""
    if len(colors) != accessor["count"]:
        return
    shares = colors / 255.0
    shares[:, :3] = srgb_to_linear(shares[:, :3])
    data = np.round(shares * 65535.0).astype("<u2").tobytes()
    uri = "data:application/octet-stream;base64," + base64.b64encode(data).decode()
    tree["buffers"].append({"uri": uri, "byteLength": len(data)})
    tree["bufferViews"].append({"buffer": len(tree["buffers"]) - 1, "byteLength": len(data)})
    place = {"bufferView": len(tree["bufferViews"]) - 1, "byteOffset": 0}
    accessor |= {**place, "componentType": 5123, "type": "VEC4", "normalized": True}
    # The bounds belong to the former 8-bit values.
    for key in ("min", "max"):
        accessor.pop(key, None)


def convert_mesh(path: Path) -> ConvertedMesh:
    """Return the OBJ, PLY, STL or OFF file at `path` as GLB. Raises InputError where it cannot be read or holds no triangles."""
    import trimesh

    kind = path.suffix[1:].lower()
    folder = MeshFolder(path)
    try:
        data = read_file(path)
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error}); check the path") from error
    if kind == "obj":
        data = as_text(data).encode()
    try:
        resolver: Any = folder
        scene: Any = trimesh.load_scene(io.BytesIO(data), file_type=kind, resolver=resolver, process=False)
        meshes = [mesh for mesh in scene.geometry.values() if isinstance(mesh, trimesh.Trimesh)]
        drawn = any(len(mesh.faces) for mesh in meshes)
        glb = scene.export(file_type="glb", tree_postprocessor=partial(_as_surfaces, scene.geometry)) if drawn else None
    except MemoryError:
        raise
    except Exception as error:  # trimesh's readers let any exception through on broken files.
        # trimesh guesses text encodings with a package that is not installed.
        reason = "its text is no UTF-8" if isinstance(error, ImportError) else printable(str(error))
        raise InputError(f"{path}: not a readable {kind.upper()} file ({reason}); convert it to glTF") from error
    if not isinstance(glb, bytes):
        raise InputError(f"{path}: holds no triangles to draw; open a file with meshes")
    further = data.count(b"\nmtllib ") + data.startswith(b"mtllib ") - 1 if kind == "obj" else 0
    ignored = folder.ignored + Counter({"OBJ mtllib: further material libraries": max(0, further)})
    return ConvertedMesh(
        glb,
        (f"{kind.upper()}, converted by trimesh",),
        tuple(f"{what} ({count})" if count > 1 else what for what, count in ignored.items()),
        tuple(f"{printable(name)}: {why} [factors are used]" for name, why in folder.missing.items()),
    )
