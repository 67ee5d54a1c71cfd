"""Write a glTF scene of many textures: columns on a square, each with images of its own, JPEG and PNG of 64 to 1024 texels a side.

    python -m lab.benchmarks.many_textures.generate FOLDER --textures 10000 [--seed 0]

Four of five images are base colours; the others are the normal maps of every fourth material. Equal arguments give equal files.
"""

import argparse
import json
import math
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import OpenImageIO
from numpy.typing import NDArray

from ntc.io import write_bytes, write_text
from viewer.scene.images import write_image

SIDES = (64, 128, 256, 512, 1024)
PATTERNS = 6
"""Of each size; images are these, moved and tinted."""
PNG_SHARE = 0.3
SPACING = 3.0
"""Scene units from one column to the next."""
FACES = (((0, 0, 1), (1, 0, 0)), ((0, 0, -1), (-1, 0, 0)), ((1, 0, 0), (0, 0, -1)), ((-1, 0, 0), (0, 0, 1)))
"""(normal, direction of u) of a column's sides; v runs down."""


def _pattern(side: int, seed: int) -> NDArray[np.float32]:
    """[side, side, 3] float32 that repeats: waves of four octaves, and a little noise."""
    rng = np.random.default_rng([side, seed])
    y, x = np.mgrid[0:side, 0:side].astype(np.float32) * np.float32(2.0 * math.pi / side)
    picture = np.full((side, side, 3), 128.0, np.float32)
    for octave in range(4):
        for channel in range(3):
            u, v = rng.integers(-3, 4, 2) * 2**octave
            picture[..., channel] += 45.0 * 0.6**octave * np.sin(u * x + v * y + np.float32(rng.uniform(0, 6)))
    return picture + rng.normal(0.0, 2.0, picture.shape).astype(np.float32)


def _normals(heights: NDArray[np.float32]) -> NDArray[np.uint8]:
    """[H, W, 3] uint8 of a tangent-space normal map of the relief `heights` [H, W]."""
    slopes = [(np.roll(heights, -1, axis) - np.roll(heights, 1, axis)) * 0.02 for axis in (1, 0)]
    vectors = np.dstack([-slopes[0], -slopes[1], np.ones_like(heights)])
    vectors /= np.linalg.norm(vectors, axis=2, keepdims=True)
    return np.asarray(vectors * 127.5 + 128.0, np.uint8)


def _write(path: Path, pixels: NDArray[np.uint8]) -> None:
    spec = OpenImageIO.ImageSpec(pixels.shape[1], pixels.shape[0], 3, "uint8")
    spec.attribute("CompressionQuality", 85)
    spec.attribute("png:compressionLevel", 1)
    write_image(path, np.ascontiguousarray(pixels), spec)


def _images(folder: Path, count: int, seed: int) -> list[str]:
    """Names of the images, written into `folder`; every fifth is a normal map, of the size of the image before it."""
    rng = np.random.default_rng(seed)
    patterns = {side: [_pattern(side, number) for number in range(PATTERNS)] for side in SIDES}
    (folder / "images").mkdir(parents=True, exist_ok=True)
    jobs = []
    side = SIDES[0]
    for number in range(count):
        is_normal = number % 5 == 4
        side = side if is_normal else int(rng.choice(SIDES))
        suffix = ".png" if is_normal or rng.random() < PNG_SHARE else ".jpg"
        moved, tint = rng.integers(0, side, 2), rng.uniform(0.5, 1.4, 3).astype(np.float32)
        jobs.append((f"images/{number:05}{suffix}", side, int(rng.integers(PATTERNS)), moved, tint, is_normal))

    def make(job: tuple[str, int, int, NDArray[np.int64], NDArray[np.float32], bool]) -> str:
        name, side, number, moved, tint, is_normal = job
        picture = np.roll(patterns[side][number], moved.tolist(), axis=(0, 1))
        pixels = _normals(picture[..., 0]) if is_normal else np.clip(picture * tint, 0, 255).astype(np.uint8)
        _write(folder / name, pixels)
        return name

    with ThreadPoolExecutor() as pool:
        return list(pool.map(make, jobs))


