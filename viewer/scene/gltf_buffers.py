"""Bytes of a glTF file: buffers, buffer views, data URIs and external files."""

import base64
import binascii
from pathlib import Path, PureWindowsPath
from urllib.parse import unquote, unquote_to_bytes, urlsplit

import numpy as np
from numpy.typing import NDArray

from viewer.scene.gltf_container import GltfFile


def decode_data_uri(file: GltfFile, uri: str, where: str) -> bytes:
    """The bytes of a `data:` URI. Raises InputError."""
    header, comma, payload = uri.partition(",")
    if not comma:
        raise file.fail(where, "a data URI without data")
    if not header.endswith(";base64"):
        return unquote_to_bytes(payload)
    try:
        return base64.b64decode(unquote(payload), validate=True)
    except (binascii.Error, ValueError) as error:
        raise file.fail(where, f"the data URI is not valid base64 ({error})") from error


def resolve_uri(file: GltfFile, uri: str, where: str) -> Path | None:
    """Path of the external file `uri`, which lies in the glTF file's folder; None when the glTF itself has no folder.

    Raises InputError for a URI with a scheme and for paths that are absolute or lead out of the folder: a scene
    from elsewhere must not read other files of the machine.
    """
    try:
        has_scheme = bool(urlsplit(uri).scheme or urlsplit(uri).netloc)
    except ValueError:
        has_scheme = True
    if has_scheme:
        raise file.fail(where, f"{uri[:60]!r} is not a relative path; put the file beside the scene")
    name = unquote(uri)
    parts = PureWindowsPath(name)
    if not name or "\0" in name or parts.is_absolute() or parts.drive or parts.root or ".." in parts.parts:
        raise file.fail(where, f"{uri[:60]!r} leads out of the scene's folder; put the file beside the scene")
    if file.folder is None:
        return None
    return file.folder / Path(*parts.parts)


def read_uri(file: GltfFile, uri: str, where: str) -> bytes:
    """The bytes of a data URI or of an external file. Raises InputError where it is missing or not allowed."""
    if uri[:5].lower() == "data:":
        return decode_data_uri(file, uri, where)
    path = resolve_uri(file, uri, where)
    if path is None:
        raise file.fail(where, f"{uri[:60]!r}: external file of a scene that is not a file itself")
    try:
        return path.read_bytes()
    except OSError as error:
        raise file.fail(where, f"{uri[:120]}: cannot be read ({error.strerror}); put it beside the scene") from error
    except ValueError as error:
        raise file.fail(where, f"{uri[:60]!r}: not a file name") from error


class Buffers:
    """The buffers of one file, each read when it is first asked for."""

    def __init__(self, file: GltfFile) -> None:
        self._file = file
        self._read: dict[int, NDArray[np.uint8]] = {}

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
        if "uri" in entry:
            data = read_uri(file, file.text(entry, "uri", where), f"{where}.uri")
        elif index == 0 and file.binary is not None:
            data = file.binary
        else:
            raise file.fail(where, "has neither a uri nor the GLB's binary chunk")
        if len(data) < length:
            raise file.fail(where, f"has {len(data)} bytes of the {length} it should have; copy or export it again")
        return np.frombuffer(data, np.uint8, length)

    def view(self, index: object, where: str) -> tuple[NDArray[np.uint8], int]:
        """(bytes, byte stride or 0) of the buffer view `index`, named by the field `where`. Raises InputError."""
        file = self._file
        views = file.entries_checked("bufferViews")
        number = file.index(index, len(views), where)
        view = views[number]
        name = f"bufferViews[{number}]"
        buffer_index = file.index(view.get("buffer"), len(file.entries_checked("buffers")), f"{name}.buffer")
        data = self.buffer(buffer_index)
        offset = file.integer(view, "byteOffset", name, 0)
        length = file.integer(view, "byteLength", name)
        stride = file.integer(view, "byteStride", name, 0, high=252)
        if offset + length > len(data):
            raise file.fail(name, f"ends at byte {offset + length} of a buffer of {len(data)}")
        return data[offset : offset + length], stride
