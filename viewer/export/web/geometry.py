"""The geometry of a scene as a GLB: each primitive a mesh, each of its placements a node, nothing of its textures."""

import json
import struct
from typing import Any

import numpy as np
from numpy.typing import NDArray

from viewer.scene.model import Material, Primitive, Scene

COMPONENT = {np.dtype("<f4"): 5126, np.dtype("<u2"): 5123, np.dtype("<u4"): 5125}
KIND = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4"}
ARRAY_BUFFER, ELEMENT_BUFFER = 34962, 34963


class _Binary:
    """The accessors of a file and the bytes behind them."""

    def __init__(self) -> None:
        self.parts: list[bytes] = []
        self.views: list[dict[str, int]] = []
        self.accessors: list[dict[str, Any]] = []
        self.size = 0
        self._known: dict[object, int] = {}

    def accessor(self, key: object, values: NDArray[Any], target: int, bounds: bool = False) -> int:
        """Return the accessor of `values` [N] or [N, k]; equal keys stand for equal values."""
        if key in self._known:
            return self._known[key]
        data = values.tobytes()
        padded = data.ljust(-(-len(data) // 4) * 4, b"\0")
        self.views.append({"buffer": 0, "byteOffset": self.size, "byteLength": len(data), "target": target})
        self.parts.append(padded)
        self.size += len(padded)
        width = values.shape[1] if values.ndim == 2 else 1
        entry: dict[str, Any] = {
            "bufferView": len(self.views) - 1,
            "componentType": COMPONENT[values.dtype.newbyteorder("<")],
            "count": len(values),
            "type": KIND[width],
        }
        if bounds:
            entry["min"], entry["max"] = values.min(axis=0).tolist(), values.max(axis=0).tolist()
        self.accessors.append(entry)
        self._known[key] = len(self.accessors) - 1
        return self._known[key]


def _texture_coordinates(binary: _Binary, scene: Scene, material: Material, rows: slice) -> dict[str, int]:
    """Return the coordinates of the planes base, surface and emission by attribute name, equal ones stored once."""
    geometry, found = scene.geometry, {}
    for number, plane in enumerate((material.plane("base"), material.surface, material.emission)):
        second = plane is not None and plane.second_uvs and geometry.second_uvs is not None
        transform = plane.uv_transform if plane is not None else (1.0, 0.0, 0.0, 0.0, 1.0, 0.0)
        source = geometry.second_uvs if second and geometry.second_uvs is not None else geometry.uvs
        a, b, c, d, e, f = transform
        values = source[rows]
        if transform != (1.0, 0.0, 0.0, 0.0, 1.0, 0.0):
            matrix, offset = np.array([[a, d], [b, e]]), np.array([c, f])
            values = (values.astype(np.float64) @ matrix + offset).astype(np.float32)
        key = ("uv", rows.start, rows.stop, second, transform)
        found[f"TEXCOORD_{number}"] = binary.accessor(key, np.ascontiguousarray(values, "<f4"), ARRAY_BUFFER)
    return found


def _mesh(binary: _Binary, scene: Scene, primitive: Primitive) -> dict[str, Any]:
    geometry, rows = scene.geometry, slice(primitive.base_vertex, primitive.base_vertex + primitive.vertex_count)

    def attribute(name: str, values: NDArray[np.float32]) -> int:
        own = np.ascontiguousarray(values[rows], "<f4")
        return binary.accessor((name, rows.start, rows.stop), own, ARRAY_BUFFER, name == "POSITION")

    attributes = {"POSITION": attribute("POSITION", geometry.positions)}
    # Where a vertex has no direction the page takes the triangle's own, as for primitives without normals.
    for name, frames in (("NORMAL", geometry.normals), ("TANGENT", geometry.tangents)):
        if frames is not None and np.all(np.abs(frames[rows, :3]).max(axis=1) > 0.0):
            attributes[name] = attribute(name, frames)
    if geometry.colors is not None and not np.all(geometry.colors[rows] == 1.0):
        # Alpha only where there is any: the page's other meshes have the same program then.
        channels = 4 if np.any(geometry.colors[rows, 3] != 1.0) else 3
        attributes["COLOR_0"] = attribute("COLOR_0", geometry.colors[:, :channels])
    attributes |= _texture_coordinates(binary, scene, scene.materials[primitive.material], rows)
    last = primitive.first_index + primitive.index_count
    kind = "<u2" if geometry.indices.dtype == np.uint16 else "<u4"
    indices = np.ascontiguousarray(geometry.indices[primitive.first_index : last], kind)
    key = ("indices", primitive.first_index, last)
    own = {
        "attributes": attributes,
        "indices": binary.accessor(key, indices, ELEMENT_BUFFER),
        "material": primitive.material,
    }
    return {"name": primitive.name, "primitives": [own]}


def _material(number: int, material: Material) -> dict[str, Any]:
    rough = {
        "baseColorFactor": [min(max(value, 0.0), 1.0) for value in material.factor],
        "metallicFactor": material.factors.metalness,
        "roughnessFactor": material.factors.roughness,
    }
    own = {"name": material.name, "pbrMetallicRoughness": rough, "extras": {"material": number}}
    return {**own, "doubleSided": True} if material.double_sided else own


def scene_glb(scene: Scene) -> bytes:
    """Return `scene` as it stands, as a GLB. Materials have their factors, and in `extras.material` their number."""
    binary = _Binary()
    meshes = [_mesh(binary, scene, primitive) for primitive in scene.primitives]
    identity = np.eye(4, dtype=np.float32)
    nodes: list[dict[str, Any]] = []
    for number, matrix in zip(scene.instances.primitive.tolist(), scene.instances.transform, strict=True):
        node: dict[str, Any] = {"mesh": number}
        if not np.array_equal(matrix, identity):
            node["matrix"] = matrix.T.reshape(-1).tolist()
        nodes.append(node)
    content = {
        "asset": {"version": "2.0", "generator": "ntc-viewer export"},
        "scene": 0,
        "scenes": [{"nodes": list(range(len(nodes)))}],
        "nodes": nodes,
        "meshes": meshes,
        "materials": [_material(number, material) for number, material in enumerate(scene.materials)],
        "accessors": binary.accessors,
        "bufferViews": binary.views,
        "buffers": [{"byteLength": binary.size}],
    }
    text = json.dumps(content, separators=(",", ":"), allow_nan=False).encode()
    text = text.ljust(-(-len(text) // 4) * 4, b" ")
    data = b"".join(binary.parts)
    chunks = struct.pack("<II", len(text), 0x4E4F534A) + text + struct.pack("<II", len(data), 0x004E4942) + data
    return struct.pack("<III", 0x46546C67, 2, 12 + len(chunks)) + chunks
