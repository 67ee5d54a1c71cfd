"""Structure-aware mutations of JSON, of the containers around it, and of checksums. libFuzzer's mutations do the rest."""

import copy
import io
import json
import random
import struct
import zipfile
import zlib
from collections.abc import Callable, Iterator
from typing import Any

Mutate = Callable[[bytes, int], bytes]
"""Function of libFuzzer: (data, largest size in bytes) -> mutated data."""

GLB_HEADER = 12
CHUNK_JSON, CHUNK_BINARY = 0x4E4F534A, 0x004E4942
KTX2_WORDS = range(12, 104, 4)
"""Places of the numbers in a KTX2 header with one mip."""
WORDS = (0, 1, 2, 3, 4, 6, 37, 43, 131, 139, 145, 4096, 32768, 32769, 1 << 16, 1 << 24, 1 << 31, (1 << 32) - 1)
ENTRY_NAMES = (
    "../a.glb",
    "/a.glb",
    "a\\b.glb",
    "C:\\a.glb",
    "a/../b.glb",
    ".hidden.glb",
    "a.glb/",
    "a.gltf",
    "a.obj",
    "\x1b.glb",
    "a",
)
"""Names of files in an archive that lead elsewhere, or mean something else."""
PNG_SIGNATURE = b"\x89PNG\r\n\x1a\n"
EXTREMES: tuple[Any, ...] = (
    None, True, False, -1, 0, 1, 2, 3, 4, 5, 16, 127, 255, 256, 4096, 5121, 5123, 5125, 5126, 32768, 65535, 65536,
    2**24, 2**28, 2**31 - 1, 2**31, 2**32, 2**53, 2**63, 2**64, 10**400, 0.5, -0.0, -0.5, 1e-320, 1e30, 1e38, 1e300,
    float("nan"), float("inf"), "", "x", "VEC2", "VEC3", "SCALAR", "MAT4", "MASK", "BLEND", "data:,", "../../etc/passwd",
    "/etc/passwd", "C:\\x", "file:///etc/passwd", "//host/x", "data:;base64,AAAA", "\ud800", "a\0b", "\x1b[2J", [], {},
    [0], [[]], [0, 0], [0, 0, 0], [0, 0, 0, 1], [1e30, 1e30, 1e30], {"index": 0}, {"extensions": {}},
)  # fmt: skip
"""Values that replace those of a JSON document."""
MOST_PLACES = 4000
"""Values of a document that may still grow."""
LARGEST_CHANGED = 1e30
"""Numbers from here on are replaced, not multiplied."""


def _extreme(source: random.Random) -> Any:
    return copy.deepcopy(source.choice(EXTREMES))


def _places(value: Any) -> Iterator[tuple[Any, Any]]:
    """(container, key) of every value in a JSON tree."""
    pending = [value] if isinstance(value, dict | list) else []
    while pending:
        owner = pending.pop()
        for key, child in list(owner.items() if isinstance(owner, dict) else enumerate(owner)):
            yield owner, key
            if isinstance(child, dict | list):
                pending.append(child)


def _change_number(value: int | float, source: random.Random) -> Any:
    if not abs(value) < LARGEST_CHANGED:
        return _extreme(source)
    match source.randrange(5):
        case 0:
            return -value
        case 1:
            return value + source.choice((-1, 1))
        case 2:
            return value * source.choice((2, 0.5, 1000))
        case 3:
            return str(value)
        case _:
            return _extreme(source)


def mutate_document(document: Any, source: random.Random) -> Any:
    """`document` with one value replaced, dropped, repeated, renamed, moved or nested; changed in place."""
    places = list(_places(document))
    if not places:
        return _extreme(source)
    owner, key = source.choice(places)
    action = source.randrange(8) if len(places) < MOST_PLACES else 0
    if action == 0:
        del owner[key]
    elif action == 1:
        other_owner, other = source.choice(places)
        owner[key] = copy.deepcopy(other_owner[other])
    elif action == 2 and isinstance(owner, list):
        owner.extend([owner[key]] * source.choice((1, 1, 2, 30)))
    elif action == 2:
        other_owner, other = source.choice(places)
        owner[str(other)] = owner.pop(key)
    elif action == 3:
        owner[key] = source.choice(([owner[key]], {"x": owner[key]}, {str(key): owner[key]}))
    elif action in (4, 5) and isinstance(owner[key], int | float):
        owner[key] = _change_number(owner[key], source)
    else:
        owner[key] = _extreme(source)
    return document


def _mutated_json(text: bytes, source: random.Random) -> bytes | None:
    try:
        document = json.loads(text)
        for _ in range(source.choice((1, 1, 1, 2, 4))):
            document = mutate_document(document, source)
        return json.dumps(document).encode("utf-8", "replace")
    except (ValueError, RecursionError):
        return None


def glb_bytes(text: bytes, binary: bytes) -> bytes:
    """A GLB of a JSON text and a binary chunk."""
    text += b" " * (-len(text) % 4)
    body = struct.pack("<II", len(text), CHUNK_JSON) + text
    if binary:
        binary += bytes(-len(binary) % 4)
        body += struct.pack("<II", len(binary), CHUNK_BINARY) + binary
    return struct.pack("<4sII", b"glTF", 2, GLB_HEADER + len(body)) + body


