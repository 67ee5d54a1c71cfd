"""Twins with other geometry: quantised, behind meshoptimizer's filters, and in Draco, each with the largest error it may have."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import DracoPy
import meshopt
import numpy as np
from numpy.typing import NDArray

from lab.benchmarks.twins.plain_scene import MESHOPT, PlainScene
from ntc.errors import InputError
from tests.support.meshopt_twins import meshopt_twin

EXPONENT_BITS = 16
"""Of a filtered position or texture coordinate, the sign included."""
DRACO_BITS, DRACO_UV_BITS, DRACO_NORMAL_BITS = 14, 12, 10
LARGEST_SHORT = 65535
ROUNDING = 4 * float(np.finfo(np.float32).eps)
"""Of single precision, relative to the largest value."""


@dataclass(frozen=True)
class Error:
    """The most by which a twin may differ."""

    position: float = 0.0
    """Along an axis, in units of the mesh."""
    uv: float = 0.0
    texel: int = 0
    """Of 255, in any channel."""


@dataclass(frozen=True)
class Twin:
    """A file and what it may differ by."""

    content: bytes
    error: Error = Error()
    suffix: str = ".glb"
    decoded: bytes | None = None
    """A GLB that must look the same: with PNGs of what another decoder makes of the twin's images."""


def lossless_meshopt(name: str, version: int) -> Callable[[PlainScene], Twin]:
    """All views that accessors read, compressed without a filter."""
    # Triangles may begin at another corner, from which the rasteriser then interpolates.
    return lambda scene: Twin(meshopt_twin(scene.glb(), name, version), Error(uv=ROUNDING))


def _replaced(scene: PlainScene, change: Callable[[str, NDArray[Any], dict[str, Any]], int | None]) -> None:
    """Let each attribute's accessor be the one that `change` makes of its name, values and entry, once for each."""
    made: dict[tuple[str, int], int | None] = {}
    for primitive in scene.primitives():
        for name, accessor in primitive["attributes"].items():
            key = (name, accessor)
            if key not in made:
                made[key] = change(name, scene.values(accessor), scene.content["accessors"][accessor])
            number = made[key]
            if number is not None:
                primitive["attributes"][name] = number


def filtered(scene: PlainScene) -> Twin:
    """Positions and texture coordinates as exponents, normals and tangents as octahedra, colours as such."""
    twin = scene.copy()
    twin.use(MESHOPT)
    twin.use("KHR_mesh_quantization")
    largest = {"POSITION": 0.0, "TEXCOORD_0": 0.0}

    def change(name: str, values: NDArray[Any], entry: dict[str, Any]) -> int | None:
        count, kind = len(values), entry["type"]
        if values.dtype != np.float32:
            return None
        if name in largest:
            largest[name] = max(largest[name], float(np.abs(values).max()))
            encoded = meshopt.encode_filter_exp(values, EXPONENT_BITS)
            bounds = {key: entry[key] for key in ("min", "max") if key in entry}
            data = meshopt.encode_gltf_buffer(encoded, "ATTRIBUTES", 0)
            return twin.add_compressed(data, count, kind, "<f4", "EXPONENTIAL", stride=values.shape[1] * 4, **bounds)
        if name in ("NORMAL", "TANGENT"):
            wide = np.ones((count, 4), np.float32)
            wide[:, : values.shape[1]] = values
            data = meshopt.encode_gltf_buffer(meshopt.encode_filter_oct(wide, 4, 8), "ATTRIBUTES", 0)
            return twin.add_compressed(data, count, kind, "i1", "OCTAHEDRAL", stride=4, normalized=True)
        if name == "COLOR_0":
            wide = np.ones((count, 4), np.float32)
            wide[:, : values.shape[1]] = values
            data = meshopt.encode_gltf_buffer(meshopt.encode_filter_color(wide, 4, 8), "ATTRIBUTES", 1)
            return twin.add_compressed(data, count, kind, "u1", "COLOR", stride=4, normalized=True)
        return None

    _replaced(twin, change)
    # A mantissa of so many bits, signed, rounded, behind an exponent that the largest component of a vertex needs.
    steps = {name: _power_above(value) * 2.0**-EXPONENT_BITS for name, value in largest.items()}
    return Twin(twin.glb(), Error(steps["POSITION"], steps["TEXCOORD_0"]))


def _power_above(value: float) -> float:
    return 2.0 ** (math.floor(math.log2(value)) + 1) if value > 0.0 else 0.0


