"""Bytes of a glTF file: buffers, buffer views, data URIs and external files."""

import base64
from pathlib import Path, PureWindowsPath
from typing import Any
from urllib.parse import unquote, unquote_to_bytes, urlsplit

import numpy as np
from msgspec import UnsetType
from numpy.typing import NDArray

from ntc.io import read_file
from viewer.locations import SCENE_ROOTS_VARIABLE
from viewer.scene.gltf.container import GltfFile
from viewer.scene.gltf.meshopt import decode_meshopt, meshopt_extension
from viewer.scene.gltf.schema import ABSENT, Accessor, Buffer, BufferView, Sparse

FREE_DECODED_BYTES = 1 << 28
DECODED_PER_BYTE = 64
"""Limit of the decoded bytes of compressed buffer views: FREE_DECODED_BYTES, and beyond that DECODED_PER_BYTE for each byte of
the buffers' files. Without it, many views of the same bytes could fill the memory."""


def resolve_uri(file: GltfFile, uri: str, where: str) -> Path | None:
    """Return the path of the external file `uri`, links resolved; None when the glTF itself has no folder.

    The path must lie in the glTF file's folder or in one of `file.roots`: a downloaded scene must not read other files of
    the machine. Raises InputError for a URI with a scheme and for paths that lead elsewhere, also through links.
    """
    try:
        has_scheme = bool(urlsplit(uri).scheme or urlsplit(uri).netloc)
    except ValueError:
        has_scheme = True
    if has_scheme:
        raise file.fail(where, f"{uri[:60]!r} is not a relative path; put the file beside the scene")
    name = unquote(uri)
    parts = PureWindowsPath(name)
    elsewhere = file.fail(
        where,
        f"{uri[:60]!r} leads out of the scene's folder; put the file beside the scene, or name its folder in"
        f" {SCENE_ROOTS_VARIABLE}",
    )
    if not name or "\0" in name or parts.is_absolute() or parts.drive or parts.root:
        raise elsewhere
    climbs = ".." in parts.parts
    if climbs and not file.roots:
        raise elsewhere
    if file.folder is None:
        return None
    try:
        path = (file.folder / Path(*parts.parts)).resolve()
        allowed = (file.folder.resolve(), *file.roots)
    except (OSError, RuntimeError, ValueError) as error:
        raise file.fail(where, f"{uri[:60]!r}: not a file name") from error
    if not any(path.is_relative_to(root) for root in allowed):
        raise elsewhere
    return path


def is_data_uri(uri: str) -> bool:
    """Return whether `uri` is a data URI, which holds its bytes itself."""
    return uri[:5].lower() == "data:"


def read_uri(file: GltfFile, uri: str, where: str) -> bytes:
    """Return the bytes of a data URI or of an external file. Raises InputError where it is missing, broken or not allowed."""
    if is_data_uri(uri):
        header, comma, payload = uri.partition(",")
        if not comma:
            raise file.fail(where, "a data URI without data")
        if not header.endswith(";base64"):
            return unquote_to_bytes(payload)
        try:
            return base64.b64decode(unquote(payload), validate=True)
        except ValueError as error:
            raise file.fail(where, f"the data URI is not valid base64 ({error})") from error
    path = resolve_uri(file, uri, where)
    if path is None:
        raise file.fail(where, f"{uri[:60]!r}: external file of a scene that is not a file itself")
    try:
        return read_file(path)
    except OSError as error:
        raise file.fail(where, f"{uri[:120]}: cannot be read ({error.strerror}); put it beside the scene") from error
    except ValueError as error:
        raise file.fail(where, f"{uri[:60]!r}: not a file name") from error


