"""Inputs of recorded runs, written without the code under test: textures, a small scene of them, cameras, bad files."""

import base64
import json
import struct
import zlib
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lab.benchmarks.behaviour.program import Program


def png(pixels: NDArray[np.uint8]) -> bytes:
    """A PNG file of `pixels` [H, W, 3 or 4], written without the code under test."""
    height, width, channels = pixels.shape

    def chunk(name: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))

    header = struct.pack(">IIBBBBB", width, height, 8, {3: 2, 4: 6}[channels], 0, 0, 0)
    rows = b"".join(b"\0" + row.tobytes() for row in pixels)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b"")


def pattern(number: int) -> NDArray[np.uint8]:
    """[H, W, 3 or 4] a texture of waves, checks and noise, another one for each number."""
    width, height = ((64, 64), (32, 64), (64, 32), (48, 40), (32, 32), (64, 48))[number % 6]
    random = np.random.default_rng(number)
    y, x = np.mgrid[0:height, 0:width]
    waves = np.stack([128 + 90 * np.sin(x / (3 + c + number) + y / (5 + number - c)) for c in range(3)], axis=-1)
    checks = ((x // 8 + y // (4 + number)) % 2 * 60)[..., None]
    pixels: NDArray[np.uint8] = np.clip(waves + checks + random.normal(0, 12, waves.shape), 0, 255).astype(np.uint8)
    if number == 3:
        alpha = np.where((x - 24) ** 2 + (y - 20) ** 2 < 300, 255, 0).astype(np.uint8)
        return np.concatenate([pixels, alpha[..., None]], axis=-1)
    return pixels


def small_scene(colours: Sequence[str]) -> dict[str, Any]:
    """A glTF of one square shown with every texture and one colour, masked, tiled, tinted, transformed, and a camera."""
    corners = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], np.float32)
    uvs = np.array([[0, 1], [1, 1], [1, 0], [0, 0]], np.float32)
    data = corners.tobytes() + uvs.tobytes() + np.array([0, 1, 2, 0, 2, 3], np.uint16).tobytes()
    views = ((0, 48), (48, 32), (80, 12))
    materials: list[dict[str, Any]] = [
        {"name": name, "pbrMetallicRoughness": {"baseColorTexture": {"index": number}}}
        for number, name in enumerate(colours)
    ]
    materials[1]["pbrMetallicRoughness"]["baseColorFactor"] = [0.9, 0.5, 0.3, 1.0]
    tiled = {"KHR_texture_transform": {"scale": [3, 2], "offset": [0.1, 0.2], "rotation": 0.3}}
    materials[2]["pbrMetallicRoughness"]["baseColorTexture"]["extensions"] = tiled
    materials[3] |= {"alphaMode": "MASK", "alphaCutoff": 0.5, "doubleSided": True}
    materials[4] |= {"alphaMode": "BLEND"}
    materials[4]["pbrMetallicRoughness"]["baseColorFactor"] = [1.0, 1.0, 1.0, 0.6]
    materials.append({"name": "plain", "pbrMetallicRoughness": {"baseColorFactor": [0.2, 0.4, 0.6, 1.0]}})
    square = {"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "indices": 2}
    places = [[2.2 * (number % 4) - 3.3, 2.2 * (number // 4) - 1.1, -0.4 * number] for number in range(len(materials))]
    nodes: list[dict[str, Any]] = [
        {"name": f"square {number}", "mesh": number, "translation": place, "rotation": [0, 0.1305, 0, 0.9914]}
        for number, place in enumerate(places)
    ]
    nodes.append({"name": "front", "camera": 0, "translation": [0, 0, 7]})
    nodes.append({"name": "side", "camera": 0, "translation": [5, 1, 3], "rotation": [0, 0.5, 0, 0.866]})
    return {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": list(range(len(nodes)))}],
        "nodes": nodes,
        "cameras": [{"type": "perspective", "perspective": {"yfov": 0.8, "znear": 0.1, "zfar": 50.0}}],
        "meshes": [{"primitives": [{**square, "material": number}]} for number in range(len(materials))],
        "materials": materials,
        "textures": [{"source": number, "sampler": number % 2} for number in range(len(colours))],
        "samplers": [{}, {"wrapS": 33648, "wrapT": 33071}],
        "images": [{"uri": f"{name}.png", "name": name} for name in colours],
        "extensionsUsed": ["KHR_texture_transform"],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3", "min": [-1, -1, 0], "max": [1, 1, 0]},
            {"bufferView": 1, "componentType": 5126, "count": 4, "type": "VEC2"},
            {"bufferView": 2, "componentType": 5123, "count": 6, "type": "SCALAR"},
        ],
        "bufferViews": [{"buffer": 0, "byteOffset": start, "byteLength": length} for start, length in views],
        "buffers": [
            {"byteLength": len(data), "uri": "data:application/octet-stream;base64," + base64.b64encode(data).decode()}
        ],
    }


def make_inputs(program: Program) -> None:
    """Textures by kind, a small scene of them, cameras, bad files, and a link to the files of the built-in scene."""
    names = [f"{kind}_{number}" for number, kind in enumerate(("wood", "stone", "wood", "fabric", "stone", "metal"))]
    for folder in ("textures", "scene", "alone", "bad"):
        (program.work / folder).mkdir()
    for number, name in enumerate(names):
        data = png(pattern(number))
        file = program.work / "textures" / name.split("_")[0] / f"{name}.png"
        file.parent.mkdir(exist_ok=True)
        file.write_bytes(data)
        for folder in ("scene", "alone"):
            (program.work / folder / f"{name}.png").write_bytes(data)
    scene = json.dumps(small_scene(names))
    for folder in ("scene", "alone"):
        (program.work / folder / "small.gltf").write_text(scene)
    path = [{"name": f"p{n}", "eye": [n - 1.0, 0.5, 8.0], "target": [0, 0, 0], "fov": 50.0} for n in range(3)]
    (program.work / "path.json").write_text(json.dumps(path))
    bad = program.work / "bad"
    (bad / "words.ntc").write_text("not a pack at all, only words" * 3)
    (bad / "empty.glb").write_bytes(b"")
    (bad / "torn.gltf").write_text(scene[:-200])
    (bad / "needs.gltf").write_text(
        json.dumps({**json.loads(scene), "extensionsRequired": ["EXT_meshopt_compression"]})
    )
    counts = json.loads(scene)
    counts["accessors"][0]["count"] = 10**9
    (bad / "counts.gltf").write_text(json.dumps(counts))
    (bad / "cameras.json").write_text('[{"name": "a"}]')
    (bad / "wrong.json").write_text('{"slots": {"a": {"path": "sideways"}}}')
    # Where the checkout keeps them may change; nearest to its root first.
    found = sorted(program.repository.rglob("courtyard.glb"), key=lambda file: len(file.parts))
    (program.work / "builtin").symlink_to(found[0].parent)
