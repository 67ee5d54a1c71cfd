"""The content of a glTF file, to be changed and written again: what is not ours passes through as it is."""

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
"""Bytes: accessors of 32-bit values begin at multiples of it (glTF 2.0, Sec. 3.6.2.4)."""


@dataclass(frozen=True, eq=False)
class ImageFile:
    """An image as a file holds it."""

    name: str
    """File name."""
    mime_type: str
    """"" where glTF has none for it."""
    read: Callable[[], bytes]
    """Reader of the bytes, called when they are written. Raises InputError."""


@dataclass(eq=False)
class GltfDocument:
    """A glTF file with its buffers and images."""

    name: str
    """Name of the file it was read from, for messages."""
    json: dict[str, Any]
    """A copy of the whole document."""
    buffers: list[NDArray[np.uint8] | None]
    """Bytes [N] of each buffer; None where it has none: what decompressed views are said to lie in."""
    images: dict[int, ImageFile]
    """Files to write, by image entry. Images in buffer views are no files."""
    missing: list[str]
    """Images that could not be read: their entries stay as they are."""

    def entries(self, key: str) -> list[dict[str, Any]]:
        """Return a top-level array, made where there is none."""
        found: list[dict[str, Any]] = self.json.setdefault(key, [])
        return found

    def use_extension(self, name: str, required: bool = False) -> None:
        """Name an extension among those in use, and where `required` among those that a reader must know."""
        for key in ("extensionsUsed", "extensionsRequired") if required else ("extensionsUsed",):
            names = self.json.setdefault(key, [])
            if name not in names:
                names.append(name)

    def replace_image(self, index: int, file: ImageFile | None) -> None:
        """Let image entry `index` be `file`, or nothing at all, and let go of the bytes that it had."""
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
        """Take image entries out, with their bytes; textures that named them name no image any more."""
        for index in removed:
            self.replace_image(index, None)
        kept = [index for index in range(len(self.entries("images"))) if index not in removed]
        places = {index: place for place, index in enumerate(kept)}
        self.json["images"] = [self.entries("images")[index] for index in kept]
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
        """Take the bytes of a buffer view out of its buffer; its entry stays, as others are named by their place."""
        entry = self.entries("bufferViews")[view]
        number, data = entry["buffer"], self.buffers[entry["buffer"]]
        if data is None:
            return
        entry["byteLength"], entry["byteOffset"] = min(1, len(data)), 0
        ranges = [owner for owner in self._ranges() if owner["buffer"] == number]
        self.buffers[number] = _compacted(data, ranges)

    def _ranges(self) -> Iterable[dict[str, Any]]:
        """Yield what names a range of a buffer: views, and what they are decompressed from."""
        for view in self.entries("bufferViews"):
            yield view
            extensions = view.get("extensions", {})
            yield from (extensions[name] for name in MESHOPT_EXTENSIONS if name in extensions)

    def merge_buffers(self) -> NDArray[np.uint8]:
        """Put the bytes of all buffers into the first one, which it returns, as a GLB has it; those without bytes come behind it."""
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
    """Return what `owners` name of `data`, each byte once; their offsets become those in the result."""
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
    """Return all that `file` holds and names. Images that cannot be read stay out, and are told. Raises InputError for others."""
    found: list[NDArray[np.uint8] | None] = []
    for number, entry in enumerate(file.entries("buffers")):
        has_data = "uri" in entry or (number == 0 and file.binary is not None)
        found.append(buffers.buffer(number) if has_data else None)
    document = GltfDocument(file.name, copy.deepcopy(dict(file.json)), found, {}, [])
    for index, entry in enumerate(file.entries("images")):
        if "uri" not in entry or entry.get("mimeType") == PACK_MIME_TYPE:
            continue
        uri = file.text(entry, "uri", f"images[{index}]")
        try:
            data = read_uri(file, uri, f"images[{index}].uri")
        except InputError as error:
            document.missing.append(str(error))
            continue
        document.images[index] = _image_file(file, index, uri, data)
    return document


def _image_file(file: GltfFile, index: int, uri: str, data: bytes) -> ImageFile:
    suffix = image_suffix(data, uri)
    own = PurePosixPath(uri).name if uri[:5].lower() != "data:" else ""
    label = file.label(file.entries("images")[index], own or f"image {index}")
    mime_type = {".png": "image/png", ".jpg": "image/jpeg", ".webp": "image/webp", ".ktx2": "image/ktx2"}.get(
        suffix, ""
    )

    def read() -> bytes:
        return read_uri(file, uri, f"images[{index}].uri")

    return ImageFile(own or f"{label}{suffix}", mime_type, read)
