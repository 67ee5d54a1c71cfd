"""Bytes of a glTF file: buffers, buffer views, data URIs and external files."""

import base64
from pathlib import Path, PureWindowsPath
from urllib.parse import unquote, unquote_to_bytes, urlsplit

import numpy as np
from numpy.typing import NDArray

from ntc.io import read_file
from viewer.locations import SCENE_ROOTS_VARIABLE
from viewer.scene.gltf.container import GltfFile
from viewer.scene.gltf.meshopt import decode_meshopt, meshopt_extension

FREE_DECODED_BYTES = 1 << 28
DECODED_PER_BYTE = 64
"""Compressed buffer views may decode to FREE_DECODED_BYTES, and beyond to so many for each byte of the buffers' files: several
views may name the same bytes."""


def resolve_uri(file: GltfFile, uri: str, where: str) -> Path | None:
    """Path of the external file `uri`, free of links; None when the glTF itself has no folder.

    It lies in the glTF file's folder or in one of `file.roots`: a scene from elsewhere must not read other files of
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
    """Whether `uri` holds its bytes itself."""
    return uri[:5].lower() == "data:"


def read_uri(file: GltfFile, uri: str, where: str) -> bytes:
    """The bytes of a data URI or of an external file. Raises InputError where it is missing, broken or not allowed."""
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
    """The buffers of one file, each read when it is first asked for, and each file once however many name it."""

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
        """Bytes read so far, each file counted once: what a scene holds must be in proportion to them."""
        return self._byte_count

    def buffer(self, index: int) -> NDArray[np.uint8]:
        """[byteLength] uint8 of buffer `index`. Raises InputError."""
        if index not in self._read:
            self._read[index] = self._load(index)
        return self._read[index]

    def _load(self, index: int) -> NDArray[np.uint8]:
        file = self._file
        where = f"buffers[{index}]"
        entry = file.entry("buffers", index, where)
        length = file.integer(entry, "byteLength", where)
        data: bytes | memoryview
        if "uri" in entry:
            data = self._source(file.text(entry, "uri", where), f"{where}.uri")
        elif index == 0 and file.binary is not None:
            data = file.binary
        else:
            raise file.fail(where, "has neither a uri nor the GLB's binary chunk")
        if len(data) < length:
            raise file.fail(where, f"has {len(data)} bytes of the {length} it should have; copy or export it again")
        return np.frombuffer(data, np.uint8, length)

    def _source(self, uri: str, where: str) -> bytes:
        key = uri if is_data_uri(uri) else resolve_uri(self._file, uri, where) or uri
        if key not in self._sources:
            self._sources[key] = read_uri(self._file, uri, where)
            self._byte_count += len(self._sources[key])
        return self._sources[key]

    def view(self, index: object, where: str) -> tuple[NDArray[np.uint8], int]:
        """(bytes, byte stride or 0) of the buffer view `index`, named by the field `where`. Raises InputError."""
        file = self._file
        views = file.entries("bufferViews")
        number = file.index(index, len(views), where)
        view = views[number]
        name = f"bufferViews[{number}]"
        stride = file.integer(view, "byteStride", name, 0, high=252)
        length = file.integer(view, "byteLength", name)
        if number not in self._decoded:
            compression = meshopt_extension(file, view, name)
            if compression is None:
                buffer_index = file.index(view.get("buffer"), len(file.entries("buffers")), f"{name}.buffer")
                return self._bytes(buffer_index, file.integer(view, "byteOffset", name, 0), length, name), stride
            self._decoded_bytes += compression.count * compression.stride
            if self._decoded_bytes > FREE_DECODED_BYTES + DECODED_PER_BYTE * self._byte_count:
                problem = f"the scene's compressed views hold more than {FREE_DECODED_BYTES >> 20} MiB"
                raise file.fail(name, f"{problem} and {DECODED_PER_BYTE} bytes for each byte of its files; split it")
            compressed = self._bytes(compression.buffer, compression.offset, compression.length, compression.field)
            self._decoded[number] = decode_meshopt(file, compression, compressed)
        decoded = self._decoded[number]
        if len(decoded) < length:
            raise file.fail(name, f"its compressed data has {len(decoded)} bytes of the {length} it should have")
        return decoded[:length], stride

    def _bytes(self, buffer: int, offset: int, length: int, where: str) -> NDArray[np.uint8]:
        data = self.buffer(buffer)
        if offset + length > len(data):
            raise self._file.fail(where, f"ends at byte {offset + length} of a buffer of {len(data)}")
        return data[offset : offset + length]
