"""A .gltf or .glb file as checked JSON plus the GLB's binary chunk."""

import codecs
import struct
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, TypeVar

import msgspec

from ntc.errors import InputError
from ntc.io import read_file
from viewer.locations import scene_roots
from viewer.scene.gltf.extensions import SUPPORTED, WITHOUT_EFFECT
from viewer.scene.gltf.schema import Asset, Document, Extensible
from viewer.scene.json_text import describe, parse_json, printable, schema_problem
from viewer.scene.mesh_files import ConvertedMesh

GLB_MAGIC = b"glTF"
CHUNK_JSON = 0x4E4F534A
CHUNK_BINARY = 0x004E4942
ARRAYS = (
    "nodes",
    "meshes",
    "materials",
    "accessors",
    "bufferViews",
    "buffers",
    "scenes",
    "images",
    "textures",
    "samplers",
    "cameras",
    "animations",
    "skins",
)
"""Top-level arrays of objects that the reader uses."""
MAX_ENTRIES = 1 << 20
"""Most entries of one top-level array."""
MAX_JSON_BYTES = 1 << 28
"""Most bytes of JSON: parsed, a text of numbers takes some twenty times its length in memory."""

MOST_NAMED = 4
"""Most extensions that one message names."""

_Schema = TypeVar("_Schema")


@dataclass(frozen=True, eq=False)
class GltfFile:
    """The JSON of a glTF file with typed, checked access. Every method raises InputError naming file and field."""

    name: str
    """File name as the user gave it, for messages."""
    folder: Path | None
    """Folder that relative URIs start from; None when there is no file, and external URIs cannot be read."""
    json: Mapping[str, Any]
    """The whole document."""
    binary: memoryview | None
    """The GLB's binary chunk: a part of the file's bytes, not a copy."""
    roots: tuple[Path, ...] = ()
    """Resolved folders, besides the scene's, that the scene may read files from."""
    converted: ConvertedMesh | None = None
    """Mesh of another format that the file was converted from; None for glTF."""
    keeps: object = None
    """Object that keeps `folder` on disk while images may still be read from it: an unpacked archive."""
    _checked: dict[tuple[str, int, type], Any] = field(default_factory=dict, init=False)
    """Entries that were checked before, by array, index and schema."""

    def fail(self, where: str, problem: str) -> InputError:
        """Return the error to raise for the field `where`."""
        return InputError(f"{self.name}: {where}: {problem}")

    def check_entries(self, key: str) -> None:
        """Refuse the top-level array `key` unless it is an array of at most MAX_ENTRIES objects."""
        value = self.json.get(key, [])
        if not isinstance(value, list):
            raise self.fail(key, "must be an array")
        if len(value) > MAX_ENTRIES:
            raise self.fail(key, f"has {len(value)} entries; at most {MAX_ENTRIES} are read")
        for index, entry in enumerate(value):
            if not isinstance(entry, dict):
                raise self.fail(f"{key}[{index}]", "must be an object")

    def entries(self, key: str) -> list[dict[str, Any]]:
        """Return a top-level array of objects, e.g. "meshes", checked when the file was parsed; empty when absent."""
        value: list[dict[str, Any]] = self.json.get(key, [])
        return value

    def entry(self, key: str, index: int, schema: type[_Schema]) -> _Schema:
        """Return entry `index` of the top-level array `key`, checked against `schema`."""
        checked: _Schema | None = self._checked.get((key, index, schema))
        if checked is None:
            checked = self.read(self.entries(key)[index], schema, f"{key}[{index}]")
            self._checked[key, index, schema] = checked
        return checked

    def read(self, content: Any, schema: type[_Schema], where: str) -> _Schema:
        """Return the JSON value `content` of the field `where`, checked against `schema`."""
        try:
            return msgspec.convert(content, schema)
        except ValueError as error:
            inner, problem = schema_problem(error, schema)
            place = f"{where}.{inner}".replace(".[", "[").strip(".")
            raise self.fail(place or "file", f"{problem}; export the scene again") from error

    def index(self, value: Any, count: int, where: str) -> int:
        """Return `value` as an index below `count`."""
        if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value < count:
            raise self.fail(where, f"{describe(value)} is not an index below {count}")
        return value

    def label(self, owner: Mapping[str, Any], default: str) -> str:
        """Return the name of `owner` in one printable line of at most 200 characters, `default` without one."""
        value = owner.get("name")
        return (printable(value) if isinstance(value, str) else "") or default

    def extension(self, owner: Extensible, name: str, schema: type[_Schema], where: str) -> _Schema | None:
        """Return the extension `name` of `owner`, which is the field `where`; None when absent."""
        if name not in owner.extensions:
            return None
        return self.read(owner.extensions[name], schema, f"{where}.extensions.{name}".lstrip("."))

    @cached_property
    def document(self) -> Document:
        """The extensions of the whole file."""
        return self.read(self.json, Document, "")