class Buffers:
    """The buffers of one file. Each is read at first use; a file that several buffers name is read once."""

    def __init__(self, file: GltfFile) -> None:
        self._file = file
        self._read: dict[int, NDArray[np.uint8]] = {}
        self._decoded: dict[int, NDArray[np.uint8]] = {}
        """Content of compressed buffer views."""
        self._decoded_bytes = 0
        self._sources: dict[str | Path, bytes] = {}
        self._byte_count = 0 if file.binary is None else len(file.binary)

    @property
    def byte_count(self) -> int:
        """Bytes read so far, each file counted once. Limits on the content of a scene are proportional to them."""
        return self._byte_count

    def buffer(self, index: int) -> NDArray[np.uint8]:
        """Return [byteLength] uint8 of buffer `index`. Raises InputError."""
        if index not in self._read:
            self._read[index] = self._load(index)
        return self._read[index]

    def _load(self, index: int) -> NDArray[np.uint8]:
        file = self._file
        where = f"buffers[{index}]"
        entry = file.entry("buffers", index, Buffer)
        length = int(entry.byte_length)
        data: bytes | memoryview
        if not isinstance(entry.uri, UnsetType):
            data = self._source(entry.uri, f"{where}.uri")
        elif index == 0 and file.binary is not None:
            data = file.binary
        else:
            raise file.fail(where, "has neither a uri nor the GLB's binary chunk")
        if len(data) < length:
            raise file.fail(where, f"has {len(data)} of {length} bytes; copy or export it again")
        return np.frombuffer(data, np.uint8, length)

    def _source(self, uri: str, where: str) -> bytes:
        key = uri if is_data_uri(uri) else resolve_uri(self._file, uri, where) or uri
        if key not in self._sources:
            self._sources[key] = read_uri(self._file, uri, where)
            self._byte_count += len(self._sources[key])
        return self._sources[key]

    def view(self, index: object, where: str) -> tuple[NDArray[np.uint8], int]:
        """Return (bytes, byte stride or 0) of the buffer view `index`, named by the field `where`. Raises InputError."""
        file = self._file
        number = file.index(index, len(file.entries("bufferViews")), where)
        view, name = file.entry("bufferViews", number, BufferView), f"bufferViews[{number}]"
        stride, length = int(view.byte_stride), int(view.byte_length)
        if number not in self._decoded:
            compression = meshopt_extension(file, view, name)
            if compression is None:
                buffer_index = file.index(view.buffer, len(file.entries("buffers")), f"{name}.buffer")
                return self._bytes(buffer_index, int(view.byte_offset), length, name), stride
            self._decoded_bytes += compression.count * compression.stride
            if self._decoded_bytes > FREE_DECODED_BYTES + DECODED_PER_BYTE * self._byte_count:
                problem = f"the scene's compressed views hold more than {FREE_DECODED_BYTES >> 20} MiB"
                raise file.fail(name, f"{problem} and {DECODED_PER_BYTE} bytes for each byte of its files; split it")
            compressed = self._bytes(compression.buffer, compression.offset, compression.length, compression.field)
            self._decoded[number] = decode_meshopt(file, compression, compressed)
        decoded = self._decoded[number]
        if len(decoded) < length:
            raise file.fail(name, f"its compressed data has {len(decoded)} of {length} bytes")
        return decoded[:length], stride

    def _bytes(self, buffer: int, offset: int, length: int, where: str) -> NDArray[np.uint8]:
        data = self.buffer(buffer)
        if offset + length > len(data):
            raise self._file.fail(where, f"ends at byte {offset + length} of a buffer of {len(data)}")
        return data[offset : offset + length]


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
"""Most values of all accessors without a buffer view (all zeros) in one file: no file size limits them."""


def normalize(values: NDArray[Any]) -> NDArray[np.float32]:
    """Return normalised integers as float32: unsigned to 0..1, signed to -1..1. Floats are returned as they are."""
    if values.dtype.kind == "f":
        return values.astype(np.float32, copy=False)
    scaled = values.astype(np.float32) / np.float32(np.iinfo(values.dtype).max)
    return np.asarray(np.maximum(scaled, np.float32(-1.0)))


