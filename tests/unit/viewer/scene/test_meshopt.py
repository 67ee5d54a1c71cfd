"""Buffer views compressed by meshoptimizer give what the plain ones do; hostile ones are refused before memory is taken."""

import tracemalloc
from pathlib import Path
from typing import Any

import meshopt
import numpy as np
import pytest
from numpy.typing import NDArray

from ntc.errors import InputError
from tests.support.gltf_builder import TRIANGLE_UVS, GltfBuilder
from tests.support.meshopt_twins import compressed_view, meshopt_twin
from viewer.locations import builtin_scene_path
from viewer.scene.gltf.buffers import Buffers
from viewer.scene.gltf.container import parse_gltf
from viewer.scene.load import build_scene, load_scene
from viewer.scene.model import Scene

NAMES = ("EXT_meshopt_compression", "KHR_meshopt_compression")
SMALL_FILE_BYTES = 1 << 20


def view_of(
    values: NDArray[Any], mode: str, filtered: str = "NONE", version: int = 0, changed: dict[str, Any] | None = None
) -> GltfBuilder:
    """A file with one buffer view, number 1, compressed; `changed` replaces fields of the extension."""
    builder = GltfBuilder()
    data, extension = compressed_view(values, mode, filtered, version)
    builder.view(data)
    extension |= {"buffer": 0, "byteOffset": 0, **(changed or {})}
    length = extension["count"] * extension["byteStride"]
    builder.add("bufferViews", buffer=0, byteLength=length, extensions={NAMES[0]: extension})
    return builder


def decoded(builder: GltfBuilder) -> NDArray[np.uint8]:
    file = parse_gltf(builder.glb(), "twin.glb", None)
    return Buffers(file).view(1, "accessors[0].bufferView")[0]


def same_geometry(a: Scene, b: Scene) -> None:
    np.testing.assert_array_equal(a.geometry.positions, b.geometry.positions)
    np.testing.assert_array_equal(a.geometry.uvs, b.geometry.uvs)
    np.testing.assert_array_equal(a.geometry.normals, b.geometry.normals)
    # The codec of triangles keeps their winding and may start them at another corner.
    first, second = (scene.geometry.indices.reshape(-1, 3) for scene in (a, b))
    for turns in (first, second):
        for number in (1, 2):
            smaller = np.roll(turns, number, axis=1)[:, 0] < turns[:, 0]
            turns[smaller] = np.roll(turns[smaller], number, axis=1)
    np.testing.assert_array_equal(first, second)


@pytest.mark.parametrize(("name", "version"), [(NAMES[0], 0), (NAMES[1], 1)])
def test_a_compressed_twin_of_a_built_in_scene_is_the_same_scene(name: str, version: int, tmp_path: Path) -> None:
    plain = builtin_scene_path("gallery")
    twin = tmp_path / "twin.glb"
    twin.write_bytes(meshopt_twin(plain.read_bytes(), name, version))
    original, packed = load_scene(plain), load_scene(twin)
    same_geometry(original, packed)
    assert [t.pixel_hash for t in original.textures] == [t.pixel_hash for t in packed.textures]


@pytest.mark.parametrize("mode", ["INDICES", "TRIANGLES"])
@pytest.mark.parametrize("kind", ["<u2", "<u4"])
def test_indices_come_back(mode: str, kind: str) -> None:
    values = np.array([0, 1, 2, 2, 1, 3, 4, 2, 3], kind)
    found = decoded(view_of(values, mode)).view(kind)
    assert sorted(found.tolist()) == sorted(values.tolist())
    if mode == "INDICES":
        np.testing.assert_array_equal(found, values)


def directions(count: int = 33) -> NDArray[np.float32]:
    values = np.random.default_rng(3).normal(size=(count, 4)).astype(np.float32)
    values[:, :3] /= np.linalg.norm(values[:, :3], axis=1, keepdims=True)
    values[:, 3] = 1.0
    return values


@pytest.mark.parametrize(("stride", "kind", "step"), [(4, "<i1", 127.0), (8, "<i2", 32767.0)])
def test_octahedral_directions_come_back(stride: int, kind: str, step: float) -> None:
    values = directions()
    found = decoded(view_of(meshopt.encode_filter_oct(values, stride, 8), "ATTRIBUTES", "OCTAHEDRAL")).view(kind)
    np.testing.assert_allclose(found.reshape(-1, 4)[:, :3] / step, values[:, :3], atol=2e-2)