def mutate_gltf(data: bytes, limit: int, source: random.Random, mutate: Mutate) -> bytes:
    """A .glb or .gltf with its JSON or its binary chunk changed and the container still whole."""
    if data[:4] != b"glTF" or len(data) < GLB_HEADER + 8:
        return _mutated_json(data, source) or mutate(data, limit)
    (length,) = struct.unpack_from("<I", data, GLB_HEADER)
    start = GLB_HEADER + 8
    text, binary = data[start : start + length], data[start + length + 8 :]
    if source.random() < 0.25 and binary:
        return glb_bytes(text, mutate(binary, max(1, limit - length - 32)))
    changed = _mutated_json(text, source)
    return mutate(data, limit) if changed is None else glb_bytes(changed, binary)


def mutate_json(data: bytes, limit: int, source: random.Random, mutate: Mutate) -> bytes:
    """A JSON text with values changed."""
    return _mutated_json(data, source) or mutate(data, limit)


def mutate_pack(data: bytes, limit: int, source: random.Random, mutate: Mutate) -> bytes:
    """A safetensors file with its header, the metadata in it, or its tensors changed."""
    try:
        (length,) = struct.unpack_from("<Q", data)
        header = json.loads(data[8 : 8 + length])
        rest = data[8 + length :]
        if source.random() < 0.2:
            rest = mutate(rest, max(1, limit - length))
        elif source.random() < 0.3:
            header = mutate_document(header, source)
        else:
            metadata = json.loads(header["__metadata__"]["ntc"])
            for _ in range(source.choice((1, 1, 2))):
                metadata = mutate_document(metadata, source)
            header["__metadata__"]["ntc"] = json.dumps(metadata)
        text = json.dumps(header).encode("utf-8", "replace")
        return struct.pack("<Q", len(text)) + text + rest
    except (ValueError, KeyError, TypeError, RecursionError, struct.error):
        return mutate(data, limit)


def mutate_image(data: bytes, limit: int, source: random.Random, mutate: Mutate) -> bytes:
    """An image changed anywhere; a PNG gets correct checksums again, so that readers get past them."""
    changed = bytearray(mutate(data, limit))
    if not changed.startswith(PNG_SIGNATURE) or source.random() < 0.2:
        return bytes(changed)
    at = len(PNG_SIGNATURE)
    while at + 12 <= len(changed):
        (length,) = struct.unpack_from(">I", changed, at)
        if at + 12 + length > len(changed):
            break
        checksum = zlib.crc32(bytes(changed[at + 4 : at + 8 + length]))
        struct.pack_into(">I", changed, at + 8 + length, checksum)
        at += 12 + length
    return bytes(changed)


def mutate_ktx2(data: bytes, limit: int, source: random.Random, mutate: Mutate) -> bytes:
    """A KTX2 file with one number of its header replaced, or its data changed behind a header that stays."""
    if len(data) <= KTX2_WORDS.stop or source.random() < 0.2:
        return mutate(data, limit)
    if source.random() < 0.5:
        return data[: KTX2_WORDS.stop] + mutate(data[KTX2_WORDS.stop :], max(1, limit - KTX2_WORDS.stop))
    changed = bytearray(data)
    for _ in range(source.choice((1, 1, 2))):
        struct.pack_into("<I", changed, source.choice(KTX2_WORDS), source.choice((*WORDS, len(data))))
    return bytes(changed)


def mutate_archive(data: bytes, limit: int, source: random.Random, mutate: Mutate) -> bytes:
    """A zip archive with a file in it changed, renamed, repeated or dropped, and whole again; else changed anywhere."""
    if source.random() < 0.4:
        return mutate(data, limit)
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            entries = [(file.filename, archive.read(file)[:limit]) for file in archive.infolist()]
        at = source.randrange(len(entries))
        name, content = entries[at]
        match source.randrange(4):
            case 0:
                entries[at] = source.choice(ENTRY_NAMES), content
            case 1:
                entries.append((source.choice((name, name.upper(), *ENTRY_NAMES)), content))
            case 2:
                del entries[at]
            case _:
                entries[at] = name, mutate_gltf(content, limit, source, mutate)
        buffer = io.BytesIO()
        method = source.choice((zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED, zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA))
        with zipfile.ZipFile(buffer, "w", method) as archive:
            for name, content in entries:
                archive.writestr(name, content)
        return buffer.getvalue()
    except Exception:  # noqa: BLE001 (zipfile lets many exceptions through on broken archives)
        return mutate(data, limit)


def mutate_mesh(data: bytes, limit: int, source: random.Random, mutate: Mutate) -> bytes:
    """A mesh in text with a word replaced or a line repeated; else changed anywhere."""
    lines = data.split(b"\n")
    if source.random() < 0.4 or len(lines) < 3:
        return mutate(data, limit)
    at = source.randrange(1, len(lines))
    words = lines[at].split(b" ")
    if source.random() < 0.7:
        words[source.randrange(len(words))] = str(
            source.choice((*WORDS, -1, 0.5, "nan", "1e400", "a/b/c", "//"))
        ).encode()
        lines[at] = b" ".join(words)
    else:
        lines[at:at] = [lines[source.randrange(1, len(lines))]] * source.choice((1, 2, 50))
    return b"\n".join(lines)
