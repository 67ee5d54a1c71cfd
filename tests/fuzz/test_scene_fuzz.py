"""Damaged scene files load or raise InputError: never another exception, never for long, never with a huge array."""

import copy
import json
import math
import random
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from ntc.errors import InputError
from tests.support.gltf_builder import GltfBuilder, noise, png
from viewer.scene.gltf.container import parse_gltf
from viewer.scene.load import build_scene
from viewer.scene.model import Scene
from viewer.scene.report import report_json, report_lines

VALUES: tuple[Any, ...] = (
    None, True, False, -1, 0, 1, 2, 3, 5, 255, 5121, 5126, 2**31, 2**63, 10**400, 0.5, -0.0, 1e38, 1e300, float("nan"),
    float("inf"), "", "x", "VEC3", "SCALAR", "MAT4", "data:,", "data:;base64,AAAA", "../..", "\ud800", "a\0b", [], {},
    [0], [[]], [0, 0], [1, 0, 0, 0], [1e30, 1e30, 1e30], {"index": 0}, {"extensions": {}}, {"KHR_texture_transform": 0},
)  # fmt: skip
"""What a field is replaced by."""


def rich_builder() -> GltfBuilder:
    """A file that uses nearly everything that is read."""
    builder = GltfBuilder()
    builder.json["extensionsUsed"] = ["KHR_texture_transform", "EXT_mesh_gpu_instancing"]
    image, cut = builder.image(png(noise(8, 8))), builder.image(png(noise(8, 8, 4)), extras={"category": "leaf"})
    sampler = builder.add("samplers", wrapS=33071, minFilter=9729)
    transform = {"KHR_texture_transform": {"offset": [0.5, 0], "rotation": 1.0, "scale": [2, 2], "texCoord": 1}}
    first = builder.material(image, info={"extensions": transform}, pbr={"baseColorFactor": [1, 1, 0, 1]})
    second = builder.material(cut, alphaMode="MASK", doubleSided=True, emissiveFactor=[1, 0, 0])
    builder.json["textures"][1]["sampler"] = sampler
    glossiness = {"diffuseTexture": {"index": 0}, "diffuseFactor": [1, 1, 1, 1]}
    third = builder.material(extensions={"KHR_materials_pbrSpecularGlossiness": glossiness, "KHR_materials_unlit": {}})
    plain = builder.triangle(first, TEXCOORD_1=np.ones((3, 2), np.float32), COLOR_0=np.ones((3, 4), np.uint8))
    strip = {**builder.triangle(second), "indices": builder.accessor(np.array([0, 1, 2, 1], np.uint16)), "mode": 5}
    sparse = builder.triangle(third)
    builder.json["accessors"][sparse["attributes"]["POSITION"]]["sparse"] = {
        "count": 1,
        "indices": {"bufferView": builder.view(b"\x01"), "componentType": 5121},
        "values": {"bufferView": builder.view(bytes(12))},
    }
    mesh = builder.mesh(plain, strip, sparse, name="mesh")
    moves = {"TRANSLATION": builder.accessor(np.eye(3, dtype=np.float32))}
    lens = builder.add("cameras", type="perspective", perspective={"yfov": 1.0, "znear": 0.1})
    flat = builder.add("cameras", type="orthographic", orthographic={"xmag": 1, "ymag": 1, "znear": 0.1, "zfar": 9})
    builder.add("nodes", name="root", children=[1, 2, 3], scale=[2, 2, 2])
    builder.add("nodes", mesh=mesh, rotation=[0, math.sin(1), 0, math.cos(1)])
    builder.add("nodes", mesh=mesh, extensions={"EXT_mesh_gpu_instancing": {"attributes": moves}})
    builder.add("nodes", camera=lens, children=[4])
    builder.add("nodes", camera=flat, matrix=[float(value) for value in np.eye(4).reshape(-1)])
    builder.add("scenes", nodes=[0])
    builder.json["scene"] = 0
    return builder


def loads_or_refuses(data: bytes) -> bool:
    """Whether `data` loads; False for InputError. Anything else fails the test."""
    try:
        scene = build_scene(parse_gltf(data, "fuzz.glb", None), "fuzz", None)
    except InputError as error:
        message = str(error)
    else:
        check_scene(scene)
        return True
    assert "\n" not in message
    message.encode()
    return False


def check_scene(scene: Scene) -> None:
    """Every number in range, every report printable."""
    json.dumps(report_json(scene))
    "\n".join(report_lines(scene)).encode()
    geometry = scene.geometry
    assert np.isfinite(geometry.positions).all()
    assert np.isfinite(geometry.uvs).all()
    assert np.isfinite(scene.bounds).all()
    assert np.isfinite(scene.instances.transform).all()
    for primitive in scene.primitives:
        indices = geometry.indices[primitive.first_index : primitive.first_index + primitive.index_count]
        assert len(indices) == primitive.index_count
        assert indices.max() < primitive.vertex_count
        assert primitive.base_vertex + primitive.vertex_count <= len(geometry.positions)
        assert 0 <= primitive.material < len(scene.materials)
    assert all(-1 <= material.texture_id < len(scene.textures) for material in scene.materials)


def places(value: Any) -> Iterator[tuple[Any, Any]]:
    """(container, key) of every value in a JSON tree."""
    for key, child in value.items() if isinstance(value, dict) else enumerate(value):
        yield value, key
        if isinstance(child, dict | list):
            yield from places(child)


def test_the_undamaged_file_loads() -> None:
    assert loads_or_refuses(rich_builder().glb())


def test_every_field_replaced_by_every_value() -> None:
    builder = rich_builder()
    original = builder.json
    chooser = random.Random(0)
    loaded = 0
    count = len(list(places(original)))
    for number in range(count):
        for value in chooser.sample(VALUES, 6):
            builder.json = copy.deepcopy(original)
            owner, key = list(places(builder.json))[number]
            owner[key] = value
            loaded += loads_or_refuses(builder.glb())
    assert loaded > 0


def test_every_field_removed() -> None:
    builder = rich_builder()
    original = builder.json
    for number in range(len(list(places(original)))):
        builder.json = copy.deepcopy(original)
        owner, key = list(places(builder.json))[number]
        del owner[key]
        loads_or_refuses(builder.glb())


def test_truncated_files() -> None:
    data = rich_builder().glb()
    chooser = random.Random(1)
    for length in [*range(0, 64), *chooser.sample(range(64, len(data)), 200)]:
        assert not loads_or_refuses(data[:length])


@pytest.mark.parametrize("seed", range(4))
def test_changed_bytes(seed: int) -> None:
    data = rich_builder().glb()
    chooser = random.Random(seed)
    for _ in range(150):
        changed = bytearray(data)
        for _ in range(chooser.choice((1, 2, 8, 64))):
            changed[chooser.randrange(12, len(changed))] = chooser.randrange(256)
        loads_or_refuses(bytes(changed))


def test_changed_json_text() -> None:
    text = json.dumps(rich_builder().json).encode()
    chooser = random.Random(5)
    for _ in range(300):
        changed = bytearray(text)
        for _ in range(chooser.choice((1, 3, 10))):
            start = chooser.randrange(len(changed))
            changed[start : start + chooser.randrange(4)] = chooser.choice((b"", b"{", b"]", b"9", b'"', b"\xff", b","))
        loads_or_refuses(bytes(changed))
