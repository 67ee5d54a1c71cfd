"""Component types, normalisation, strides, sparse accessors, bounds."""

import numpy as np
import pytest

from ntc.errors import InputError
from tests.support.gltf_builder import TRIANGLE, GltfBuilder
from viewer.scene.gltf.accessors import Accessors
from viewer.scene.gltf.buffers import Buffers
from viewer.scene.gltf.container import parse_gltf


def accessors(builder: GltfBuilder) -> Accessors:
    file = parse_gltf(builder.glb(), "test.glb", None)
    return Accessors(file, Buffers(file))


@pytest.mark.parametrize("dtype", ["int8", "uint8", "int16", "uint16", "uint32", "float32"])
@pytest.mark.parametrize(("stride", "offset"), [(0, 0), (24, 0), (0, 8), (32, 4)])
def test_every_component_type_stride_and_offset(dtype: str, stride: int, offset: int) -> None:
    values = np.arange(15).reshape(5, 3).astype(dtype)
    builder = GltfBuilder()
    index = builder.accessor(values, stride=stride, offset=offset)
    read = accessors(builder).raw(index, "test", ("VEC3",))
    assert read.dtype == values.dtype
    np.testing.assert_array_equal(read, values)


@pytest.mark.parametrize(
    ("dtype", "stored", "expected"),
    [
        ("uint8", [0, 51, 255], [0.0, 0.2, 1.0]),
        ("int8", [-128, -127, 127], [-1.0, -1.0, 1.0]),
        ("uint16", [0, 13107, 65535], [0.0, 0.2, 1.0]),
        ("int16", [-32768, 0, 32767], [-1.0, 0.0, 1.0]),
    ],
)
def test_normalised_integers(dtype: str, stored: list[int], expected: list[float]) -> None:
    builder = GltfBuilder()
    index = builder.accessor(np.array(stored, dtype), normalized=True)
    plain = builder.accessor(np.array(stored, dtype))
    reader = accessors(builder)
    np.testing.assert_allclose(reader.floats(index, "test", ("SCALAR",))[:, 0], expected, atol=1e-6)
    np.testing.assert_array_equal(reader.floats(plain, "test", ("SCALAR",))[:, 0], stored)


@pytest.mark.parametrize("with_base", [True, False])
def test_sparse(with_base: bool) -> None:
    base = np.arange(12, dtype=np.float32).reshape(4, 3)
    builder = GltfBuilder()
    index = builder.accessor(base)
    sparse = {
        "count": 2,
        "indices": {"bufferView": builder.view(np.array([1, 3], np.uint16).tobytes()), "componentType": 5123},
        "values": {"bufferView": builder.view(np.array([[7, 8, 9], [4, 5, 6]], np.float32).tobytes())},
    }
    builder.json["accessors"][index]["sparse"] = sparse
    if not with_base:
        del builder.json["accessors"][index]["bufferView"]
    expected = base.copy() if with_base else np.zeros_like(base)
    expected[[1, 3]] = [[7, 8, 9], [4, 5, 6]]
    np.testing.assert_array_equal(accessors(builder).raw(index, "test", ("VEC3",)), expected)


def test_padded_matrix_columns() -> None:
    builder = GltfBuilder()
    columns = np.array([[1, 2, 3, 99], [4, 5, 6, 99], [7, 8, 9, 99]], np.uint8)
    view = builder.view(columns.tobytes())
    index = builder.add("accessors", bufferView=view, componentType=5121, count=1, type="MAT3")
    np.testing.assert_array_equal(accessors(builder).raw(index, "test", ("MAT3",)), [[1, 2, 3, 4, 5, 6, 7, 8, 9]])


@pytest.mark.parametrize(
    "change",
    [
        {"count": 4},
        {"count": 10**12},
        {"count": -1},
        {"count": 1.5},
        {"byteOffset": 1},
        {"byteOffset": 2**60},
        {"bufferView": 9},
        {"bufferView": -1},
        {"componentType": 5124},
        {"type": "VEC4"},
        {"type": 3},
    ],
)
def test_out_of_range_is_an_input_error(change: dict[str, object]) -> None:
    builder = GltfBuilder()
    index = builder.accessor(TRIANGLE)
    builder.json["accessors"][index].update(change)
    with pytest.raises(InputError, match=r"test\.glb"):
        accessors(builder).raw(index, "test", ("VEC3",))


def test_count_without_bytes_is_bounded() -> None:
    builder = GltfBuilder()
    builder.view(b"abcd")
    index = builder.add("accessors", componentType=5126, count=2**40, type="VEC3")
    with pytest.raises(InputError, match="without a buffer view"):
        accessors(builder).raw(index, "test", ("VEC3",))


def test_sparse_index_out_of_range() -> None:
    builder = GltfBuilder()
    index = builder.accessor(TRIANGLE)
    builder.json["accessors"][index]["sparse"] = {
        "count": 1,
        "indices": {"bufferView": builder.view(b"\x03"), "componentType": 5121},
        "values": {"bufferView": builder.view(bytes(12))},
    }
    with pytest.raises(InputError, match="3 in an accessor of 3"):
        accessors(builder).raw(index, "test", ("VEC3",))