def test_quaternions_come_back_up_to_their_sign() -> None:
    values = np.random.default_rng(4).normal(size=(20, 4)).astype(np.float32)
    values /= np.linalg.norm(values, axis=1, keepdims=True)
    found = decoded(view_of(meshopt.encode_filter_quat(values, 8, 16), "ATTRIBUTES", "QUATERNION")).view("<i2")
    np.testing.assert_allclose(np.abs((found.reshape(-1, 4) / 32767.0 * values).sum(axis=1)), 1.0, atol=1e-3)


def test_exponents_come_back() -> None:
    values = np.random.default_rng(5).normal(size=(20, 3)).astype(np.float32) * 40
    found = decoded(view_of(meshopt.encode_filter_exp(values, 20), "ATTRIBUTES", "EXPONENTIAL")).view("<f4")
    np.testing.assert_allclose(found.reshape(-1, 3), values, atol=1e-3)


def test_colours_come_back() -> None:
    values = np.random.default_rng(6).random((20, 4)).astype(np.float32)
    found = decoded(view_of(meshopt.encode_filter_color(values, 4, 8), "ATTRIBUTES", "COLOR", 1))
    np.testing.assert_allclose(found.reshape(-1, 4) / 255.0, values, atol=2e-2)


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"count": 1 << 28}, "are more than .* bytes can encode"),
        ({"mode": "TRIANGLES", "byteStride": 4, "count": 3 << 26}, "are more than .* bytes can encode"),
        ({"mode": "INDICES", "byteStride": 4, "count": 1 << 28}, "are more than .* bytes can encode"),
        ({"byteStride": 260}, "byteStride"),
        ({"byteStride": 6}, "byteStride: 6 is not allowed with ATTRIBUTES"),
        ({"mode": "POINTS"}, "mode: Invalid enum value 'POINTS', must be one of ATTRIBUTES"),
        ({"filter": "BLUR"}, "filter: Invalid enum value 'BLUR', must be one of NONE"),
        ({"filter": "QUATERNION"}, "byteStride: 16 is not allowed"),
        ({"mode": "TRIANGLES", "byteStride": 4, "count": 4}, "4 indices are no triangles"),
        ({"mode": "TRIANGLES", "byteStride": 4, "count": 3, "filter": "COLOR"}, "filter: COLOR is not allowed"),
        ({"buffer": 7}, "is not an index below 1"),
        ({"byteOffset": 1 << 20}, "of a buffer of"),
        ({"byteLength": 5}, "does not decode"),
    ],
)
def test_hostile_views_are_refused(changed: dict[str, Any], words: str) -> None:
    builder = view_of(np.random.default_rng(0).random((64, 4)).astype(np.float32), "ATTRIBUTES", changed=changed)
    data = builder.glb()
    assert len(data) < SMALL_FILE_BYTES
    tracemalloc.start()
    try:
        with pytest.raises(InputError, match=words):
            Buffers(parse_gltf(data, "twin.glb", None)).view(1, "accessors[0].bufferView")
        assert tracemalloc.get_traced_memory()[1] < 1 << 24
    finally:
        tracemalloc.stop()


def test_a_view_longer_than_its_data_is_refused() -> None:
    builder = view_of(np.zeros((4, 4), np.float32), "ATTRIBUTES")
    builder.json["bufferViews"][1]["byteLength"] = 65
    with pytest.raises(InputError, match="64 of 65 bytes"):
        decoded(builder)


def test_many_views_of_the_same_bytes_are_bounded() -> None:
    builder = view_of(np.zeros((1 << 16, 64), np.float32), "ATTRIBUTES", version=1)
    view = builder.json["bufferViews"][1]
    builder.json["bufferViews"] += [view] * 100
    buffers = Buffers(parse_gltf(builder.glb(), "twin.glb", None))

    def read_all() -> None:
        for number in range(1, 102):
            buffers.view(number, "accessors[0].bufferView")

    with pytest.raises(InputError, match="compressed views hold more than 256 MiB"):
        read_all()


def test_accessors_read_decoded_views_with_their_stride() -> None:
    builder = GltfBuilder()
    rows = np.zeros((3, 4), np.float32)
    rows[:, :2] = TRIANGLE_UVS
    data, extension = compressed_view(rows, "ATTRIBUTES")
    extension |= {"buffer": 0, "byteOffset": 0}
    packed = builder.view(data)
    assert packed == 0
    view = builder.add(
        "bufferViews", buffer=0, byteLength=48, byteStride=16, extensions={"EXT_meshopt_compression": extension}
    )
    primitive = builder.triangle()
    primitive["attributes"]["TEXCOORD_0"] = builder.add(
        "accessors", bufferView=view, componentType=5126, count=3, type="VEC2"
    )
    scene = build_scene(parse_gltf(builder.drawn(primitive).glb(), "twin.glb", None), "twin", None)
    np.testing.assert_array_equal(scene.geometry.uvs, TRIANGLE_UVS)
