"""Twins of glTF files whose buffer views are compressed by meshoptimizer's encoder."""

import json
import struct
from typing import Any

import meshopt
import numpy as np
from numpy.typing import NDArray

from viewer.scene.gltf.buffers import COMPONENT_TYPES, COMPONENTS

FALLBACK = {"fallback": True}


def glb_parts(data: bytes) -> tuple[dict[str, Any], bytes]:
    """(JSON, binary chunk) of a GLB."""
    length = struct.unpack_from("<I", data, 12)[0]
    start = 20 + length + 8
    return json.loads(data[20 : 20 + length]), data[start:]


def glb_of(content: dict[str, Any], binary: bytes) -> bytes:
    """A GLB of JSON and a binary chunk."""
    text = json.dumps(content).encode()
    text += b" " * (-len(text) % 4)
    binary += b"\0" * (-len(binary) % 4)
    body = struct.pack("<II", len(text), 0x4E4F534A) + text + struct.pack("<II", len(binary), 0x004E4942) + binary
    return struct.pack("<4sII", b"glTF", 2, 12 + len(body)) + body


def compressed_view(
    values: NDArray[Any], mode: str, filtered: str = "NONE", version: int = 0
) -> tuple[bytes, dict[str, Any]]:
    """Rows `values` [N, ...] encoded, and the extension object but for its buffer and place."""
    rows = np.ascontiguousarray(values)
    data = meshopt.encode_gltf_buffer(rows, mode, version)
    stride = rows.nbytes // len(rows)
    return data, {"byteStride": stride, "count": len(rows), "mode": mode, "filter": filtered, "byteLength": len(data)}


def meshopt_twin(data: bytes, name: str = "EXT_meshopt_compression", version: int = 0) -> bytes:
    """The GLB `data` with all views that accessors read compressed, in a GLB; the original bytes are not in it.

    Lists of triangles become TRIANGLES, other indices INDICES, and what has elements of four bytes or a multiple ATTRIBUTES.
    """
    content, binary = glb_parts(data)
    uses = _uses(content)
    packed = bytearray()
    fallback_bytes = 0
    for number, view in enumerate(content.get("bufferViews", [])):
        offset, length = view.get("byteOffset", 0), view["byteLength"]
        plain = np.frombuffer(binary, np.uint8, length, offset)
        mode, stride = uses.get(number, ("", 0))
        if not mode or length % stride or (mode == "ATTRIBUTES" and stride % 4):
            view["byteOffset"] = len(packed)
            packed += plain.tobytes() + b"\0" * (-length % 4)
            continue
        rows = plain.reshape(-1, stride)
        values = rows if mode == "ATTRIBUTES" else rows.view({2: "<u2", 4: "<u4"}[stride]).reshape(-1)
        encoded, extension = compressed_view(values, mode, version=version)
        extension |= {"buffer": 0, "byteOffset": len(packed)}
        view["extensions"] = {name: extension}
        view["buffer"], view["byteOffset"] = 1, fallback_bytes
        fallback_bytes += length
        packed += encoded + b"\0" * (-len(encoded) % 4)
    content["buffers"] = [
        {"byteLength": len(packed)},
        {"byteLength": max(1, fallback_bytes), "extensions": {name: FALLBACK}},
    ]
    content.setdefault("extensionsUsed", []).append(name)
    content.setdefault("extensionsRequired", []).append(name)
    return glb_of(content, bytes(packed))


def _uses(content: dict[str, Any]) -> dict[int, tuple[str, int]]:
    """Return the mode and the bytes of an element to compress with, by buffer view."""
    uses: dict[int, tuple[str, int]] = {}
    accessors = content.get("accessors", [])
    for accessor in accessors:
        if "bufferView" in accessor:
            number = accessor["bufferView"]
            size = COMPONENT_TYPES[accessor["componentType"]].itemsize * COMPONENTS[accessor["type"]]
            uses[number] = ("ATTRIBUTES", content["bufferViews"][number].get("byteStride", size))
    for mesh in content.get("meshes", []):
        for primitive in mesh["primitives"]:
            if "indices" in primitive:
                accessor = accessors[primitive["indices"]]
                size = COMPONENT_TYPES[accessor["componentType"]].itemsize
                triangles = primitive.get("mode", 4) == 4 and accessor["count"] % 3 == 0
                if size > 1:
                    uses[accessor["bufferView"]] = ("TRIANGLES" if triangles else "INDICES", size)
                else:
                    uses.pop(accessor["bufferView"])
    return uses
