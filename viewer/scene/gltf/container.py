"""A .gltf or .glb file as checked JSON plus the GLB's binary chunk."""

import codecs
import struct
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ntc.errors import InputError
from ntc.io import read_file
from viewer.locations import scene_roots
from viewer.scene.json_text import describe, parse_json, printable
from viewer.scene.mesh_files import ConvertedMesh

GLB_MAGIC = b"glTF"
CHUNK_JSON = 0x4E4F534A
CHUNK_BINARY = 0x004E4942
MAX_ENTRIES = 1 << 20
"""Most entries of one top-level array."""
MAX_JSON_BYTES = 1 << 28
"""A JSON text of numbers takes some twenty times its length in memory."""

SUPPORTED = frozenset(
    {
        "EXT_mesh_gpu_instancing",
        "EXT_meshopt_compression",
        "EXT_texture_astc",
        "EXT_texture_avif",
        "EXT_texture_webp",
        "KHR_draco_mesh_compression",
        "KHR_lights_punctual",
        "KHR_materials_clearcoat",
        "KHR_materials_emissive_strength",
        "KHR_materials_ior",
        "KHR_materials_pbrSpecularGlossiness",
        "KHR_materials_specular",
        "KHR_materials_transmission",
        "KHR_materials_unlit",
        "KHR_materials_variants",
        "KHR_mesh_quantization",
        "KHR_meshopt_compression",
        "KHR_node_visibility",
        "KHR_texture_basisu",
        "KHR_texture_transform",
        "MSFT_texture_dds",
        "NV_texture_swizzle",
    }
)
"""Honoured: a file may require them."""

WITHOUT_EFFECT = frozenset(
    {
        "EXT_instance_features",
        "EXT_lights_ies",
        "EXT_lights_image_based",
        "EXT_mesh_features",
        "EXT_mesh_manifold",
        "EXT_structural_metadata",
        "GODOT_single_root",
        "KHR_animation_pointer",
        "KHR_audio_emitter",
        "KHR_interactivity",
        "KHR_materials_anisotropy",
        "KHR_materials_diffuse_transmission",
        "KHR_materials_dispersion",
        "KHR_materials_iridescence",
        "KHR_materials_sheen",
        "KHR_materials_volume",
        "KHR_materials_volume_scatter",
        "KHR_node_hoverability",
        "KHR_node_selectability",
        "KHR_xmp",
        "KHR_xmp_json_ld",
        "MSFT_lod",
        "VRMC_springBone",
        "VRMC_vrm",
    }
)
"""Finer effects of light, other shapes of lights, behaviour, and metadata: a file may require them and still be drawn without."""

MOST_NAMED = 4
"""Extensions that one message names."""


