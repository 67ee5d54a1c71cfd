"""Primitives compressed with Draco (KHR_draco_mesh_compression), decoded by DracoPy.

Draco stores the triangles of a primitive and its attributes in one stream, so both are decoded together. glTF maps each attribute
name to the unique id of an attribute in the stream. Draco may reorder and merge vertices: counts and values of the stream replace
those of the accessors, which only say whether integers are normalised.

The header is checked first, against Draco's bitstream specification 2.2: DracoPy allocates what the counts in it ask for.
"""

import struct
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from viewer.scene.gltf.buffers import Buffers
from viewer.scene.gltf.container import GltfFile
from viewer.scene.gltf.schema import Draco
from viewer.scene.json_text import describe, printable

EXTENSION = "KHR_draco_mesh_compression"
HEADER = struct.Struct("<5sBBBBH")
"""Magic, major and minor version, kind of geometry, encoding method, flags."""
VERSION = (2, 2)
MESH, EDGEBREAKER, HAS_METADATA = 1, 1, 0x8000
FREE_COUNT = 1 << 12
COUNT_PER_BYTE = 16
"""Most vertices, and most triangles: FREE_COUNT, and COUNT_PER_BYTE for each byte of the data. Real meshes have about one."""


@dataclass(frozen=True, eq=False)
class DracoMesh:
    """Attributes and triangles of a primitive, decoded from Draco data."""

    attributes: dict[str, NDArray[Any]]
    """[V, components] by glTF name, in the stored type."""
    indices: NDArray[np.uint32]
    """[3 T] triangles."""


def _varint(data: bytes, at: int) -> tuple[int, int]:
    """Return (number, offset after it): seven bits a byte, the lowest first. Raises IndexError at the end of the data."""
    value = shift = 0
    while True:
        byte = data[at]
        value |= (byte & 127) << shift
        at, shift = at + 1, shift + 7
        if byte < 128:
            return value, at


def check_draco_header(data: bytes) -> str:
    """Return why the Draco `data` is refused, or "". DracoPy allocates memory by the header's counts without a check."""
    if len(data) < HEADER.size:
        return "truncated"
    magic, major, minor, kind, method, flags = HEADER.unpack_from(data)
    if magic != b"DRACO" or (major, minor) != VERSION:
        return "it is not of version 2.2, which glTF asks for"
    if kind != MESH:
        return "it holds points, no triangles"
    if flags & HAS_METADATA:
        return "it holds metadata, which is not read"
    try:
        # The edgebreaker method stores its traversal type first. Then both methods store two counts.
        first, at = _varint(data, HEADER.size + (method == EDGEBREAKER))
        second, _ = _varint(data, at)
    except IndexError:
        return "truncated"
    most = FREE_COUNT + COUNT_PER_BYTE * len(data)
    if max(first, second) > most:
        return f"{max(first, second)} vertices or triangles in {len(data)} bytes"
    return ""


def decode_draco(file: GltfFile, buffers: Buffers, content: Any, where: str) -> DracoMesh:
    """Return the decoded primitive of the field `where`, whose extension is `content`. Raises InputError for broken data."""
    import DracoPy

    where = f"{where}.extensions.{EXTENSION}"
    extension = file.read(content, Draco, where)
    data, _ = buffers.view(extension.buffer_view, f"{where}.bufferView")
    refusal = check_draco_header(data.tobytes())
    if refusal:
        raise file.fail(where, f"the Draco data does not decode ({refusal}); export the scene again")
    try:
        mesh = DracoPy.decode(data.tobytes())
        faces = np.asarray(mesh.faces)
        stored = {entry["unique_id"]: np.asarray(entry["data"]) for entry in mesh.attributes}
    except Exception as error:  # DracoPy documents no exceptions, and the data is untrusted.
        raise file.fail(where, f"the Draco data does not decode ({error})") from error
    if faces.ndim != 2 or faces.shape[1] != 3:
        raise file.fail(where, "the Draco data holds no triangles")
    attributes: dict[str, NDArray[Any]] = {}
    for name, number in extension.attributes.items():
        if number not in stored:
            raise file.fail(f"{where}.attributes.{printable(name)}", f"{describe(number)} is not in the Draco data")
        values = stored[number]
        attributes[name] = values.reshape(len(values), -1)
    if len({len(values) for values in attributes.values()}) > 1:
        raise file.fail(where, "the Draco attributes differ in count")
    return DracoMesh(attributes, faces.astype(np.uint32).reshape(-1))
