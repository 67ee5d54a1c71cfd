"""A library of packs in a folder. Its index caches the packs' headers, and is rebuilt if it is missing or damaged."""

import hashlib
import io
import os
import time
from collections.abc import Container, Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Annotated, BinaryIO, Literal

import msgspec
from msgspec import Meta

from ntc.codec.model import Pack
from ntc.errors import InputError
from ntc.io import read_file, write_bytes
from ntc.library.joining import joined_textures, settings_of
from ntc.pack import PACK_SUFFIX
from ntc.pack.file import pack_contents, pack_file, parsed_pack
from ntc.pack.schema import Decibels, Side, Text

INDEX_FILE = "index.ntc-library"
NAME_DIGITS = 32
"""Number of hexadecimal digits of a pack's SHA-256 in its file name."""
SECONDS_BETWEEN_SAVES = 30.0
"""Seconds of hashing images after which the index is saved; a killed program loses at most so much work."""
_Count = Annotated[int, Meta(ge=0)]
Stamp = tuple[int, int]
"""(size in bytes, modification time in ns) of a file."""


class StoredTexture(msgspec.Struct, frozen=True, array_like=True):
    """One texture of a pack."""

    pixel_hash: Text
    name: Text
    width: Side
    height: Side
    bits_per_texel: float
    """Bits of its latents, all mips, per texel of mip 0."""
    psnr_db: Decibels | None
    """PSNR of mip 0 in dB; None if it is infinite or unknown."""


class StoredPack(msgspec.Struct, frozen=True, array_like=True):
    """One pack of the library, as its header describes it."""

    stamp: tuple[_Count, int]
    """(size, modification time) of the file. If the file has another stamp, its header is read again."""
    settings: Text
    """Key of the encoding settings. Packs with the same key can be joined (`ntc.library.joining.settings_key`)."""
    grouping: Text
    textures: tuple[StoredTexture, ...]


class ImageFile(msgspec.Struct, frozen=True, array_like=True):
    """Facts about an image file. While its stamp is unchanged, the library is searched for it without decoding the image."""

    stamp: tuple[_Count, int]
    pixel_hash: Text
    """Hash of its pixels; empty for a constant image, which is not encoded."""
    width: Side
    height: Side
    channels: Annotated[int, Meta(ge=1, le=4)]


class _Index(msgspec.Struct, frozen=True):
    version: Literal[2] = 2
    packs: dict[str, StoredPack] = {}
    """Packs by path below the folder."""
    images: dict[str, ImageFile] = {}
    """Image files by path."""


_encoder = msgspec.json.Encoder(order="deterministic")
_decoder = msgspec.json.Decoder(_Index)


def is_library(folder: Path) -> bool:
    """Return whether `folder` is a library: it holds an index, or packs and no other files."""
    if (folder / INDEX_FILE).is_file():
        return True
    # A path from a user may hold a zero byte.
    with suppress(OSError, ValueError), os.scandir(folder) as entries:
        names = [entry.name for entry in entries if entry.is_file() and not entry.name.startswith(".")]
        return bool(names) and all(map(_is_pack, names))
    return False


def _is_pack(name: str) -> bool:
    # Hidden files are being written, or were left by a killed process.
    return name.endswith(PACK_SUFFIX) and not name.startswith(".")


def _read_index(folder: Path) -> _Index:
    """Return the index of `folder`; an empty one where it is missing, damaged or of another version."""
    try:
        check, _, text = read_file(folder / INDEX_FILE).partition(b"\n")
        return _decoder.decode(text) if check == _checksum(text) else _Index()
    except (OSError, msgspec.MsgspecError, UnicodeDecodeError, RecursionError):
        return _Index()


def _checksum(text: bytes) -> bytes:
    return hashlib.sha256(text).hexdigest().encode()


def _pack_files(folder: Path) -> Iterator[tuple[str, Stamp]]:
    """Yield (path below `folder`, stamp) of each pack in `folder` and its sub-folders."""
    for place, _, names in os.walk(folder):
        below = os.path.relpath(place, folder)
        for name in filter(_is_pack, names):
            with suppress(OSError):
                status = os.stat(os.path.join(place, name))  # noqa: PTH116, PTH118  A Path takes longer than the call.
                yield name if below == "." else f"{below}/{name}", (status.st_size, status.st_mtime_ns)


def _stored_pack(file: BinaryIO, path: Path, stamp: Stamp) -> StoredPack:
    """Return the index entry of the open pack `file`, from its header. Raises InputError."""
    metadata, stored_bytes = pack_contents(file, path)
    textures = tuple(
        StoredTexture(
            each.pixel_hash, each.name, each.width, each.height, 8.0 * size / (each.width * each.height), each.psnr_db
        )
        for each, size in zip(metadata.textures, stored_bytes, strict=True)
    )
    key = settings_of(metadata.codec, metadata.grouping.name, metadata.grouping.parameters, metadata.training)
    return StoredPack(stamp, key, metadata.grouping.name, textures)