@dataclass(frozen=True, eq=False)
class GltfFile:
    """The JSON of a glTF file with typed, checked access. Every method raises InputError naming file and field."""

    name: str
    """File name as the user gave it, for messages."""
    folder: Path | None
    """Folder where relative URIs start; None when there is no file, and external URIs are missing."""
    json: Mapping[str, Any]
    """The whole document."""
    binary: memoryview | None
    """The GLB's binary chunk: a part of the file's bytes, not a copy."""
    roots: tuple[Path, ...] = ()
    """Folders, resolved, from which the scene may read files beside its own."""
    converted: ConvertedMesh | None = None
    """Format that the file was converted from, where that was not glTF."""
    keeps: object = None
    """Object that keeps `folder` on disk while images may still be read from it: an unpacked archive."""

    def fail(self, where: str, problem: str) -> InputError:
        """Return the error to raise for the field `where`."""
        return InputError(f"{self.name}: {where}: {problem}")

    def array(self, owner: Mapping[str, Any], key: str, where: str) -> list[Any]:
        """Return the list `owner[key]`, empty when absent."""
        value = owner.get(key, [])
        if not isinstance(value, list):
            raise self.fail(f"{where}.{key}", "must be an array")
        return value

    def check_entries(self, key: str) -> None:
        """Refuse the top-level array `key` unless it is an array of objects, of a number that is read."""
        value = self.array(self.json, key, "file")
        if len(value) > MAX_ENTRIES:
            raise self.fail(key, f"has {len(value)} entries; at most {MAX_ENTRIES} are read")
        for index, entry in enumerate(value):
            if not isinstance(entry, dict):
                raise self.fail(f"{key}[{index}]", "must be an object")

    def entries(self, key: str) -> list[dict[str, Any]]:
        """Return a top-level array of objects, e.g. "meshes", checked when the file was parsed; empty when absent."""
        value: list[dict[str, Any]] = self.json.get(key, [])
        return value

    def entry(self, key: str, index: Any, where: str) -> dict[str, Any]:
        """Entry `index` of the top-level array `key`, named by the field `where`."""
        entries = self.entries(key)
        return entries[self.index(index, len(entries), where)]

    def index(self, value: Any, count: int, where: str) -> int:
        """Return `value` as an index below `count`."""
        if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value < count:
            raise self.fail(where, f"{describe(value)} is not an index below {count}")
        return value

    def integer(
        self, owner: Mapping[str, Any], key: str, where: str, default: int | None = None, *, high: int = 2**53
    ) -> int:
        """Return the integer `owner[key]`, from 0 to `high`; without a default it is required."""
        value = owner.get(key, default)
        if isinstance(value, float) and value.is_integer():
            value = int(value)
        if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value <= high:
            raise self.fail(f"{where}.{key}", f"{describe(value)} is not an integer from 0 to {high}")
        return value

    def number(self, owner: Mapping[str, Any], key: str, where: str, default: float) -> float:
        """Return the finite number `owner[key]`."""
        return self.finite(owner.get(key, default), f"{where}.{key}")

    def numbers(self, owner: Mapping[str, Any], key: str, where: str, default: tuple[float, ...]) -> tuple[float, ...]:
        """Return the list `owner[key]` of as many finite numbers as `default` has."""
        value = owner.get(key, default)
        if not isinstance(value, list | tuple) or len(value) != len(default):
            raise self.fail(f"{where}.{key}", f"must be {len(default)} numbers")
        return tuple(self.finite(component, f"{where}.{key}") for component in value)

    def finite(self, value: Any, where: str) -> float:
        """Return `value` as a finite number."""
        if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) < 1e38:
            raise self.fail(where, f"{describe(value)} is not a finite number")
        return float(value)

    def text(self, owner: Mapping[str, Any], key: str, where: str, default: str = "") -> str:
        """Return the string `owner[key]`."""
        value = owner.get(key, default)
        if not isinstance(value, str):
            raise self.fail(f"{where}.{key}", f"{describe(value)} is not a text")
        # JSON may hold half a surrogate pair, which neither a file name nor a terminal takes.
        return value.encode("utf-8", "replace").decode()

    def label(self, owner: Mapping[str, Any], default: str) -> str:
        """Return the name of `owner` in one printable line of at most 200 characters, `default` without one."""
        value = owner.get("name")
        if not isinstance(value, str):
            return default
        return printable(value) or default

    def object(self, owner: Mapping[str, Any], key: str, where: str) -> dict[str, Any]:
        """Return the object `owner[key]`, empty when absent."""
        value = owner.get(key, {})
        if not isinstance(value, dict):
            raise self.fail(f"{where}.{key}", "must be an object")
        return value

    def extension(self, owner: Mapping[str, Any], name: str, where: str) -> dict[str, Any] | None:
        """Return the extension object `name` of `owner`, None when absent."""
        extensions = self.object(owner, "extensions", where)
        if name not in extensions:
            return None
        return self.object(extensions, name, f"{where}.extensions")


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
    """Read the container of `data`, GLB or JSON. Raises InputError for anything but a well-formed glTF 2.x file."""
    json_chunk, binary = _glb_chunks(data, name) if data[:4] == GLB_MAGIC else (data, None)
    content = _parse_json(json_chunk, name)
    file = GltfFile(name, folder, content, binary, roots)
    asset = file.object(content, "asset", "file")
    version = file.text(asset, "version", "asset")
    if not version.startswith("2."):
        raise file.fail(
            "asset.version", f"{describe(version)} is not supported; only glTF 2.0 is read, export it as 2.0"
        )
    if file.text(asset, "minVersion", "asset", "2.0") != "2.0":
        raise file.fail("asset.minVersion", f"{describe(asset['minVersion'])} is not supported; only glTF 2.0 is read")
    for key in ("nodes", "meshes", "materials", "accessors", "bufferViews", "buffers"):
        file.check_entries(key)
    for key in ("scenes", "images", "textures", "samplers", "cameras"):
        file.check_entries(key)
    return file


def read_gltf(path: Path, name: str | None = None) -> GltfFile:
    """Return the glTF container at `path`, called `name` in messages, by its path unless given. Raises InputError."""
    name = name or str(path)
    try:
        data = read_file(Path(path))
    except OSError as error:
        raise InputError(f"{name}: cannot be read ({error.strerror}); check the path") from error
    if not data:
        raise InputError(f"{name}: the file is empty (0 bytes); copy or export it again")
    return parse_gltf(data, name, Path(path).parent, scene_roots())


def names_of(file: GltfFile, key: str) -> tuple[str, ...]:
    """Return the distinct names in "extensionsUsed" or "extensionsRequired", sorted. Raises InputError."""
    names = file.array(file.json, key, "file")
    for name in names:
        if not isinstance(name, str):
            raise file.fail(key, "must hold names")
    return tuple(sorted({printable(name) for name in names}))


def check_required(file: GltfFile) -> None:
    """Refuse a file that requires an extension which is not read. Raises InputError naming the extension."""
    missing = [n for n in names_of(file, "extensionsRequired") if n not in SUPPORTED and n not in WITHOUT_EFFECT]
    if missing:
        named = ", ".join(missing[:MOST_NAMED]) + (
            f" and {len(missing) - MOST_NAMED} more" * (len(missing) > MOST_NAMED)
        )
        raise file.fail("extensionsRequired", f"{named} is not supported; export the scene without it (uncompressed)")


def ignored_extensions(file: GltfFile) -> tuple[str, ...]:
    """Extensions in use that have no effect here, sorted. Raises InputError."""
    used = {*names_of(file, "extensionsUsed"), *names_of(file, "extensionsRequired")}
    return tuple(sorted(used - SUPPORTED))