def quantised(scene: PlainScene) -> Twin:
    """KHR_mesh_quantization: positions of 16 bits in the box of their mesh, which a node between undoes; normals of 8."""
    twin = scene.copy()
    twin.use("KHR_mesh_quantization")
    meshes, nodes = twin.content.get("meshes", []), twin.content["nodes"]
    if any("skin" in node or "extensions" in node for node in nodes) or any("targets" in p for p in twin.primitives()):
        raise InputError("quantised: nodes with skins, morph targets or extensions are left alone")
    boxes = []
    for mesh in meshes:
        points = np.concatenate([twin.values(p["attributes"]["POSITION"]) for p in mesh["primitives"]]).astype(float)
        low = points.min(axis=0)
        # One scale for all axes: normals keep their directions.
        scale = float((points.max(axis=0) - low).max()) or 1.0
        boxes.append((low, scale))
        for primitive in mesh["primitives"]:
            values = twin.values(primitive["attributes"]["POSITION"]).astype(float)
            rows = np.round((values - low) / scale * LARGEST_SHORT).astype(np.uint16)
            bounds = {"min": rows.min(axis=0).tolist(), "max": rows.max(axis=0).tolist()}
            primitive["attributes"]["POSITION"] = twin.add_accessor(rows, "VEC3", normalized=True, **bounds)
    for node in list(nodes):
        if "mesh" in node:
            low, scale = boxes[node["mesh"]]
            nodes.append({"mesh": node.pop("mesh"), "translation": low.tolist(), "scale": [scale] * 3})
            node.setdefault("children", []).append(len(nodes) - 1)
    least = 1.0 / LARGEST_SHORT

    def change(name: str, values: NDArray[Any], entry: dict[str, Any]) -> int | None:
        if values.dtype == np.float32 and name in ("NORMAL", "TANGENT"):
            return twin.add_accessor(np.round(values * 127).astype(np.int8), entry["type"], normalized=True)
        if name == "TEXCOORD_0" and values.dtype == np.float32 and values.min() >= 0.0 and values.max() <= 1.0:
            return twin.add_accessor(np.round(values * LARGEST_SHORT).astype(np.uint16), "VEC2", normalized=True)
        return None

    _replaced(twin, change)
    step = max(scale * least / 2 + (float(np.abs(low).max()) + scale) * ROUNDING for low, scale in boxes)
    return Twin(twin.glb(), Error(step, least / 2 + ROUNDING))


def draco(scene: PlainScene) -> Twin:
    """KHR_draco_mesh_compression of every primitive; what is neither position, normal nor first UV keeps its bytes."""
    twin = scene.copy()
    twin.use("KHR_draco_mesh_compression")
    position = uv = 0.0
    for primitive in twin.primitives():
        if primitive.get("mode", 4) != 4 or "targets" in primitive:
            raise InputError("draco: strips, fans and morph targets are left alone")
        values = {name: twin.values(accessor) for name, accessor in primitive["attributes"].items()}
        points = values.pop("POSITION").astype(np.float32)
        indices = twin.values(primitive["indices"])[:, 0] if "indices" in primitive else np.arange(len(points))
        extent = float(np.ptp(points, axis=0).max())
        position = max(position, extent / (2**DRACO_BITS - 1) / 2 + float(np.abs(points).max()) * ROUNDING)
        uvs, normals = values.pop("TEXCOORD_0", None), values.pop("NORMAL", None)
        if uvs is not None:
            uv = max(
                uv, float(np.ptp(uvs, axis=0).max()) / (2**DRACO_UV_BITS - 1) / 2 + float(np.abs(uvs).max()) * ROUNDING
            )
        generic = {10 + number: np.ascontiguousarray(rows) for number, rows in enumerate(values.values())}
        data = DracoPy.encode(
            points,
            indices.reshape(-1, 3).astype(np.uint32),
            quantization_bits=DRACO_BITS,
            # The encoder takes doubles, and keeps single precision of them.
            tex_coord=None if uvs is None else uvs.astype(np.float64),
            normals=None if normals is None else normals.astype(np.float64),
            generic_attributes=generic or None,
            tex_coord_quantization_bits=DRACO_UV_BITS,
            normal_quantization_bits=DRACO_NORMAL_BITS,
        )
        _in_draco(twin, primitive, data, dict(zip(values, generic, strict=True)))
    return Twin(twin.glb(), Error(position, uv))


def _in_draco(twin: PlainScene, primitive: dict[str, Any], data: bytes, generic: dict[str, int]) -> None:
    """Let `primitive` be in the Draco file `data`; `generic` has the numbers of further attributes."""
    mesh = DracoPy.decode(data)
    numbers = dict(generic)
    stored = {entry["unique_id"]: entry for entry in mesh.attributes}
    for kind, name in ((0, "POSITION"), (1, "NORMAL"), (3, "TEXCOORD_0")):
        found = [n for n, entry in stored.items() if int(entry["attribute_type"]) == kind and n not in generic.values()]
        if found:
            numbers[name] = found[0]
    old = primitive["attributes"]
    for name in list(old):
        entry = twin.content["accessors"][old[name]]
        rows = np.asarray(stored[numbers[name]]["data"])
        bounds = {"min": rows.min(axis=0).tolist(), "max": rows.max(axis=0).tolist()} if name == "POSITION" else {}
        normalized = {"normalized": True} if entry.get("normalized") else {}
        old[name] = twin.add_empty(len(rows), rows.dtype, entry["type"], **bounds, **normalized)
    primitive["indices"] = twin.add_empty(int(np.asarray(mesh.faces).size), "<u4", "SCALAR")
    extension = {"bufferView": twin.add_view(data), "attributes": numbers}
    primitive.setdefault("extensions", {})["KHR_draco_mesh_compression"] = extension