class Accessors:
    """Reads the accessors of one file. Every count is checked against the bytes of the file before memory is allocated."""

    def __init__(self, file: GltfFile, buffers: Buffers) -> None:
        self._file = file
        self._buffers = buffers
        self._implied = 0

    def raw(self, index: object, where: str, kinds: tuple[str, ...]) -> NDArray[Any]:
        """Return the elements [count, components] of accessor `index` in their stored type; matrices in column order.

        `kinds` are the allowed types, e.g. ("VEC3",). Raises InputError.
        """
        return self._values(index, where, kinds)[0]

    def floats(self, index: object, where: str, kinds: tuple[str, ...]) -> NDArray[np.float32]:
        """Return `raw` as float32, with normalised integers scaled to 0..1 or -1..1. Stored floats are a view, not a copy."""
        values, normalized = self._values(index, where, kinds)
        return normalize(values) if normalized else values.astype(np.float32, copy=False)

    def _values(self, index: object, where: str, kinds: tuple[str, ...]) -> tuple[NDArray[Any], bool]:
        file = self._file
        number = file.index(index, len(file.entries("accessors")), where)
        entry, name = file.entry("accessors", number, Accessor), f"accessors[{number}]"
        kind, count = entry.type, int(entry.count)
        if kind not in kinds:
            raise file.fail(f"{name}.type", f"{kind!r:.20} where {' or '.join(kinds)} is needed (by {where})")
        dtype = self._component_type(entry.component_type, name)
        if entry.buffer_view != ABSENT:
            values = self._elements(entry.buffer_view, f"{name}.bufferView", int(entry.byte_offset), count, kind, dtype)
        else:
            self._implied += count * COMPONENTS[kind]
            if self._implied > MAX_IMPLIED_VALUES:
                raise file.fail(f"{name}.count", f"{count} elements without a buffer view are more than is read")
            values = np.zeros((count, COMPONENTS[kind]), dtype)
        if not isinstance(entry.sparse, UnsetType):
            values = self._with_sparse(values, entry.sparse, f"{name}.sparse", kind, dtype)
        return values, entry.normalized is True

    def _component_type(self, code: float, name: str) -> np.dtype[Any]:
        if code not in COMPONENT_TYPES:
            raise self._file.fail(f"{name}.componentType", f"{code} is not a component type of glTF 2.0")
        return COMPONENT_TYPES[int(code)]

    def _elements(
        self, view_index: object, where: str, offset: int, count: int, kind: str, dtype: np.dtype[Any]
    ) -> NDArray[Any]:
        """Return [count, components] view into the buffer (a copy for padded matrices). Raises InputError."""
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
        # The specification forbids misaligned data, but numpy reads it.
        elements: NDArray[Any] = np.ndarray(
            (count, columns, rows), dtype, view.data, offset, (stride, column_bytes, size)
        )
        return elements.reshape(count, COMPONENTS[kind])

    def _with_sparse(
        self, values: NDArray[Any], sparse: Sparse, name: str, kind: str, dtype: np.dtype[Any]
    ) -> NDArray[Any]:
        file, count = self._file, int(sparse.count)
        places, replaced = sparse.indices, sparse.values
        index_type = self._component_type(places.component_type, f"{name}.indices")
        if index_type.kind != "u":
            raise file.fail(f"{name}.indices.componentType", "must be an unsigned integer")
        where = f"{name}.indices.bufferView"
        offset = int(places.byte_offset)
        indices = self._elements(places.buffer_view, where, offset, count, "SCALAR", index_type)[:, 0]
        where = f"{name}.values.bufferView"
        elements = self._elements(replaced.buffer_view, where, int(replaced.byte_offset), count, kind, dtype)
        if count and int(indices.max()) >= len(values):
            raise file.fail(f"{name}.indices", f"{int(indices.max())} in an accessor of {len(values)} elements")
        changed = values.copy()
        changed[indices] = elements
        return changed
