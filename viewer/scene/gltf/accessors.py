"""Accessors: typed arrays in buffers, with strides, normalised integers and sparse values."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from viewer.scene.gltf.buffers import Buffers
from viewer.scene.gltf.container import GltfFile

COMPONENT_TYPES: dict[int, np.dtype[Any]] = {
    5120: np.dtype("<i1"),
    5121: np.dtype("<u1"),
    5122: np.dtype("<i2"),
    5123: np.dtype("<u2"),
    5125: np.dtype("<u4"),
    5126: np.dtype("<f4"),
}
COMPONENTS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}
MATRIX_ROWS = {"MAT2": 2, "MAT3": 3, "MAT4": 4}

MAX_IMPLIED_VALUES = 1 << 22
"""Most values that accessors without a buffer view (all zeros) may ask for in one file: nothing else bounds them."""


def normalize(values: NDArray[Any]) -> NDArray[np.float32]:
    """Normalised integers as float32: unsigned to 0..1, signed to -1..1; floats pass."""
    if values.dtype.kind == "f":
        return values.astype(np.float32, copy=False)
    scaled = values.astype(np.float32) / np.float32(np.iinfo(values.dtype).max)
    return np.asarray(np.maximum(scaled, np.float32(-1.0)))


class Accessors:
    """Reads the accessors of one file; every count is checked against real bytes before memory is taken."""

    def __init__(self, file: GltfFile, buffers: Buffers) -> None:
        self._file = file
        self._buffers = buffers
        self._implied = 0

    def raw(self, index: object, where: str, kinds: tuple[str, ...]) -> NDArray[Any]:
        """Elements [count, components] of accessor `index` in the type stored; matrices in column order.

        `kinds` are the allowed types, e.g. ("VEC3",). Raises InputError.
        """
        return self._values(index, where, kinds)[0]

    def floats(self, index: object, where: str, kinds: tuple[str, ...]) -> NDArray[np.float32]:
        """Like `raw`, as float32, with normalised integers scaled to 0..1 or -1..1: a view of the file's bytes where those are it."""
        values, normalized = self._values(index, where, kinds)
        return normalize(values) if normalized else values.astype(np.float32, copy=False)

    def _entry(self, index: object, where: str) -> tuple[dict[str, Any], str]:
        accessors = self._file.entries("accessors")
        number = self._file.index(index, len(accessors), where)
        return accessors[number], f"accessors[{number}]"

    def _values(self, index: object, where: str, kinds: tuple[str, ...]) -> tuple[NDArray[Any], bool]:
        file = self._file
        entry, name = self._entry(index, where)
        kind = file.text(entry, "type", name)
        if kind not in kinds:
            raise file.fail(f"{name}.type", f"{kind!r:.20} where {' or '.join(kinds)} is needed (by {where})")
        dtype = self._component_type(entry, name)
        count = file.integer(entry, "count", name)
        if "bufferView" in entry:
            offset = file.integer(entry, "byteOffset", name, 0)
            values = self._elements(entry["bufferView"], f"{name}.bufferView", offset, count, kind, dtype)
        else:
            self._implied += count * COMPONENTS[kind]
            if self._implied > MAX_IMPLIED_VALUES:
                raise file.fail(f"{name}.count", f"{count} elements without a buffer view are more than is read")
            values = np.zeros((count, COMPONENTS[kind]), dtype)
        if "sparse" in entry:
            values = self._with_sparse(values, file.object(entry, "sparse", name), f"{name}.sparse", kind, dtype)
        return values, entry.get("normalized") is True

    def _component_type(self, owner: dict[str, Any], name: str) -> np.dtype[Any]:
        code = self._file.integer(owner, "componentType", name)
        if code not in COMPONENT_TYPES:
            raise self._file.fail(f"{name}.componentType", f"{code} is not a component type of glTF 2.0")
        return COMPONENT_TYPES[code]

    def _elements(
        self, view_index: object, where: str, offset: int, count: int, kind: str, dtype: np.dtype[Any]
    ) -> NDArray[Any]:
        """[count, components] view into the buffer (a copy for padded matrices). Raises InputError."""
        view, stride = self._buffers.view(view_index, where)
        size = dtype.itemsize
        # Columns of matrices start on multiples of four bytes.
        rows = MATRIX_ROWS.get(kind, COMPONENTS[kind])
        columns = COMPONENTS[kind] // rows
        column_bytes = -(-rows * size // 4) * 4 if columns > 1 else rows * size
        element_bytes = column_bytes * (columns - 1) + rows * size
        stride = stride or column_bytes * columns
        if stride < element_bytes and count > 1:
            raise self._file.fail(where, f"a stride of {stride} bytes for elements of {element_bytes}")
        if count == 0:
            return np.zeros((0, COMPONENTS[kind]), dtype)
        if offset + (count - 1) * stride + element_bytes > len(view):
            raise self._file.fail(
                where, f"accessor out of range: {count} elements from byte {offset} in a view of {len(view)} bytes"
            )
        # Misaligned data is against the specification, but numpy reads it.
        elements: NDArray[Any] = np.ndarray(
            (count, columns, rows), dtype, view.data, offset, (stride, column_bytes, size)
        )
        return elements.reshape(count, COMPONENTS[kind])

    def _with_sparse(
        self, values: NDArray[Any], sparse: dict[str, Any], name: str, kind: str, dtype: np.dtype[Any]
    ) -> NDArray[Any]:
        file = self._file
        count = file.integer(sparse, "count", name)
        places, replaced = file.object(sparse, "indices", name), file.object(sparse, "values", name)
        index_type = self._component_type(places, f"{name}.indices")
        if index_type.kind != "u":
            raise file.fail(f"{name}.indices.componentType", "must be an unsigned integer")
        index_offset = file.integer(places, "byteOffset", f"{name}.indices", 0)
        value_offset = file.integer(replaced, "byteOffset", f"{name}.values", 0)
        where = f"{name}.indices.bufferView"
        indices = self._elements(places.get("bufferView"), where, index_offset, count, "SCALAR", index_type)[:, 0]
        where = f"{name}.values.bufferView"
        elements = self._elements(replaced.get("bufferView"), where, value_offset, count, kind, dtype)
        if count and int(indices.max()) >= len(values):
            raise file.fail(f"{name}.indices", f"{int(indices.max())} in an accessor of {len(values)} elements")
        changed = values.copy()
        changed[indices] = elements
        return changed
