"""The index of a library: what it holds, a record a line. Each line has a checksum, so that a torn or damaged one is known as one."""

import hashlib
from collections.abc import Container, Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

import msgspec
from msgspec import Meta

from ntc.errors import InputError, MetadataError
from ntc.io import read_file
from ntc.pack.schema import Decibels, Side, Text

INDEX_VERSION = 1
CHECK_DIGITS = 16
"""Hexadecimal digits of a line's checksum."""
_Digest = Annotated[str, Meta(pattern="^[0-9a-f]{64}$")]
_Count = Annotated[int, Meta(ge=0)]


class Beginning(msgspec.Struct, frozen=True, tag="library"):
    """The first record of every index."""

    version: int = INDEX_VERSION


class StoredTexture(msgspec.Struct, frozen=True, array_like=True):
    """One texture of a shard; its place there is that in the record."""

    pixel_hash: Text
    name: Text
    width: Side
    height: Side
    bits_per_texel: float
    """Stored bits of its latents per texel of all encoded mips."""
    psnr_db: Decibels | None
    """PSNR of mip 0 in dB; None where it is exact or not known."""


class Shard(msgspec.Struct, frozen=True, tag="shard"):
    """One file of the library: a pack, whole by itself."""

    digest: _Digest
    """SHA-256 of the file, which gives its name."""
    bytes: _Count
    settings: Text
    """Key of how its textures were encoded: packs of one key can be joined (`ntc.library.reading.settings_key`)."""
    grouping: Text
    textures: tuple[StoredTexture, ...]


class ImageFile(msgspec.Struct, frozen=True, array_like=True):
    """Facts about an image file, so that it need not be decoded again to know whether the library holds it."""

    path: Text
    bytes: _Count
    modified_ns: int
    pixel_hash: Text
    """Empty where the image is constant: there is nothing to encode."""
    width: Side
    height: Side
    channels: Annotated[int, Meta(ge=1, le=4)]


class ImageFiles(msgspec.Struct, frozen=True, tag="files"):
    """Image files that were looked at together."""

    files: tuple[ImageFile, ...]


Record = Beginning | Shard | ImageFiles
_encoder = msgspec.json.Encoder(order="deterministic")
_decoder: msgspec.json.Decoder[Record] = msgspec.json.Decoder(Record)


def _checksum(text: bytes) -> bytes:
    return hashlib.sha256(text).hexdigest()[:CHECK_DIGITS].encode()


def record_line(record: Record) -> bytes:
    """Return the line of a record, with its end; the same record gives the same line."""
    text = _encoder.encode(record)
    return _checksum(text) + b" " + text + b"\n"


def read_line(line: bytes) -> Record:
    """Return the record of a line without its end. Raises MetadataError for one that is torn, damaged or of no known kind."""
    check, _, text = line.partition(b" ")
    if check != _checksum(text):
        raise MetadataError("the checksum is wrong")
    try:
        return _decoder.decode(text)
    except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError) as error:
        raise MetadataError(str(error)) from error


INDEX_FILE = "index.ntc-library"
SHARDS_FOLDER = "shards"
SHARD_SUFFIX = ".ntc"
NAME_DIGITS = 32
"""Number of digits of a shard's digest in its file name."""


def is_library(folder: Path) -> bool:
    """Return whether `folder` holds a library."""
    return (folder / INDEX_FILE).is_file()


def shard_path(folder: Path, digest: str) -> Path:
    """Return the path of the shard with this SHA-256 in the library in `folder`."""
    return folder / SHARDS_FOLDER / f"{digest[:NAME_DIGITS]}{SHARD_SUFFIX}"


@dataclass
class LibraryIndex:
    """The records of a library in `folder`."""

    folder: Path
    shards: dict[str, Shard] = field(default_factory=dict)
    """Shards by digest, in the order of the index."""
    places: dict[tuple[str, str], str] = field(default_factory=dict)
    """Digest of the first shard that holds a texture so encoded, by (settings key, pixel hash)."""
    files: dict[str, ImageFile] = field(default_factory=dict)
    """Image files by path, as they were last found."""
    damaged_lines: list[int] = field(default_factory=list)
    """Numbers of lines, from 1, that are no records; what they said is not known."""
    whole_bytes: int = 0
    """Length of the index up to its last whole line; what follows was torn when a process ended."""

    def take(self, record: Record) -> None:
        """Note a record."""
        if isinstance(record, Shard):
            self.shards.setdefault(record.digest, record)
            for texture in record.textures:
                self.places.setdefault((record.settings, texture.pixel_hash), record.digest)
        elif isinstance(record, ImageFiles):
            self.files.update((file.path, file) for file in record.files)

    def holds(self, settings: str, pixel_hash: str) -> bool:
        """Return whether a texture is there, encoded so."""
        return (settings, pixel_hash) in self.places

    def shards_with(self, wanted: Container[str]) -> dict[str, list[tuple[Shard, frozenset[str]]]]:
        """Return the shards to read for the textures whose pixel hash is `wanted`, and the hashes that each gives: by settings key,
        those with the most textures first."""
        found: dict[str, dict[str, set[str]]] = {}
        for (settings, pixel_hash), digest in self.places.items():
            if pixel_hash in wanted:
                found.setdefault(settings, {}).setdefault(digest, set()).add(pixel_hash)
        count = {key: sum(map(len, shards.values())) for key, shards in found.items()}
        return {
            key: [(self.shards[digest], frozenset(hashes)) for digest, hashes in found[key].items()]
            for key in sorted(found, key=lambda key: (-count[key], key))
        }

    def path(self, shard: Shard) -> Path:
        """Return the file of a shard."""
        return shard_path(self.folder, shard.digest)


def records_of(lines: Iterable[bytes], index: LibraryIndex) -> None:
    """Take the records of whole lines into `index`."""
    for number, line in enumerate(lines, 1):
        try:
            index.take(read_line(line))
        except MetadataError:
            index.damaged_lines.append(number)


def read_index(folder: Path) -> LibraryIndex:
    """Return the index of the library in `folder`; damaged lines are left out and counted. Raises InputError for a folder without one,
    and for a library of another version."""
    path = Path(folder) / INDEX_FILE
    try:
        data = read_file(path)
    except OSError as error:
        raise InputError(f"{folder}: holds no library ({error.strerror}); name the folder of a library") from error
    index, end = LibraryIndex(Path(folder)), data.rfind(b"\n") + 1
    index.whole_bytes = end
    lines = data[:end].split(b"\n")[:-1]
    _require_version(lines[:1], path)
    records_of(lines, index)
    return index


def _require_version(first: list[bytes], path: Path) -> None:
    """Refuse indices of other versions. One whose first line is damaged is read for what can be read."""
    for line in first:
        try:
            record = read_line(line)
        except MetadataError:
            return
        if isinstance(record, Beginning) and record.version != INDEX_VERSION:
            raise InputError(
                f"{path}: has version {record.version}, this program reads version {INDEX_VERSION}; install a newer ntc-viewer"
            )
