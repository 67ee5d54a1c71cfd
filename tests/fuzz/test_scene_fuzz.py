"""Damaged scene files load or raise InputError: never another exception, never for long, never with a huge array."""

import copy
import json
import math
import random
from collections.abc import Iterator
from dataclasses import asdict
from typing import Any

import numpy as np

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
    builder.json["extensionsUsed"] = ["KHR_texture_transform", "EXT_mesh_gpu_instancing", "KHR_lights_punctual"]
    image, cut = builder.image(png(noise(8, 8))), builder.image(png(noise(8, 8, 4)), extras={"category": "leaf"})
    sampler = builder.add("samplers", wrapS=33071, minFilter=9729)
    transform = {"KHR_texture_transform": {"offset": [0.5, 0], "rotation": 1.0, "scale": [2, 2], "texCoord": 1}}
    first = builder.material(image, info={"extensions": transform}, pbr={"baseColorFactor": [1, 1, 0, 1]})
    second = builder.material(cut, alphaMode="MASK", doubleSided=True, emissiveFactor=[1, 0, 0])
    builder.json["textures"][1]["sampler"] = sampler
    glossiness = {"diffuseTexture": {"index": 0}, "diffuseFactor": [1, 1, 1, 1]}
    third = builder.material(extensions={"KHR_materials_pbrSpecularGlossiness": glossiness, "KHR_materials_unlit": {}})
    frames = {"NORMAL": np.eye(3, dtype=np.float32), "TANGENT": np.ones((3, 4), np.float32)}
    plain = builder.triangle(first, TEXCOORD_1=np.ones((3, 2), np.float32), COLOR_0=np.ones((3, 4), np.uint8), **frames)
    packed = builder.add("textures", source=builder.image(png(noise(4, 8, seed=2))))
    bump = builder.add("textures", source=builder.image(png(noise(8, 8, seed=3))), sampler=sampler)
    turned = {"KHR_texture_transform": {"offset": [0, 0.5], "rotation": -1.0, "scale": [0.5, 3]}}
    builder.json["materials"][first] |= {
        "normalTexture": {"index": bump, "scale": 0.5, "texCoord": 1},
        "occlusionTexture": {"index": packed, "strength": 0.5},
        "emissiveTexture": {"index": 0, "extensions": turned},
        "emissiveFactor": [1, 0.5, 0],
        "extensions": {
            "KHR_materials_emissive_strength": {"emissiveStrength": 3},
            "KHR_materials_ior": {"ior": 1.4},
            "KHR_materials_specular": {"specularFactor": 0.5, "specularColorFactor": [1, 1, 2]},
            "KHR_materials_clearcoat": {"clearcoatFactor": 0.5, "clearcoatRoughnessFactor": 0.1},
            "KHR_materials_transmission": {"transmissionFactor": 0.5},
        },
    }
    builder.json["materials"][first]["pbrMetallicRoughness"] |= {
        "metallicRoughnessTexture": {"index": packed, "texCoord": 1},
        "roughnessFactor": 0.5,
        "metallicFactor": 0.75,
    }
    lights = [{"type": "directional"}, {"type": "spot", "color": [1, 1, 0], "intensity": 9, "range": 4, "spot": {}}]
    builder.json["extensions"] = {"KHR_lights_punctual": {"lights": lights}}
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
    shines = {"KHR_lights_punctual": {"light": 1}}
    builder.add("nodes", mesh=mesh, extensions=shines, rotation=[0, math.sin(1), 0, math.cos(1)])
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
    for name in ("normals", "tangents", "second_uvs"):
        values = getattr(geometry, name)
        assert values is None or (len(values) == len(geometry.positions) and np.isfinite(values).all())
    for material in scene.materials:
        assert -1 <= material.texture_id < len(scene.textures)
        check_numbers(asdict(material.factors))
        for plane in (material.surface, material.emission):
            if plane is not None:
                assert set(plane.maps) <= set(scene.textures[plane.texture_id].maps)
                check_numbers(plane.uv_transform)
                assert not plane.second_uvs or geometry.second_uvs is not None
    for texture in scene.textures:
        sizes = {texture.pixels.shape[:2], *(pixels.shape[:2] for pixels in texture.further_maps.values())}
        assert len(sizes) == 1
    for light in scene.lights:
        check_numbers([light.color, light.position, light.direction, light.reach, light.inner_cone, light.outer_cone])


def check_numbers(value: Any) -> None:
    """Every number in `value` fits into single precision."""
    if isinstance(value, float):
        assert abs(value) < 3e38
    elif isinstance(value, dict | list | tuple):
        for child in value.values() if isinstance(value, dict) else value:
            check_numbers(child)


def places(value: Any) -> Iterator[tuple[Any, Any]]:
    """(container, key) of every value in a JSON tree."""
    for key, child in value.items() if isinstance(value, dict) else enumerate(value):
        yield value, key
        if isinstance(child, dict | list):
            yield from places(child)


def test_every_field_removed_and_replaced() -> None:
    builder = rich_builder()
    original = builder.json
    chooser = random.Random(0)
    loaded = 0
    for number in range(len(list(places(original)))):
        for value in (..., *chooser.sample(VALUES, 2)):
            builder.json = copy.deepcopy(original)
            owner, key = list(places(builder.json))[number]
            if value is ...:
                del owner[key]
            else:
                owner[key] = value
            loaded += loads_or_refuses(builder.glb())
    assert loaded > 0


def test_truncated_files() -> None:
    data = rich_builder().glb()
    assert loads_or_refuses(data)
    chooser = random.Random(1)
    for length in [*range(0, 64), *chooser.sample(range(64, len(data)), 200)]:
        assert not loads_or_refuses(data[:length])


def test_changed_bytes() -> None:
    data = rich_builder().glb()
    chooser = random.Random(0)
    for _ in range(150):
        changed = bytearray(data)
        for _ in range(chooser.choice((1, 2, 8, 64))):
            changed[chooser.randrange(12, len(changed))] = chooser.randrange(256)
        loads_or_refuses(bytes(changed))


def test_changed_json_text() -> None:
    text = json.dumps(rich_builder().json).encode()
    chooser = random.Random(5)
    for _ in range(200):
        changed = bytearray(text)
        for _ in range(chooser.choice((1, 3, 10))):
            start = chooser.randrange(len(changed))
            changed[start : start + chooser.randrange(4)] = chooser.choice((b"", b"{", b"]", b"9", b'"', b"\xff", b","))
        loads_or_refuses(bytes(changed))