def _column() -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.float32], NDArray[np.uint16]]:
    """(positions, normals, uvs, indices) of the four sides of a column of 1 x 2 x 1 units on the ground."""
    positions, normals, uvs, indices = [], [], [], []
    for number, (normal, right) in enumerate(FACES):
        for u, v in ((0, 0), (0, 1), (1, 1), (1, 0)):
            x, z = (0.5 * normal[axis] + (u - 0.5) * right[axis] for axis in (0, 2))
            positions.append((x, 2.0 * (1 - v), z))
            normals.append(normal)
            uvs.append((u, 2 * v))
        indices += [4 * number + corner for corner in (0, 1, 2, 0, 2, 3)]
    return np.array(positions, "<f4"), np.array(normals, "<f4"), np.array(uvs, "<f4"), np.array(indices, "<u2")


def write_scene(folder: Path, textures: int, seed: int = 0) -> Path:
    """The .gltf file of a scene of `textures` images in `folder`."""
    names = _images(folder, textures, seed)
    parts: tuple[NDArray[Any], ...] = _column()
    write_bytes(folder / "scene.bin", b"".join(part.tobytes() for part in parts))
    offsets = np.cumsum([0, *(part.nbytes for part in parts)]).tolist()
    kinds = ("VEC3", "VEC3", "VEC2", "SCALAR")
    accessors: list[dict[str, Any]] = [
        {"bufferView": view, "componentType": 5123 if view == 3 else 5126, "count": len(part), "type": kind}
        for view, (part, kind) in enumerate(zip(parts, kinds, strict=True))
    ]
    accessors[0] |= {"min": parts[0].min(axis=0).tolist(), "max": parts[0].max(axis=0).tolist()}
    materials: list[dict[str, Any]] = []
    for number in range(textures):
        if number % 5 == 4:
            materials[-1]["normalTexture"] = {"index": number}
        else:
            pbr = {"baseColorTexture": {"index": number}, "metallicFactor": 0.0, "roughnessFactor": 0.7}
            materials.append({"name": f"material {number}", "pbrMetallicRoughness": pbr})
    attributes = {"POSITION": 0, "NORMAL": 1, "TEXCOORD_0": 2}
    meshes = [
        {"primitives": [{"attributes": attributes, "indices": 3, "material": number}]}
        for number in range(len(materials))
    ]
    rows = math.ceil(math.sqrt(len(meshes)))
    middle = SPACING * (rows - 1) / 2.0
    nodes: list[dict[str, Any]] = [
        {"mesh": number, "translation": [SPACING * (number % rows) - middle, 0.0, middle - SPACING * (number // rows)]}
        for number in range(len(meshes))
    ]
    document = {
        "asset": {"version": "2.0", "generator": "lab.benchmarks.many_textures.generate"},
        "scene": 0,
        "scenes": [{"nodes": list(range(len(nodes)))}],
        "nodes": nodes,
        "meshes": meshes,
        "materials": materials,
        "textures": [{"source": number} for number in range(textures)],
        "images": [{"uri": name} for name in names],
        "accessors": accessors,
        "bufferViews": [
            {"buffer": 0, "byteOffset": offsets[view], "byteLength": part.nbytes} for view, part in enumerate(parts)
        ],
        "buffers": [{"uri": "scene.bin", "byteLength": offsets[-1]}],
    }
    path = folder / "scene.gltf"
    write_text(path, json.dumps(document))
    cameras = [
        {"name": "street", "eye": [SPACING / 2, 1.6, middle + 2.0], "target": [SPACING / 2, 1.2, 0.0], "fov": 60.0},
        {"name": "above", "eye": [0.0, 1.3 * middle + 5.0, 1.6 * middle + 5.0], "target": [0.0, 0.0, 0.0], "fov": 60.0},
    ]
    write_text(folder / "scene.cameras.json", json.dumps(cameras, indent=1) + "\n")
    return path


def main() -> None:
    """Write a scene."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--textures", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    print(write_scene(options.folder, options.textures, options.seed))


if __name__ == "__main__":
    main()
