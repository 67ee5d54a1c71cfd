"""The lines of a library's index: one record each, with a checksum, so that a torn or damaged line is known as one."""

import hashlib
from typing import Annotated

import msgspec
from msgspec import Meta

from ntc.errors import MetadataError
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
    """Of mip 0; None where it is exact or not known."""


class Shard(msgspec.Struct, frozen=True, tag="shard"):
    """One file of the library: a pack, whole by itself."""

    digest: _Digest
    """SHA-256 of the file, which gives its name."""
    bytes: _Count
    settings: Text
    """Key of how its textures were encoded: packs of one key can be joined (`ntc.library.joining.settings_key`)."""
    grouping: Text
    textures: tuple[StoredTexture, ...]


class ImageFile(msgspec.Struct, frozen=True, array_like=True):
    """What was found in an image file once, so that it need not be decoded to know whether the library holds it."""

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
    """The line of a record, with its end; the same record gives the same line."""
    text = _encoder.encode(record)
    return _checksum(text) + b" " + text + b"\n"


def read_line(line: bytes) -> Record:
    """The record of a line without its end. Raises MetadataError for one that is torn, damaged or of no known kind."""
    check, _, text = line.partition(b" ")
    if check != _checksum(text):
        raise MetadataError("the checksum is wrong")
    try:
        return _decoder.decode(text)
    except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError) as error:
        raise MetadataError(str(error)) from error
