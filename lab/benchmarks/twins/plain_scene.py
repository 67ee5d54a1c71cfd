"""A glTF scene taken apart into JSON and the bytes of each buffer view, so that parts can be replaced, and put together as GLB."""

import base64
import copy
import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np
from numpy.typing import NDArray

from ntc.errors import InputError
from tests.support.meshopt_twins import glb_of, glb_parts
from viewer.scene.gltf.buffers import COMPONENT_TYPES, COMPONENTS

MIME = {".png": "image/png", ".jpg": "image/jpeg", ".jpeg": "image/jpeg", ".webp": "image/webp", ".ktx2": "image/ktx2"}
MESHOPT = "EXT_meshopt_compression"
COMPONENT_CODES = {kind: code for code, kind in COMPONENT_TYPES.items()}


@dataclass(eq=False)
class PlainScene:
    """JSON and views; both are changed in place by whoever makes a twin of a copy."""

    content: dict[str, Any]
    views: list[bytes]
    """By index into `bufferViews`."""

    @staticmethod
    def read(path: Path) -> "PlainScene":
        """The .glb or .gltf at `path` with all its files. Raises InputError where it is compressed or has sparse accessors."""
        data = path.read_bytes()
        content, binary = glb_parts(data) if data[:4] == b"glTF" else (json.loads(data), b"")
        buffers = [
            _content_of(entry["uri"], path) if "uri" in entry else binary for entry in content.get("buffers", [])
        ]
        views = []
        for view in content.get("bufferViews", []):
            if view.get("extensions"):
                raise InputError(f"{path}: is compressed; give the plain scene")
            start = view.get("byteOffset", 0)
            views.append(buffers[view.pop("buffer")][start : start + view["byteLength"]])
            view.pop("byteOffset", None)
        if any("sparse" in accessor or "bufferView" not in accessor for accessor in content.get("accessors", [])):
            raise InputError(f"{path}: has sparse accessors; give a scene without")
        scene = PlainScene(content, views)
        for image in content.get("images", []):
            if "uri" in image:
                uri = image.pop("uri")
                image.setdefault("mimeType", MIME[Path(unquote(uri)).suffix.lower()])
                image["bufferView"] = scene.add_view(_content_of(uri, path))
        return scene

    def copy(self) -> "PlainScene":
        """One that may be changed."""
        return PlainScene(copy.deepcopy(self.content), list(self.views))

    def add_view(self, data: bytes, **entry: Any) -> int:
        """A further view; its index."""
        self.views.append(data)
        views = self.content.setdefault("bufferViews", [])
        views.append({"byteLength": len(data), **entry})
        return len(views) - 1

    def use(self, extension: str, *, required: bool = True) -> None:
        """Name `extension` as used."""
        for key in ("extensionsUsed", *(("extensionsRequired",) if required else ())):
            names = self.content.setdefault(key, [])
            if extension not in names:
                names.append(extension)

    def values(self, accessor: int) -> NDArray[Any]:
        """[N, components] of the accessor as it is stored."""
        entry = self.content["accessors"][accessor]
        view = self.content["bufferViews"][entry["bufferView"]]
        kind = COMPONENT_TYPES[entry["componentType"]]
        row = COMPONENTS[entry["type"]] * kind.itemsize
        stride = view.get("byteStride", row)
        data = np.frombuffer(self.views[entry["bufferView"]], np.uint8)
        places = entry.get("byteOffset", 0) + np.arange(entry["count"])[:, None] * stride + np.arange(row)
        return np.ascontiguousarray(data[places]).view(kind)

    def add_accessor(self, rows: NDArray[Any], kind: str, **entry: Any) -> int:
        """An accessor of `rows` [N, components], each padded to four bytes; its index."""
        width = -(-rows.shape[1] * rows.itemsize // 4) * 4
        padded = np.zeros((len(rows), width), np.uint8)
        padded[:, : rows.shape[1] * rows.itemsize] = np.ascontiguousarray(rows).view(np.uint8).reshape(len(rows), -1)
        view = self.add_view(padded.tobytes(), byteStride=width)
        return self._add(len(rows), rows.dtype, kind, {"bufferView": view, **entry})

    def add_compressed(self, data: bytes, rows: int, kind: str, component: Any, filtered: str, **entry: Any) -> int:
        """An accessor of `rows` elements in `data`, which meshoptimizer encoded behind a filter; its index."""
        stride = entry.pop("stride")
        place = {"byteStride": stride, "count": rows, "mode": "ATTRIBUTES", "filter": filtered, "byteLength": len(data)}
        view = self.add_view(data, byteStride=stride, extensions={MESHOPT: place})
        self.content["bufferViews"][view]["byteLength"] = rows * stride
        return self._add(rows, np.dtype(component), kind, {"bufferView": view, **entry})

    def add_empty(self, rows: int, component: Any, kind: str, **entry: Any) -> int:
        """An accessor without bytes, for what lies in an extension; its index."""
        return self._add(rows, np.dtype(component), kind, entry)

    def _add(self, rows: int, component: np.dtype[Any], kind: str, entry: dict[str, Any]) -> int:
        accessors = self.content["accessors"]
        accessors.append({"componentType": COMPONENT_CODES[component], "count": rows, "type": kind, **entry})
        return len(accessors) - 1

    def primitives(self) -> Iterator[dict[str, Any]]:
        """All primitives of all meshes."""
        for mesh in self.content.get("meshes", []):
            yield from mesh["primitives"]

    def glb(self) -> bytes:
        """As a GLB that holds only the accessors and views that something reads."""
        content = copy.deepcopy(self.content)
        _renumber(content, "accessors", _accessor_owners(content))
        kept = _renumber(content, "bufferViews", _view_owners(content))
        binary = bytearray()
        expanded = 0
        for view, old in zip(content.get("bufferViews", []), kept, strict=True):
            compression = view.get("extensions", {}).get(MESHOPT)
            if compression is not None:
                compression |= {"buffer": 0, "byteOffset": len(binary)}
                view |= {"buffer": 1, "byteOffset": expanded}
                expanded += view["byteLength"]
            else:
                view |= {"buffer": 0, "byteOffset": len(binary)}
            binary += self.views[old] + b"\0" * (-len(self.views[old]) % 4)
        content["buffers"] = [{"byteLength": len(binary)}]
        if expanded:
            content["buffers"].append({"byteLength": expanded, "extensions": {MESHOPT: {"fallback": True}}})
        return glb_of(content, bytes(binary))


def _content_of(uri: str, path: Path) -> bytes:
    if uri.startswith("data:"):
        return base64.b64decode(uri.partition(",")[2])
    try:
        return (path.parent / unquote(uri)).read_bytes()
    except OSError as error:
        raise InputError(f"{path}: {uri} cannot be read; give a scene with all its files") from error


def _accessor_owners(content: dict[str, Any]) -> list[tuple[Any, Any]]:
    """(container, key) of every index of an accessor."""
    found: list[tuple[Any, Any]] = []
    for mesh in content.get("meshes", []):
        for primitive in mesh["primitives"]:
            found += [
                (table, key) for table in (primitive["attributes"], *primitive.get("targets", [])) for key in table
            ]
            if "indices" in primitive:
                found.append((primitive, "indices"))
    for animation in content.get("animations", []):
        found += [(sampler, key) for sampler in animation["samplers"] for key in ("input", "output")]
    found += [(skin, "inverseBindMatrices") for skin in content.get("skins", []) if "inverseBindMatrices" in skin]
    for node in content.get("nodes", []):
        instancing = node.get("extensions", {}).get("EXT_mesh_gpu_instancing", {}).get("attributes", {})
        found += [(instancing, key) for key in instancing]
    return found


def _view_owners(content: dict[str, Any]) -> list[tuple[Any, Any]]:
    """(container, key) of every index of a buffer view."""
    owners = [*content.get("accessors", []), *content.get("images", [])]
    for mesh in content.get("meshes", []):
        owners += [entry for primitive in mesh["primitives"] for entry in primitive.get("extensions", {}).values()]
    return [(owner, "bufferView") for owner in owners if isinstance(owner, dict) and "bufferView" in owner]


def _renumber(content: dict[str, Any], key: str, owners: list[tuple[Any, Any]]) -> list[int]:
    """Drop what no owner names from the array `key`; the old indices of what is kept."""
    kept = sorted({owner[name] for owner, name in owners})
    numbers = {old: new for new, old in enumerate(kept)}
    for owner, name in owners:
        owner[name] = numbers[owner[name]]
    content[key] = [content[key][old] for old in kept]
    return kept
