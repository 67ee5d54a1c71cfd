"""Builds tiny glTF files in memory for tests."""

import base64
import json
import struct
import zlib
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

COMPONENT_CODES = {"int8": 5120, "uint8": 5121, "int16": 5122, "uint16": 5123, "uint32": 5125, "float32": 5126}
KTX2_HEADER_BYTES = 80
KINDS = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4", 16: "MAT4"}

TRIANGLE = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], np.float32)
TRIANGLE_UVS = np.array([[0, 0], [1, 0], [0, 1]], np.float32)


def png(pixels: NDArray[np.uint8] | NDArray[np.uint16]) -> bytes:
    """A PNG file of `pixels` [H, W, 1 to 4], written without the code under test."""
    height, width, channels = pixels.shape
    depth = 16 if pixels.dtype == np.uint16 else 8
    color = {1: 0, 2: 4, 3: 2, 4: 6}[channels]

    rows = b"".join(b"\0" + row.astype(row.dtype.newbyteorder(">")).tobytes() for row in pixels)
    return png_of((width, height), depth, color, zlib.compress(rows))


def png_of(size: tuple[int, int], depth: int, color: int, packed: bytes) -> bytes:
    """A PNG file of a header and the data `packed`, whatever that holds."""

    def chunk(name: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))

    header = struct.pack(">IIBBBBB", *size, depth, color, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", packed) + chunk(b"IEND", b"")


def noise(height: int = 4, width: int = 6, channels: int = 3, seed: int = 0) -> NDArray[np.uint8]:
    """Random pixels [height, width, channels], never constant."""
    return np.random.default_rng(seed).integers(0, 256, (height, width, channels), np.uint8)


def ktx2(
    level: bytes,
    size: tuple[int, int],
    vk_format: int,
    *,
    scheme: int = 0,
    depth: int = 0,
    layers: int = 0,
    faces: int = 1,
    level_length: int | None = None,
) -> bytes:
    """A KTX2 file with one mip, written without the code under test; without a data format descriptor."""
    fields = (vk_format, 1, *size, depth, layers, faces, 1, scheme)
    header = struct.pack("<12s9I4I2Q", b"\xabKTX 20\xbb\r\n\x1a\n", *fields, 0, 0, 0, 0, 0, 0)
    length = len(level) if level_length is None else level_length
    return header + struct.pack("<3Q", KTX2_HEADER_BYTES + 24, length, len(level)) + level


class GltfBuilder:
    """Gathers JSON entries and one buffer; `json` may be edited freely before it is written."""

    def __init__(self) -> None:
        self.json: dict[str, Any] = {"asset": {"version": "2.0"}}
        self.data = bytearray()

    def add(self, key: str, **entry: Any) -> int:
        """Append `entry` to the top-level array `key`; its index."""
        self.json.setdefault(key, []).append(entry)
        return len(self.json[key]) - 1

    def view(self, data: bytes, **entry: Any) -> int:
        """A buffer view with `data`; its index."""
        self.data.extend(b"\0" * (-len(self.data) % 4))
        offset = len(self.data)
        self.data.extend(data)
        return self.add("bufferViews", buffer=0, byteOffset=offset, byteLength=len(data), **entry)

    def accessor(self, values: NDArray[Any], stride: int = 0, offset: int = 0, **entry: Any) -> int:
        """An accessor over `values` [N] or [N, C] with `stride` bytes an element and `offset` bytes in front."""
        table = values.reshape(len(values), -1)
        row = table.shape[1] * table.dtype.itemsize
        step = stride or row
        padded = np.full((len(table), step), 0xAB, np.uint8)
        padded[:, :row] = np.ascontiguousarray(table).view(np.uint8).reshape(len(table), row)
        view = self.view(b"\xcd" * offset + padded.tobytes(), **({"byteStride": stride} if stride else {}))
        return self.add(
            "accessors",
            **{
                "bufferView": view,
                "byteOffset": offset,
                "componentType": COMPONENT_CODES[str(values.dtype)],
                "count": len(table),
                "type": KINDS[table.shape[1]],
                **entry,
            },
        )

    def image(self, data: bytes, mime: str = "image/png", **entry: Any) -> int:
        """An image in a buffer view; its index."""
        return self.add("images", bufferView=self.view(data), mimeType=mime, **entry)

    def material(self, image: int | None = None, info: dict[str, Any] | None = None, **entry: Any) -> int:
        """A material whose base colour texture shows `image`; `info` adds to the textureInfo. Its index."""
        pbr = dict(entry.pop("pbr", {}))
        if image is not None:
            texture = self.add("textures", source=image)
            pbr["baseColorTexture"] = {"index": texture, **(info or {})}
        return self.add("materials", pbrMetallicRoughness=pbr, **entry)

    def mesh(self, *primitives: dict[str, Any], **entry: Any) -> int:
        """A mesh; its index."""
        return self.add("meshes", primitives=list(primitives), **entry)

    def triangle(self, material: int | None = None, **attributes: NDArray[Any]) -> dict[str, Any]:
        """A one-triangle primitive with UVs; `attributes` are added or replace those."""
        arrays = {"POSITION": TRIANGLE, "TEXCOORD_0": TRIANGLE_UVS, **attributes}
        primitive: dict[str, Any] = {"attributes": {name: self.accessor(array) for name, array in arrays.items()}}
        if material is not None:
            primitive["material"] = material
        return primitive

    def drawn(self, *primitives: dict[str, Any]) -> "GltfBuilder":
        """Put a node with a mesh of `primitives` at the root."""
        self.add("nodes", mesh=self.mesh(*primitives))
        return self

    def glb(self) -> bytes:
        """The file as GLB."""
        content = dict(self.json)
        if self.data:
            content["buffers"] = [{"byteLength": len(self.data)}]
        text = json.dumps(content).encode()
        text += b" " * (-len(text) % 4)
        body = struct.pack("<II", len(text), 0x4E4F534A) + text
        if self.data:
            data = bytes(self.data) + b"\0" * (-len(self.data) % 4)
            body += struct.pack("<II", len(data), 0x004E4942) + data
        return struct.pack("<4sII", b"glTF", 2, 12 + len(body)) + body

    def write(self, path: Path, *, uri: str | None = None) -> Path:
        """Write to `path`: as GLB, or for .gltf with the buffer as a data URI, or in the file `uri` beside it."""
        if path.suffix == ".glb":
            path.write_bytes(self.glb())
            return path
        content = dict(self.json)
        if uri is not None:
            (path.parent / uri).write_bytes(bytes(self.data))
        else:
            uri = "data:application/octet-stream;base64," + base64.b64encode(bytes(self.data)).decode()
        content["buffers"] = [{"byteLength": len(self.data), "uri": uri}]
        path.write_text(json.dumps(content))
        return path
