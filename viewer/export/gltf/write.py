"""Writing a glTF file whole, with what lies beside it: nothing is in its place before all of it is made."""

import json
import re
import shutil
import struct
import tempfile
from pathlib import Path
from urllib.parse import quote

import numpy as np
from numpy.typing import NDArray

from ntc.errors import InputError
from ntc.io import PARTIAL_MARK, write_bytes
from viewer.export.gltf.document import ALIGNMENT, GltfDocument
from viewer.scene.gltf.container import CHUNK_BINARY, CHUNK_JSON, GLB_MAGIC

LARGEST_GLB = (1 << 32) - 1
"""Bytes: a GLB tells its length in 32 bits."""
GLB_VERSION = 2
LONGEST_NAME = 120
"""Letters of a file name that are kept of an image's name."""


def files_folder(out: Path) -> Path:
    """The folder of a .gltf file's buffers and images."""
    return out.with_name(f"{out.stem}.files")


def write_gltf(out: Path, document: GltfDocument) -> int:
    """Write `document`, which is changed by it, to the .gltf or .glb file `out`; returns the bytes of all files.

    Buffers and images of a .gltf go into the folder `files_folder`, which is replaced whole; a .glb holds them itself. Raises
    InputError where that cannot be written; then all files are as they were.
    """
    if out.suffix.lower() == ".glb":
        return _write_glb(out, document)
    folder = files_folder(out)
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
        made = Path(tempfile.mkdtemp(dir=out.parent, prefix=f".{out.stem[:60]}.", suffix=PARTIAL_MARK))
    except OSError as error:
        raise InputError(f"{out}: cannot be written ({error.strerror}); choose a writable folder") from error
    try:
        content = made / "files"
        content.mkdir()
        byte_count = _write_files(document, content, folder.name)
        text = _json_bytes(document)
        (made / "scene.gltf").write_bytes(text)
        _take_places(out, made)
    except OSError as error:
        problem = f"{out}: cannot be written ({error.strerror or error}); check space and permissions"
        raise InputError(problem) from error
    finally:
        shutil.rmtree(made, ignore_errors=True)
    return byte_count + len(text)


def _take_places(out: Path, made: Path) -> None:
    """Put the file and the folder that lie in `made` where `out` and its folder are. Whatever is raised, those before are back."""
    folder, before, content = files_folder(out), made / "before", made / "files"
    if folder.exists():
        folder.rename(before)
    try:
        # An empty folder would be one more thing to wonder about.
        if any(content.iterdir()):
            content.rename(folder)
        (made / "scene.gltf").replace(out)
    except BaseException:
        if not content.exists():
            folder.rename(content)
        if before.exists():
            before.rename(folder)
        raise


def _json_bytes(document: GltfDocument) -> bytes:
    for key in [key for key, value in document.json.items() if value == []]:
        # Arrays that are there must not be empty (glTF 2.0, JSON schema).
        del document.json[key]
    return json.dumps(document.json, ensure_ascii=False, separators=(",", ":")).encode("utf-8", "replace")


def _write_files(document: GltfDocument, folder: Path, name: str) -> int:
    """Write buffers and images into `folder`, which is to be called `name`, and name them in the document; returns their bytes.
    Raises OSError and InputError."""
    taken: set[str] = set()
    byte_count = 0

    def write(wanted: str, data: bytes | NDArray[np.uint8]) -> str:
        nonlocal byte_count
        path = folder / _free_name(wanted, taken)
        with path.open("wb") as file:
            file.write(data if isinstance(data, bytes) else data.tobytes())
        byte_count += len(data)
        return quote(f"{name}/{path.name}")

    buffers = document.entries("buffers")
    for number, data in enumerate(document.buffers):
        if data is not None:
            buffers[number]["uri"] = write(f"buffer{number}.bin", data)
            buffers[number]["byteLength"] = len(data)
    for index, image in document.images.items():
        entry = document.entries("images")[index]
        entry["uri"] = write(image.name, image.read())
        if image.mime_type:
            entry["mimeType"] = image.mime_type
    return byte_count


def _free_name(wanted: str, taken: set[str]) -> str:
    """`wanted` as a file name that every system takes, with a number where another file has it; `taken` grows by it."""
    name = re.sub(r'[\x00-\x1f<>:"/\\|?*]', "_", wanted).strip(" .") or "file"
    stem, dot, suffix = name.rpartition(".")
    stem, suffix = (stem[:LONGEST_NAME], f".{suffix[:10]}") if dot else (name[:LONGEST_NAME], "")
    candidate, number = f"{stem}{suffix}", 2
    while candidate.lower() in taken:
        candidate, number = f"{stem}_{number}{suffix}", number + 1
    taken.add(candidate.lower())
    return candidate


def _write_glb(out: Path, document: GltfDocument) -> int:
    parts = [document.merge_buffers()]
    length = len(parts[0])
    views = document.entries("bufferViews")
    for index, image in document.images.items():
        if not image.mime_type:
            problem = f"{image.name} is no image that a .glb can hold (PNG, JPEG, WebP, KTX2); write a .gltf"
            raise InputError(f"{out}: {problem}")
        data = np.frombuffer(image.read(), np.uint8)
        entry = document.entries("images")[index]
        entry.pop("uri", None)
        entry["mimeType"], entry["bufferView"] = image.mime_type, len(views)
        views.append({"buffer": 0, "byteOffset": length, "byteLength": len(data)})
        parts.append(np.pad(data, (0, -len(data) % ALIGNMENT)))
        length += len(parts[-1])
    if length:
        document.entries("buffers")[0]["byteLength"] = length
    else:
        document.json.pop("buffers", None)
    text = _json_bytes(document)
    text += b" " * (-len(text) % ALIGNMENT)
    chunks = [struct.pack("<II", len(text), CHUNK_JSON), text]
    if length:
        chunks += [struct.pack("<II", length, CHUNK_BINARY), *(part.tobytes() for part in parts)]
    whole = 12 + sum(len(chunk) for chunk in chunks)
    if whole > LARGEST_GLB:
        raise InputError(f"{out}: would have {whole} bytes, a .glb has at most {LARGEST_GLB}; write a .gltf")
    write_bytes(out, b"".join([struct.pack("<4sII", GLB_MAGIC, GLB_VERSION, whole), *chunks]))
    return whole