class Library:
    """The packs in a folder and its sub-folders, and their textures. Several processes may add packs at the same time."""

    def __init__(self, folder: Path) -> None:
        """Read the index, and the header of each new or changed pack. Raises InputError if `folder` is no library.

        An outdated index is written again if that is possible.
        """
        self.folder = Path(folder)
        if not is_library(self.folder):
            raise InputError(f"{folder}: holds no library; name a folder of packs ({PACK_SUFFIX})")
        self.packs: dict[str, StoredPack] = {}
        """Packs by path below the folder."""
        self.textures: dict[tuple[str, str], tuple[str, StoredTexture]] = {}
        """(pack, texture) by (settings key, pixel hash). If several packs hold a texture, the first by path counts."""
        self.unreadable: dict[str, str] = {}
        """Error messages of files that cannot be read as packs, by path below the folder."""
        index = _read_index(self.folder)
        self.images = index.images
        """Facts about image files, by path."""
        self._saved = time.monotonic()
        for name, stamp in sorted(_pack_files(self.folder)):
            known = index.packs.get(name)
            try:
                self._take(name, known if known is not None and known.stamp == stamp else self._read(name, stamp))
            except InputError as error:
                self.unreadable[name] = str(error)
        if self.packs != index.packs:
            with suppress(InputError):
                self.save()

    @classmethod
    def to_write(cls, folder: Path) -> "Library":
        """Return the library in `folder`; make one if there is none. Raises InputError for a folder of other files, and for one that
        cannot be written."""
        if not is_library(folder):
            if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
                raise InputError(
                    f"{folder}: holds other files and no library; name a new folder, or a pack ({PACK_SUFFIX})"
                )
            _write_index(folder, _Index())
        return cls(folder)

    def _read(self, name: str, stamp: Stamp) -> StoredPack:
        path = self.folder / name
        try:
            name.encode()
            with path.open("rb") as file:
                return _stored_pack(file, path, stamp)
        except UnicodeEncodeError as error:
            raise InputError(f"{path}: the name is not Unicode; rename the file") from error
        except OSError as error:
            raise InputError(
                f"{path}: cannot be read ({error.strerror}); check the disk and its permissions"
            ) from error

    def _take(self, name: str, pack: StoredPack) -> None:
        self.packs[name] = pack
        for texture in pack.textures:
            self.textures.setdefault((pack.settings, texture.pixel_hash), (name, texture))

    def add(self, data: bytes) -> bool:
        """Add a pack, given as the bytes of its file. Return False, without adding, if the library holds all its textures in these
        settings.

        Raises InputError if `data` are no pack, or cannot be written.
        """
        name = f"{hashlib.sha256(data).hexdigest()[:NAME_DIGITS]}{PACK_SUFFIX}"
        path = self.folder / name
        pack = _stored_pack(io.BytesIO(data), path, (0, 0))
        if all((pack.settings, texture.pixel_hash) in self.textures for texture in pack.textures):
            return False
        write_bytes(path, data)
        status = path.stat()
        self._take(name, msgspec.structs.replace(pack, stamp=(status.st_size, status.st_mtime_ns)))
        return True

    def remember(self, images: Mapping[str, ImageFile]) -> None:
        """Record facts about image files, by path. The index is saved every 30 seconds."""
        self.images.update(images)
        if time.monotonic() - self._saved > SECONDS_BETWEEN_SAVES:
            self.save()

    def save(self) -> None:
        """Write the index. Raises InputError if that fails."""
        _write_index(self.folder, _Index(packs=self.packs, images=self.images))
        self._saved = time.monotonic()

    def packs_with(self, wanted: Container[str] | None = None) -> dict[str, dict[str, set[str]]]:
        """Return pixel hashes in `wanted` (None: all) that packs hold, by settings key and pack.

        The settings key with the most textures comes first; packs are sorted by path.
        """
        hashes: dict[str, dict[str, set[str]]] = {}
        for (settings, pixel_hash), (name, _) in self.textures.items():
            if wanted is None or pixel_hash in wanted:
                hashes.setdefault(settings, {}).setdefault(name, set()).add(pixel_hash)
        count = {key: sum(map(len, packs.values())) for key, packs in hashes.items()}
        return {key: hashes[key] for key in sorted(hashes, key=lambda key: (-count[key], key))}

    def problems(self) -> Iterator[str]:
        """Read every pack completely, and yield one line for each damaged one."""
        yield from self.unreadable.values()
        for name in self.packs:
            path = self.folder / name
            try:
                data = pack_file(path)
                parsed_pack(path, data)
            except InputError as error:
                yield str(error)
                continue
            if len(path.stem) == NAME_DIGITS and path.stem != hashlib.sha256(data).hexdigest()[:NAME_DIGITS]:
                yield f"{path}: its bytes have changed since it was written; delete it and encode its textures again"


def _write_index(folder: Path, index: _Index) -> None:
    text = _encoder.encode(index)
    write_bytes(folder / INDEX_FILE, _checksum(text) + b"\n" + text)


def library_packs(folder: Path, wanted: Container[str] | None = None, most: int | None = None) -> list[Pack]:
    """Return the textures of a library whose pixel hash is in `wanted` (None: all), as one pack for each settings key.

    Packs with the most textures come first, at most `most` of them (None: all). Raises InputError if the library or a pack cannot be
    read.
    """
    chosen = list(Library(folder).packs_with(wanted).values())[:most]
    return [joined_textures(Path(folder), packs) for packs in chosen]
