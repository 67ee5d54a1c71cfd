"""Conversion of glTF for three.js without decoders: compressed geometry, images and materials become plain ones."""

from dataclasses import dataclass, field
from functools import partial
from io import BytesIO
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from ntc.errors import InputError
from viewer.export.gltf.document import ALIGNMENT, GltfDocument, ImageFile
from viewer.export.gltf.export import OpenedExport
from viewer.scene.gltf.buffers import COMPONENT_TYPES
from viewer.scene.gltf.draco import EXTENSION as DRACO
from viewer.scene.gltf.draco import DracoMesh, decode_draco
from viewer.scene.gltf.maps.images import image_bytes
from viewer.scene.gltf.materials import GLOSSINESS
from viewer.scene.gltf.meshopt import EXTENSIONS as MESHOPT_EXTENSIONS
from viewer.scene.gltf.textures import IMAGE_EXTENSIONS, texture_image
from viewer.scene.images import decode_image, image_suffix
from viewer.scene.model import Material
from viewer.scene.report import ReportNotes

BROWSER_IMAGES = {".png": "image/png", ".jpg": "image/jpeg", ".webp": "image/webp"}
"""MIME types of images that browsers read, by suffix."""


@dataclass(eq=False)
class _NewBuffer:
    """Buffer for decompressed data, the last one of the document."""

    number: int
    parts: list[NDArray[np.uint8]] = field(default_factory=list)
    size: int = 0

    def add(self, data: NDArray[Any]) -> dict[str, int]:
        """Add `data` and return its buffer view."""
        content = np.ascontiguousarray(data).reshape(-1).view(np.uint8)
        view = {"buffer": self.number, "byteOffset": self.size, "byteLength": len(content)}
        self.parts.append(np.pad(content, (0, -len(content) % ALIGNMENT)))
        self.size += len(self.parts[-1])
        return view


def make_plain(opened: OpenedExport) -> None:
    """Change the document of `opened` so that no extension needs a decoder and all images are files. Raises InputError."""
    document = opened.document
    buffer = _NewBuffer(len(document.entries("buffers")))
    _expand_views(opened, buffer)
    _expand_draco(opened, buffer)
    if buffer.parts:
        document.entries("buffers").append({"byteLength": buffer.size})
        document.buffers.append(np.concatenate(buffer.parts))
    for entry, material in zip(document.entries("materials"), opened.scene.materials, strict=False):
        _plain_material(entry, material)
    _plain_images(opened)
    gone = {DRACO, GLOSSINESS, *MESHOPT_EXTENSIONS, *IMAGE_EXTENSIONS}
    for key in ("extensionsUsed", "extensionsRequired"):
        document.json[key] = [name for name in document.json.get(key, []) if name not in gone]


def _expand_views(opened: OpenedExport, buffer: _NewBuffer) -> None:
    for number, view in enumerate(opened.document.entries("bufferViews")):
        if any(view.get("extensions", {}).pop(name, None) is not None for name in MESHOPT_EXTENSIONS):
            data, _ = opened.buffers.view(number, f"bufferViews[{number}]")
            view.update(buffer.add(data))
    for entry in opened.document.entries("buffers"):
        # These extensions mark fallback buffers of compressed views.
        entry.pop("extensions", None)


def _expand_draco(opened: OpenedExport, buffer: _NewBuffer) -> None:
    document = opened.document
    for number, mesh in enumerate(document.entries("meshes")):
        for place, primitive in enumerate(mesh["primitives"]):
            extension = primitive.get("extensions", {}).pop(DRACO, None)
            if extension is None:
                continue
            decoded = decode_draco(opened.file, opened.buffers, extension, f"meshes[{number}].primitives[{place}]")
            _write_draco(document, primitive, decoded, buffer)


def _write_draco(document: GltfDocument, primitive: dict[str, Any], mesh: DracoMesh, buffer: _NewBuffer) -> None:
    values: dict[str, NDArray[Any]] = {**mesh.attributes, "indices": mesh.indices}
    for name, data in values.items():
        index = primitive.get("indices") if name == "indices" else primitive["attributes"].get(name)
        if index is None:
            continue
        accessor = document.entries("accessors")[index]
        kind = COMPONENT_TYPES[accessor["componentType"]]
        rows = data.astype(kind).reshape(len(data), -1).view(np.uint8)
        # glTF aligns the rows of vertices to four bytes.
        aligned = rows if name == "indices" else np.pad(rows, ((0, 0), (0, -rows.shape[1] % ALIGNMENT)))
        stride = {} if name == "indices" else {"byteStride": aligned.shape[1]}
        accessor.update(bufferView=len(document.entries("bufferViews")), byteOffset=0, count=len(data))
        document.entries("bufferViews").append({**buffer.add(aligned), **stride})


def _plain_material(entry: dict[str, Any], material: Material) -> None:
    """Replace specular and glossiness by the viewer's roughness and metalness."""
    glossiness = entry.get("extensions", {}).pop(GLOSSINESS, None)
    if glossiness is None:
        return
    entry["pbrMetallicRoughness"] = {
        "baseColorFactor": [min(max(value, 0.0), 1.0) for value in material.factor],
        "metallicFactor": material.factors.metalness,
        "roughnessFactor": material.factors.roughness,
        **({"baseColorTexture": glossiness["diffuseTexture"]} if "diffuseTexture" in glossiness else {}),
    }


def _plain_images(opened: OpenedExport) -> None:
    """Make each texture name one image by `source`, and each image a file that browsers read."""
    document, file = opened.document, opened.file
    notes = ReportNotes()
    readable: dict[int, bool] = {}
    for number, texture in enumerate(document.entries("textures")):
        source = texture_image(file, number, notes)
        for owner in (texture, *(texture.get("extensions", {}).pop(name, {}) for name in IMAGE_EXTENSIONS)):
            owner.pop("source", None)
        # Images that only a pack has are not entries of the document.
        if source is None or source >= len(document.entries("images")):
            continue
        if source not in readable:
            readable[source] = _plain_image(opened, source)
        if readable[source]:
            texture["source"] = source
    used = {source for source, is_readable in readable.items() if is_readable}
    document.remove_images(set(range(len(document.entries("images")))) - used)


def _plain_image(opened: OpenedExport, index: int) -> bool:
    """Convert image entry `index` to a file that browsers read. Returns False where it cannot be read."""
    file = opened.file
    name = file.label(file.entries("images")[index], f"image {index}")
    try:
        data = image_bytes(file, opened.buffers, index)
        suffix = image_suffix(data, name)
        if suffix not in BROWSER_IMAGES:
            picture = BytesIO()
            Image.fromarray(decode_image(data, name)).save(picture, "PNG")
            data, suffix = picture.getvalue(), ".png"
    except InputError as error:
        opened.document.missing.append(str(error))
        return False
    image = ImageFile(f"{name.rsplit('.', 1)[0]}{suffix}", BROWSER_IMAGES[suffix], partial(bytes, data))
    opened.document.replace_image(index, image)
    return True
