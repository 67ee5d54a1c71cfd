"""Writes scenes of very many triangles as GLB, in pieces: the same bytes for the same arguments."""

import json
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ntc.io import atomic_path

SIDE = 112
"""Quads along each side of a mesh: 25,088 triangles, and few enough vertices for 16-bit indices."""
STRIP = 16
"""Quads across a strip of triangles: neighbours in the file are neighbours on the surface, as exporters leave them."""
MESH_TRIANGLES = 2 * SIDE * SIDE
SHARED_MESHES = 8
"""Distinct meshes of a scene that repeats them."""
SPACING = 2.6
"""Metres between neighbours."""
MATERIALS = 7


def mesh_count(triangles: int) -> int:
    """Meshes that stand in a scene of about so many triangles."""
    return max(1, round(triangles / MESH_TRIANGLES))


def _indices() -> NDArray[np.uint16]:
    """[3 T] of a grid of SIDE + 1 by SIDE + 1 vertices, strip by strip."""
    column, row = np.meshgrid(np.arange(SIDE), np.arange(SIDE))
    order = np.lexsort((column.ravel(), row.ravel(), column.ravel() // STRIP))
    first = (row.ravel() * (SIDE + 1) + column.ravel())[order]
    corners = np.stack([first, first + SIDE + 2, first + 1, first, first + SIDE + 1, first + SIDE + 2], axis=1)
    return corners.reshape(-1).astype(np.uint16)


def _vertices(random: np.random.Generator) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.float32]]:
    """(positions [V, 3], normals [V, 3], uvs [V, 2]) of a closed bumpy body about a metre across its middle."""
    v, u = np.meshgrid(np.linspace(0.0, 1.0, SIDE + 1), np.linspace(0.0, 1.0, SIDE + 1), indexing="ij")
    around, down = 2.0 * np.pi * u, np.pi * v
    direction = np.stack([np.sin(down) * np.sin(around), np.cos(down), np.sin(down) * np.cos(around)], axis=-1)
    radius = np.ones_like(u)
    for _ in range(6):
        turns = random.integers(2, 24)
        radius += (
            random.uniform(0.1, 0.3)
            / turns
            * np.sin(down)
            * np.sin(turns * around + random.uniform(0.0, 6.0))
            * np.sin(turns * down)
        )
    positions = direction * radius[..., None]
    step_u, step_v = np.gradient(positions, axis=1), np.gradient(positions, axis=0)
    normals = np.cross(step_v, step_u)
    normals[[0, -1]] = direction[[0, -1]]
    normals /= np.maximum(np.linalg.norm(normals, axis=-1, keepdims=True), 1e-12)
    uvs = np.stack([4.0 * u, 2.0 * v], axis=-1)
    stored = [part.reshape(-1, part.shape[-1]).astype("<f4") for part in (positions, normals, uvs)]
    return stored[0], stored[1], stored[2]


def _transforms(count: int, random: np.random.Generator) -> list[list[float]]:
    """[count] matrices in columns: a square city, with bodies of several heights; one in eleven is mirrored."""
    across = int(np.ceil(np.sqrt(count)))
    found = []
    for number in range(count):
        turn, height = random.uniform(0.0, 6.28), random.uniform(0.6, 2.5)
        flip = -1.0 if number % 11 == 10 else 1.0
        cosine, sine = np.cos(turn), np.sin(turn)
        x, z = SPACING * (number % across), SPACING * (number // across)
        found.append([flip * cosine, 0, -flip * sine, 0, 0, height, 0, 0, sine, 0, cosine, 0, x, height, z, 1])
    return [[float(value) for value in matrix] for matrix in found]


def _document(placed: int, bounds: list[tuple[Any, Any]], random: np.random.Generator) -> dict[str, Any]:
    vertices, indices = (SIDE + 1) ** 2, 3 * MESH_TRIANGLES
    views, accessors, entries = list[dict[str, Any]](), list[dict[str, Any]](), list[dict[str, Any]]()
    index_bytes, vertex_bytes = 2 * indices, 32 * vertices
    for number, (low, high) in enumerate(bounds):
        start = number * (index_bytes + vertex_bytes)
        views.append({"buffer": 0, "byteOffset": start, "byteLength": index_bytes})
        views.append({"buffer": 0, "byteOffset": start + index_bytes, "byteLength": vertex_bytes})
        base = len(accessors)
        accessors.append({"bufferView": 2 * number, "componentType": 5123, "type": "SCALAR", "count": indices})
        for offset, kind in ((0, "VEC3"), (12, "VEC3"), (24, "VEC2")):
            accessor: dict[str, Any] = {"bufferView": 2 * number + 1, "componentType": 5126, "type": kind}
            accessor |= {"count": vertices, "byteOffset": offset * vertices}
            accessors.append(accessor if offset else {**accessor, "min": low, "max": high})
        attributes = {"POSITION": base + 1, "NORMAL": base + 2, "TEXCOORD_0": base + 3}
        entries.append({"primitives": [{"attributes": attributes, "indices": base, "material": number % MATERIALS}]})
    nodes = [{"mesh": n % len(bounds), "matrix": matrix} for n, matrix in enumerate(_transforms(placed, random))]
    materials = []
    for _ in range(MATERIALS):
        factor = [*random.uniform(0.2, 0.9, 3).tolist(), 1.0]
        materials.append({"pbrMetallicRoughness": {"baseColorFactor": factor, "metallicFactor": 0.0}})
    return {
        "asset": {"version": "2.0", "generator": "many triangles"},
        "scene": 0,
        "scenes": [{"nodes": list(range(placed))}],
        "nodes": nodes,
        "meshes": entries,
        "materials": materials,
        "accessors": accessors,
        "bufferViews": views,
        "buffers": [{"byteLength": len(bounds) * (index_bytes + vertex_bytes)}],
    }


def _bodies(meshes: int, seed: int) -> Iterator[tuple[NDArray[np.float32], ...]]:
    for number in range(meshes):
        yield _vertices(np.random.default_rng((seed, number)))


def write_geometry(path: Path, triangles: int, *, instanced: bool, seed: int = 0) -> int:
    """Write a scene of about `triangles` drawn triangles to `path` (.glb); returns how many it has.

    `instanced`: SHARED_MESHES meshes stand at many nodes; otherwise each node has vertices and indices of its own.
    """
    placed = mesh_count(triangles)
    meshes = min(placed, SHARED_MESHES) if instanced else placed
    bounds = [(body[0].min(axis=0).tolist(), body[0].max(axis=0).tolist()) for body in _bodies(meshes, seed)]
    document = _document(placed, bounds, np.random.default_rng(seed))
    text = json.dumps(document, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    binary = document["buffers"][0]["byteLength"]
    with atomic_path(path) as partial, partial.open("wb") as file:
        file.write(struct.pack("<4sII", b"glTF", 2, 28 + len(text) + binary))
        file.write(struct.pack("<II", len(text), 0x4E4F534A) + text + struct.pack("<II", binary, 0x004E4942))
        indices = _indices().tobytes()
        for body in _bodies(meshes, seed):
            file.write(indices + b"".join(part.tobytes() for part in body))
    return placed * MESH_TRIANGLES
