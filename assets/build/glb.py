"""A small writer of GLB files (glTF 2.0, Sec. 4.4)."""

import json
import struct
from typing import Any

from numpy.typing import NDArray

FLOAT, UNSIGNED_SHORT, UNSIGNED_INT = 5126, 5123, 5125
ARRAY_BUFFER, ELEMENT_ARRAY_BUFFER = 34962, 34963


class GlbWriter:
    """Collects a glTF document and its binary chunk."""

    def __init__(self) -> None:
        self.document: dict[str, Any] = {
            "asset": {"version": "2.0", "generator": "ntc-viewer assets/build"},
            "scene": 0,
            "scenes": [{"nodes": []}],
            "extensionsUsed": [],
        }
        self._binary = bytearray()

    def add(self, collection: str, entry: dict[str, Any]) -> int:
        """Append to a top-level array of the document; its index."""
        self.document.setdefault(collection, []).append(entry)
        return len(self.document[collection]) - 1

    def require(self, extension: str) -> None:
        """Name an extension that readers of the file must know."""
        for key in ("extensionsUsed", "extensionsRequired"):
            self.document.setdefault(key, []).append(extension)

    def view(self, data: bytes, target: int | None = None) -> int:
        """A buffer view with this content."""
        self._binary += bytes(-len(self._binary) % 4)
        entry: dict[str, Any] = {"buffer": 0, "byteOffset": len(self._binary), "byteLength": len(data)}
        if target is not None:
            entry["target"] = target
        self._binary += data
        return self.add("bufferViews", entry)

    def accessor(self, array: NDArray[Any], bounds: bool = False, indices: bool = False) -> int:
        """An accessor for float rows [N, C], or for indices [N]."""
        if indices:
            small = array.max() < 65535
            data = array.astype("<u2" if small else "<u4")
            component, kind, target = (UNSIGNED_SHORT if small else UNSIGNED_INT), "SCALAR", ELEMENT_ARRAY_BUFFER
        else:
            data = array.astype("<f4")
            component, kind, target = FLOAT, {2: "VEC2", 3: "VEC3", 4: "VEC4"}[array.shape[1]], ARRAY_BUFFER
        entry = {
            "bufferView": self.view(data.tobytes(), target),
            "componentType": component,
            "count": len(data),
            "type": kind,
        }
        if bounds:
            entry["min"], entry["max"] = data.min(axis=0).tolist(), data.max(axis=0).tolist()
        return self.add("accessors", entry)

    def bytes(self) -> bytes:
        """The whole file."""
        binary = bytes(self._binary) + bytes(-len(self._binary) % 4)
        self.document["buffers"] = [{"byteLength": len(binary)}]
        text = json.dumps(self.document, separators=(",", ":")).encode()
        text += b" " * (-len(text) % 4)
        total = 12 + 8 + len(text) + 8 + len(binary)
        head = struct.pack("<4sII", b"glTF", 2, total)
        return (
            head + struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(binary), b"BIN\0") + binary
        )
