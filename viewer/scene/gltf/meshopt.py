"""Buffer views compressed by meshoptimizer (EXT_meshopt_compression and KHR_meshopt_compression).

A compressed view names its bytes, number of elements, bytes of an element, one of three codecs and a filter. ATTRIBUTES stores the
differences of vertices byte by byte in blocks; TRIANGLES refers to recent edges and vertices; INDICES stores differences of
indices. A filter rebuilds quantised values: octahedral normals, quaternions, numbers with a shared exponent, colours. The library
`meshopt` undoes both, as the extensions' appendices define them, and the view is then read as if it had never been compressed.

Sizes are checked first: the library allocates `count * stride` bytes, so more than the codecs can reach is refused.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from viewer.scene.gltf.container import GltfFile
from viewer.scene.gltf.schema import BufferView, Meshopt, MeshoptFilter, MeshoptMode

EXTENSIONS = ("KHR_meshopt_compression", "EXT_meshopt_compression")
"""Names of the extension, the one to prefer first; the content is the same."""
BYTES_PER_BYTE = 1100
"""Most decoded bytes of attributes for each compressed byte. At best one byte encodes four bytes of each of a block's 256 elements
(1024)."""
INDICES_PER_BYTE = {"TRIANGLES": 3, "INDICES": 1}
"""Most indices that one compressed byte encodes: a triangle takes at least one byte, and so does an index of the other mode."""
FREE_BYTES = 1 << 12
"""Decoded bytes that are always allowed, however few the compressed ones are."""

FILTER_STRIDES: dict[str, tuple[int, ...]] = {"OCTAHEDRAL": (4, 8), "QUATERNION": (8,), "COLOR": (4, 8)}
"""Allowed bytes of an element, by filter; other filters allow any multiple of four."""


@dataclass(frozen=True)
class MeshoptView:
    """Compression of a buffer view: the checked content of the extension."""

    field: str
    buffer: int
    offset: int
    length: int
    """Bytes, compressed."""
    stride: int
    """Bytes of an element."""
    count: int
    mode: MeshoptMode
    filter: MeshoptFilter


def meshopt_extension(file: GltfFile, view: BufferView, where: str) -> MeshoptView | None:
    """Return the compression of the buffer view `view`, which is the field `where`; None where it is not compressed.

    Raises InputError for values that the extension does not allow, and for more elements than its bytes can encode.
    """
    for name in EXTENSIONS:
        extension = file.extension(view, name, Meshopt, where)
        if extension is not None:
            return _checked(file, extension, f"{where}.extensions.{name}")
    return None


def _checked(file: GltfFile, extension: Meshopt, field: str) -> MeshoptView:
    mode, applied = extension.mode, extension.filter
    count, stride, length = int(extension.count), int(extension.byte_stride), int(extension.byte_length)
    buffer = file.index(extension.buffer, len(file.entries("buffers")), f"{field}.buffer")
    allowed = FILTER_STRIDES.get(applied, range(4, 257, 4)) if mode == "ATTRIBUTES" else (2, 4)
    if stride not in allowed:
        raise file.fail(f"{field}.byteStride", f"{stride} is not allowed with {mode} and filter {applied}")
    if mode == "TRIANGLES" and count % 3:
        raise file.fail(f"{field}.count", f"{count} indices are no triangles")
    if mode != "ATTRIBUTES" and applied != "NONE":
        raise file.fail(f"{field}.filter", f"{applied} is not allowed with {mode}")
    per_byte = BYTES_PER_BYTE if mode == "ATTRIBUTES" else INDICES_PER_BYTE[mode] * stride
    if count * stride > FREE_BYTES + per_byte * length:
        problem = f"{count} elements of {stride} bytes are more than {length} bytes can encode"
        raise file.fail(f"{field}.count", f"{problem}; export the scene again")
    return MeshoptView(field, buffer, int(extension.byte_offset), length, stride, count, mode, applied)


def decode_meshopt(file: GltfFile, view: MeshoptView, compressed: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return [count * stride] uint8: `compressed` [length] uint8 decoded, the filter undone. Raises InputError."""
    if view.count == 0:
        return np.zeros(0, np.uint8)
    import meshopt

    applied = None if view.filter == "NONE" else view.filter
    try:
        decoded = meshopt.decode_gltf_buffer(compressed, view.count, view.stride, view.mode, applied)
    except (ValueError, RuntimeError, MemoryError) as error:
        raise file.fail(view.field, f"the data does not decode ({error}); export the scene again") from error
    return np.ascontiguousarray(decoded).view(np.uint8).reshape(-1)