def _parse_json(data: bytes, name: str) -> dict[str, Any]:
    if len(data) > MAX_JSON_BYTES:
        raise InputError(f"{name}: {len(data)} bytes of JSON, at most {MAX_JSON_BYTES} are read; split the scene")
    content = parse_json(data.removeprefix(codecs.BOM_UTF8), name, "export the file again")
    if not isinstance(content, dict):
        raise InputError(f"{name}: not a glTF file (the JSON is no object)")
    return content


def _glb_chunks(data: bytes, name: str) -> tuple[bytes, memoryview | None]:
    if len(data) < 20:
        raise InputError(f"{name}: truncated GLB ({len(data)} bytes); copy or export it again")
    _, version, length = struct.unpack_from("<4sII", data)
    if version != 2:
        raise InputError(f"{name}: GLB version {version}; only glTF 2.0 is read, export it as 2.0")
    if length > len(data):
        raise InputError(f"{name}: truncated GLB ({len(data)} of {length} bytes); copy or export it again")
    offset = 12
    json_chunk: bytes | None = None
    binary: memoryview | None = None
    while offset + 8 <= length:
        size, kind = struct.unpack_from("<II", data, offset)
        offset += 8
        if size > length - offset:
            raise InputError(f"{name}: a GLB chunk of {size} bytes where {length - offset} are left; export it again")
        chunk = memoryview(data)[offset : offset + size]
        if kind == CHUNK_JSON and json_chunk is None:
            json_chunk = bytes(chunk)
        elif kind == CHUNK_BINARY and binary is None:
            binary = chunk
        offset += size
    if json_chunk is None:
        raise InputError(f"{name}: the GLB has no JSON chunk; export it again")
    return json_chunk, binary


def parse_gltf(data: bytes, name: str, folder: Path | None, roots: tuple[Path, ...] = ()) -> GltfFile:
    """Return the glTF container in `data`, GLB or JSON. Raises InputError for anything but a well-formed glTF 2.x file."""
    json_chunk, binary = _glb_chunks(data, name) if data[:4] == GLB_MAGIC else (data, None)
    content = _parse_json(json_chunk, name)
    file = GltfFile(name, folder, content, binary, roots)
    asset = file.read(content.get("asset", {}), Asset, "asset")
    for key, version, is_read in (
        ("version", asset.version, asset.version.startswith("2.")),
        ("minVersion", asset.min_version, asset.min_version == "2.0"),
    ):
        if not is_read:
            problem = f"{describe(version)} is not supported; only glTF 2.0 is read, export it as 2.0"
            raise file.fail(f"asset.{key}", problem)
    for key in ARRAYS:
        file.check_entries(key)
    return file


def read_gltf(path: Path, name: str | None = None) -> GltfFile:
    """Return the glTF container at `path`. Messages call it `name`, or by its path. Raises InputError."""
    name = name or str(path)
    try:
        data = read_file(Path(path))
    except OSError as error:
        raise InputError(f"{name}: cannot be read ({error.strerror}); check the path") from error
    if not data:
        raise InputError(f"{name}: the file is empty (0 bytes); copy or export it again")
    return parse_gltf(data, name, Path(path).parent, scene_roots())


def _names(texts: Iterable[str]) -> set[str]:
    return {printable(text) for text in texts}


def used_extensions(file: GltfFile) -> set[str]:
    """Return the names in "extensionsUsed". Raises InputError."""
    return _names(file.document.extensions_used)


def check_required(file: GltfFile) -> None:
    """Refuse a file that requires an unsupported extension. Raises InputError that names the extension."""
    missing = sorted(_names(file.document.extensions_required) - SUPPORTED - WITHOUT_EFFECT)
    if missing:
        named = ", ".join(missing[:MOST_NAMED]) + (
            f" and {len(missing) - MOST_NAMED} more" * (len(missing) > MOST_NAMED)
        )
        raise file.fail("extensionsRequired", f"{named} is not supported; export the scene without it (uncompressed)")


def ignored_extensions(file: GltfFile) -> tuple[str, ...]:
    """Return the extensions that the file uses and that have no effect here, sorted. Raises InputError."""
    used = used_extensions(file) | _names(file.document.extensions_required)
    return tuple(sorted(used - SUPPORTED))
