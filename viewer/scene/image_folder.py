"""A folder of images as a scene: one material for each image, on a panel and on a sphere beside it."""

import json
import math
import struct
from pathlib import Path
from typing import Any, Final
from urllib.parse import quote

import numpy as np
from numpy.typing import NDArray

from viewer.scene.gltf.container import GltfFile, parse_gltf
from viewer.scene.images import folder_images

CELL: Final = (2.35, 1.2)
"""Width and height of the cell of one material: panel and sphere are 1 unit wide."""
FOV_DEGREES: Final = 40.0
MARGIN: Final = 1.25
"""Size of the camera's view, as a multiple of the size of all cells."""
ROUGHNESS: Final = 0.7
_FLOAT, _INDEX = 5126, 5125


_Shape = tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.float32], NDArray[np.uint32]]
"""Positions [V, 3], normals [V, 3], uvs [V, 2] and indices [3 T]."""


def _panel() -> _Shape:
    """Return a square of side 1 around the origin."""
    corners = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]], np.float32)
    positions = np.concatenate([corners - 0.5, np.zeros((4, 1), np.float32)], axis=1)
    normals = np.tile(np.array([0.0, 0.0, 1.0], np.float32), (4, 1))
    uvs = np.stack([corners[:, 0], 1.0 - corners[:, 1]], axis=1)
    return positions, normals, uvs, np.array([0, 1, 2, 0, 2, 3], np.uint32)


def _sphere(columns: int = 48, rows: int = 24) -> _Shape:
    """Return a sphere of diameter 1. The image repeats twice around it, which keeps its aspect at the equator."""
    v, u = np.meshgrid(np.linspace(0.0, 1.0, rows + 1), np.linspace(0.0, 1.0, columns + 1), indexing="ij")
    turn, down = 2.0 * np.pi * u, np.pi * v
    places = np.stack([np.sin(down) * np.sin(turn), np.cos(down), np.sin(down) * np.cos(turn)], axis=-1)
    normals = places.reshape(-1, 3).astype(np.float32)
    first = (np.arange(rows)[:, None] * (columns + 1) + np.arange(columns)).reshape(-1, 1)
    below = first + columns + 1
    indices = np.concatenate([first, below, below + 1, first, below + 1, first + 1], axis=1).reshape(-1)
    uvs = np.stack([2.0 * u, v], axis=-1).reshape(-1, 2)
    return normals / 2.0, normals, uvs.astype(np.float32), indices.astype(np.uint32)


def folder_gltf(folder: Path) -> GltfFile:
    """Return a glTF container that shows the images in `folder` and its sub-folders, each as the base colour of a material.

    Materials, names and categories are those of `viewer.scene.images.folder_textures`, so packs of the folder fit. Raises
    InputError where there are no images.
    """
    paths = [path.relative_to(folder) for path in folder_images(folder)]
    binary = bytearray()
    views: list[dict[str, Any]] = []
    accessors: list[dict[str, Any]] = []
    attributes: list[dict[str, Any]] = []
    for shape in (_panel(), _sphere()):
        first = len(accessors)
        for values, kind in zip(shape, ("VEC3", "VEC3", "VEC2", "SCALAR"), strict=True):
            views.append({"buffer": 0, "byteOffset": len(binary), "byteLength": values.nbytes})
            binary += values.tobytes()
            entry: dict[str, Any] = {"bufferView": len(views) - 1, "count": len(values), "type": kind}
            entry["componentType"] = _INDEX if kind == "SCALAR" else _FLOAT
            if kind == "VEC3":
                entry |= {"min": values.min(axis=0).tolist(), "max": values.max(axis=0).tolist()}
            accessors.append(entry)
        vertex = {"POSITION": first, "NORMAL": first + 1, "TEXCOORD_0": first + 2}
        attributes.append({"attributes": vertex, "indices": first + 3})
    columns = max(1, round(math.sqrt(len(paths) * CELL[1] / CELL[0] * 16.0 / 9.0)))
    rows = -(-len(paths) // columns)
    nodes: list[dict[str, Any]] = []
    for number in range(len(paths)):
        x, y = (number % columns) * CELL[0], -(number // columns) * CELL[1]
        nodes += [{"mesh": 2 * number, "translation": [x, y, 0.0]}]
        nodes += [{"mesh": 2 * number + 1, "translation": [x + CELL[0] / 2.0 - 0.05, y, 0.0]}]
    height = max(rows * CELL[1], columns * CELL[0] * 9.0 / 16.0) * MARGIN
    distance = height / 2.0 / math.tan(math.radians(FOV_DEGREES) / 2.0) + 0.5
    middle = [((columns - 1) * CELL[0] + CELL[0] / 2.0) / 2.0, -(rows - 1) * CELL[1] / 2.0, distance]
    nodes.append({"camera": 0, "translation": middle, "name": "all images"})
    names = [path.with_suffix("").as_posix() for path in paths]
    content = {
        "asset": {"version": "2.0"},
        "scenes": [{"nodes": list(range(len(nodes)))}],
        "nodes": nodes,
        "cameras": [{"type": "perspective", "perspective": {"yfov": math.radians(FOV_DEGREES), "znear": 0.01}}],
        "images": [
            {"uri": quote(path.as_posix()), "name": name, "extras": {"category": path.parent.name}}
            for path, name in zip(paths, names, strict=True)
        ],
        "textures": [{"source": number} for number in range(len(paths))],
        "materials": [
            {
                "name": name,
                # MASK, because packs of the folder hold alpha; the cutoff of 0 removes nothing.
                "alphaMode": "MASK",
                "alphaCutoff": 0.0,
                "pbrMetallicRoughness": {
                    "baseColorTexture": {"index": number},
                    "metallicFactor": 0.0,
                    "roughnessFactor": ROUGHNESS,
                },
            }
            for number, name in enumerate(names)
        ],
        "meshes": [
            {"name": f"{name} {shape}", "primitives": [{**attributes[kind], "material": number}]}
            for number, name in enumerate(names)
            for kind, shape in enumerate(("panel", "sphere"))
        ],
        "accessors": accessors,
        "bufferViews": views,
        "buffers": [{"byteLength": len(binary)}],
    }
    return parse_gltf(_glb(json.dumps(content).encode(), bytes(binary)), str(folder), folder)


def _glb(content: bytes, binary: bytes) -> bytes:
    chunks = ((b"JSON", content + b" " * (-len(content) % 4)), (b"BIN\0", binary + b"\0" * (-len(binary) % 4)))
    body = b"".join(struct.pack("<I4s", len(data), kind) + data for kind, data in chunks)
    return struct.pack("<4sII", b"glTF", 2, 12 + len(body)) + body
