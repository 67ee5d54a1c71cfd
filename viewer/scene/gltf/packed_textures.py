"""Textures of a glTF file that name a texture of a pack, by the extension NV_texture_swizzle (a draft: glTF pull request 2511).

    "textures": [{"source": 0, "extensions": {"NV_texture_swizzle": {"options": [
        {"source": 1, "arrayLayer": 3, "channels": [0, 1, 2, -1], "extras": {"pixelHash": "..."}}]}}}],
    "images": [{"uri": "original.png"}, {"uri": "scene.clustered.ntc", "mimeType": "image/vnd.ntc-viewer.pack"}]

`arrayLayer` is the index of the texture in the pack. `channels` are its channels to read as red, green, blue and alpha (-1: none).
`pixelHash` is a property of this program: it identifies the texture, so the pack may be encoded again in another order.
"""

from dataclasses import dataclass, replace
from pathlib import Path

from msgspec import UnsetType

from ntc.errors import InputError
from viewer.scene.gltf import schema
from viewer.scene.gltf.buffers import is_data_uri, resolve_uri
from viewer.scene.gltf.container import GltfFile
from viewer.scene.json_text import describe
from viewer.scene.report import ReportNotes

SWIZZLE = "NV_texture_swizzle"
PACK_MIME_TYPE = "image/vnd.ntc-viewer.pack"
"""MIME type of packs in glTF files; it is not registered."""
NVIDIA_MIME_TYPES = ("image/vnd-nvidia.ntc", "image/vnd.nvidia.ntc")
PIXEL_HASH = "pixelHash"
MOST_OPTIONS = 64
"""Most alternative options of one texture that are examined."""
NO_CHANNEL = -1
_MARK = "ntcViewerPackedTexture"
"""Key of image entries in memory that mean a texture of a pack; no file has it."""


@dataclass(frozen=True)
class PackOption:
    """Texture of a pack that replaces a texture of the file."""

    image: int
    """Index of the image entry that names the pack."""
    layer: int
    """Index of the texture in the pack."""
    channels: tuple[int, int, int, int]
    """Channels of the texture to read as red, green, blue and alpha, NO_CHANNEL for none."""
    pixel_hash: str
    """Identity of the texture in the pack; "" where the file does not state it."""


def pack_option(file: GltfFile, number: int, notes: ReportNotes) -> PackOption | None:
    """Return the first option of texture `number` that names a `.ntc` pack; other options are reported. Raises InputError."""
    where = f"textures[{number}]"
    extension = file.extension(file.entry("textures", number, schema.Texture), SWIZZLE, schema.Swizzle, where)
    for place, content in enumerate(() if extension is None else extension.options[:MOST_OPTIONS]):
        name = f"{where}.extensions.{SWIZZLE}.options[{place}]"
        images = file.entries("images")
        index = file.index(content.get("source"), len(images), f"{name}.source")
        mime_type = images[index].get("mimeType")
        if mime_type != PACK_MIME_TYPE:
            kind = "NVIDIA's NTC" if mime_type in NVIDIA_MIME_TYPES else describe(mime_type)
            notes.ignored(f"{SWIZZLE}: options in images of type {kind}: texture references")
            continue
        notes.honoured(f"{SWIZZLE}: texture references")
        option = file.read(content, schema.SwizzleOption, name)
        pixel_hash = option.extras.get(PIXEL_HASH) if isinstance(option.extras, dict) else None
        known_hash = pixel_hash[:200] if isinstance(pixel_hash, str) else ""
        return PackOption(index, int(option.array_layer), option.channels, known_hash)
    return None


def pack_path(file: GltfFile, image: int) -> Path:
    """Return the path of the pack that the image entry `image` names. Raises InputError for a pack inside the glTF file."""
    uri, where = file.entry("images", image, schema.Image).uri, f"images[{image}]"
    if isinstance(uri, UnsetType) or not uri or is_data_uri(uri):
        raise file.fail(where, "packs are read from files beside the scene, not from inside it; write its uri")
    path = resolve_uri(file, uri, f"{where}.uri")
    if path is None:
        raise file.fail(where, f"{uri[:60]!r}: external file of a scene that is not a file itself")
    return path


def pack_paths(file: GltfFile, notes: ReportNotes) -> tuple[Path, ...]:
    """Return the existing packs that the file's images name, each once. Missing packs are reported."""
    existing: dict[Path, None] = {}
    for index, entry in enumerate(file.entries("images")):
        if entry.get("mimeType") != PACK_MIME_TYPE:
            continue
        try:
            path = pack_path(file, index)
            if not path.is_file():
                raise file.fail(f"images[{index}].uri", f"{path.name}: is not there; put the pack beside the scene")
        except InputError as error:
            notes.missing(str(error).removeprefix(f"{file.name}: "))
            continue
        existing[path] = None
    return tuple(existing)


def with_packed_images(file: GltfFile) -> GltfFile:
    """Return `file` with an image entry added for each texture whose only image is in a pack. Raises InputError."""
    textures, images = list(file.entries("textures")), list(file.entries("images"))
    quiet = ReportNotes()
    for number, texture in enumerate(textures):
        others = set(texture.get("extensions", {})) - {SWIZZLE} if isinstance(texture.get("extensions"), dict) else ()
        option = pack_option(file, number, quiet) if "source" not in texture else None
        if option is None or others:
            continue
        label = file.label(texture, f"texture {number}")
        images.append({"name": label, _MARK: option})
        textures[number] = {**texture, "source": len(images) - 1}
    if len(images) == len(file.entries("images")):
        return file
    return replace(file, json={**file.json, "textures": textures, "images": images})


def packed_image(file: GltfFile, index: int) -> PackOption | None:
    """Return the texture of a pack behind image `index`, if `with_packed_images` added it; None for images of the file."""
    option = file.entries("images")[index].get(_MARK)
    return option if isinstance(option, PackOption) else None
