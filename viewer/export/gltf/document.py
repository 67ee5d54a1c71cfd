"""Document of a glTF file that is changed and written again. Everything that an export does not change passes through."""

import copy
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import PurePosixPath
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ntc.errors import InputError
from viewer.scene.gltf.buffers import Buffers, read_uri
from viewer.scene.gltf.container import GltfFile
from viewer.scene.gltf.meshopt import EXTENSIONS as MESHOPT_EXTENSIONS
from viewer.scene.gltf.packed_textures import PACK_MIME_TYPE, SWIZZLE
from viewer.scene.images import image_suffix

ALIGNMENT = 4
"""Alignment in bytes of accessors of 32-bit values (glTF 2.0, Sec. 3.6.2.4)."""


@dataclass(frozen=True, eq=False)
class ImageFile:
    """Image as a file."""

    name: str
    """File name."""
    mime_type: str
    """MIME type; "" where glTF has none for the format."""
    read: Callable[[], bytes]
    """Function that returns the bytes. It is called when they are written. Raises InputError."""


@dataclass(eq=False)
class GltfDocument:
    """A glTF file with its buffers and images."""

    name: str
    """Name of the source file in messages."""
    json: dict[str, Any]
    """Copy of the whole JSON document."""
    buffers: list[NDArray[np.uint8] | None]
    """Bytes [N] of each buffer; None where it has none, such as the fallback buffers of compressed views."""
    images: dict[int, ImageFile]
    """Files to write, by image entry. Images in buffer views are not among them."""
    missing: list[str]
    """Messages about images that could not be read. Their entries stay as they are."""

    def entries(self, key: str) -> list[dict[str, Any]]:
        """Return the top-level array `key`; it is added where the document has none."""
        array: list[dict[str, Any]] = self.json.setdefault(key, [])
        return array

    def use_extension(self, name: str, required: bool = False) -> None:
        """Add an extension to those in use and, where `required`, to those that a reader must support."""
        for key in ("extensionsUsed", "extensionsRequired") if required else ("extensionsUsed",):
            names = self.json.setdefault(key, [])
            if name not in names:
                names.append(name)

    def replace_image(self, index: int, file: ImageFile | None) -> None:
        """Make `file` the content of image entry `index`, or no content where it is None. The bytes of the old image are removed."""
        entry = self.entries("images")[index]
        view = entry.pop("bufferView", None)
        for key in ("uri", "mimeType"):
            entry.pop(key, None)
        self.images.pop(index, None)
        if isinstance(view, int) and not any(image.get("bufferView") == view for image in self.entries("images")):
            self._release(view)
        if file is not None:
            self.images[index] = file

    def remove_images(self, removed: set[int]) -> None:
        """Remove image entries and their bytes, and the references of textures to them."""
        for index in removed:
            self.replace_image(index, None)
        remaining = [index for index in range(len(self.entries("images"))) if index not in removed]
        places = {index: place for place, index in enumerate(remaining)}
        self.json["images"] = [self.entries("images")[index] for index in remaining]
        self.images = {places[index]: file for index, file in self.images.items()}
        for texture in self.entries("textures"):
            extensions = texture.get("extensions", {})
            for owner in (texture, *extensions.values(), *extensions.get(SWIZZLE, {}).get("options", [])):
                source = owner.get("source")
                if source in removed:
                    del owner["source"]
                elif isinstance(source, int):
                    owner["source"] = places[source]
            for name in [name for name, extension in extensions.items() if extension == {}]:
                del extensions[name]

    def _release(self, view: int) -> None:
        """Remove the bytes of a buffer view from its buffer. The entry stays, because views are named by their index."""
        entry = self.entries("bufferViews")[view]
        number, data = entry["buffer"], self.buffers[entry["buffer"]]
        if data is None:
            return
        entry["byteLength"], entry["byteOffset"] = min(1, len(data)), 0
        ranges = [owner for owner in self._ranges() if owner["buffer"] == number]
        self.buffers[number] = _compacted(data, ranges)

    def _ranges(self) -> Iterable[dict[str, Any]]:
        """Yield the JSON objects that name a range of a buffer: views, and their compressed sources."""
        for view in self.entries("bufferViews"):
            yield view
            extensions = view.get("extensions", {})
            yield from (extensions[name] for name in MESHOPT_EXTENSIONS if name in extensions)

    def merge_buffers(self) -> NDArray[np.uint8]:
        """Merge the bytes of all buffers into the first one, as a GLB needs, and return it; buffers without bytes follow."""
        starts: dict[int, int] = {}
        parts: list[NDArray[np.uint8]] = []
        length = 0
        for number, data in enumerate(self.buffers):
            if data is not None:
                starts[number] = length
                padded = np.pad(data, (0, -len(data) % ALIGNMENT))
                parts.append(padded)
                length += len(padded)
        without = [number for number, data in enumerate(self.buffers) if data is None]
        places = {number: 1 + place for place, number in enumerate(without)}
        for owner in self._ranges():
            number = owner["buffer"]
            if number in starts:
                owner["byteOffset"] = owner.get("byteOffset", 0) + starts[number]
            owner["buffer"] = places.get(number, 0)
        old = self.entries("buffers")
        merged = np.concatenate(parts) if parts else np.zeros(0, np.uint8)
        self.json["buffers"] = [{"byteLength": len(merged)}, *(old[number] for number in without)]
        self.buffers = [merged, *(None for _ in without)]
        return merged


def _compacted(data: NDArray[np.uint8], owners: list[dict[str, Any]]) -> NDArray[np.uint8]:
    """Return the bytes of `data` that `owners` name, each byte once; the offsets of `owners` are changed to match."""
    owners = sorted(owners, key=lambda owner: owner.get("byteOffset", 0))
    parts: list[NDArray[np.uint8]] = []
    length, end, moved = 0, -1, 0
    for owner in owners:
        first = owner.get("byteOffset", 0)
        last = first + owner["byteLength"]
        if first > end:
            begin = first - first % ALIGNMENT
            gap = -length % ALIGNMENT
            parts.append(np.zeros(gap, np.uint8))
            length += gap
            moved, end = length - begin, begin
        if last > end:
            parts.append(data[end:last])
            length += last - end
            end = last
        owner["byteOffset"] = first + moved
    return np.concatenate(parts) if parts else data[:0]


def read_document(file: GltfFile, buffers: Buffers) -> GltfDocument:
    """Return the document of `file` with its buffers and images.

    Images that cannot be read are listed in `missing`. Raises InputError for other unreadable content.
    """
    contents: list[NDArray[np.uint8] | None] = []
    for number, entry in enumerate(file.entries("buffers")):
        has_data = "uri" in entry or (number == 0 and file.binary is not None)
        contents.append(buffers.buffer(number) if has_data else None)
    document = GltfDocument(file.name, copy.deepcopy(dict(file.json)), contents, {}, [])
    for index, entry in enumerate(file.entries("images")):
        if "uri" not in entry or entry.get("mimeType") == PACK_MIME_TYPE:
            continue
        uri = entry["uri"]
        if not isinstance(uri, str):
            raise file.fail(f"images[{index}].uri", "must be a text")
        try:
            data = read_uri(file, uri, f"images[{index}].uri")
        except InputError as error:
            document.missing.append(str(error))
            continue
        document.images[index] = _image_file(file, index, uri, data)
    return document


def _image_file(file: GltfFile, index: int, uri: str, data: bytes) -> ImageFile:
    suffix = image_suffix(data, uri)
    file_name = PurePosixPath(uri).name if uri[:5].lower() != "data:" else ""
    label = file.label(file.entries("images")[index], file_name or f"image {index}")
    mime_type = {".png": "image/png", ".jpg": "image/jpeg", ".webp": "image/webp", ".ktx2": "image/ktx2"}.get(
        suffix, ""
    )

    def read() -> bytes:
        return read_uri(file, uri, f"images[{index}].uri")

    return ImageFile(file_name or f"{label}{suffix}", mime_type, read)
