"""Writing a library, and looking after it: whether all of it is as it was written, and fewer, larger shards."""

import hashlib
import os
import re
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from ntc.codec.model import EncodedTexture, Pack
from ntc.codec.quality import finite_or_none
from ntc.codec.registry import codec_of
from ntc.errors import InputError
from ntc.io import hold_lock, read_file, write_bytes
from ntc.library.index import (
    INDEX_FILE,
    NAME_DIGITS,
    SHARD_SUFFIX,
    SHARDS_FOLDER,
    Beginning,
    ImageFile,
    ImageFiles,
    LibraryIndex,
    Record,
    Shard,
    StoredTexture,
    is_library,
    read_index,
    record_line,
    shard_path,
)
from ntc.library.reading import joined_pack, read_shards, settings_of
from ntc.pack.file import pack_bytes, read_pack

LOCK_FILE = "lock"


def stored_texture(texture: EncodedTexture, pack: Pack) -> StoredTexture:
    """Return what the index says of a texture of `pack`."""
    texels = texture.width * texture.height
    stored = codec_of(pack.config).texture_bytes(texture, pack.config)
    bits = 8.0 * (stored.latents + stored.constants)
    psnr_db = finite_or_none(texture.psnr_db)
    return StoredTexture(texture.pixel_hash, texture.name, texture.width, texture.height, bits / texels, psnr_db)


def shard_of(pack: Pack, data: bytes) -> Shard:
    """Return the record of a shard with the bytes `data`, which are those of `pack`."""
    textures = tuple(stored_texture(texture, pack) for texture in pack.textures)
    return Shard(hashlib.sha256(data).hexdigest(), len(data), settings_of(pack), pack.grouping.name, textures)


class LibraryWriter:
    """The only process that adds to a library. Use in a `with` block; whatever ends it, what was added stays."""

    def __init__(self, folder: Path) -> None:
        """Makes the library where there is none. Raises InputError where that is not possible, or another process adds to it."""
        self._folder = Path(folder)
        self._lock = _locked(self._folder)
        try:
            if not is_library(self._folder):
                write_bytes(self._folder / INDEX_FILE, record_line(Beginning()))
            self.index: LibraryIndex = read_index(self._folder)
            self._cut_torn_line()
        except BaseException:
            self._unlock()
            raise

    def __enter__(self) -> "LibraryWriter":
        return self

    def __exit__(self, *_exception: object) -> None:
        self._unlock()

    def add(self, shard: Shard, data: bytes) -> bool:
        """Keep a shard, unless every texture of it is there so encoded: then False. Raises InputError where it cannot be written, or
        `data` are not what the record says."""
        if hashlib.sha256(data).hexdigest() != shard.digest:
            raise InputError(f"shard {shard.digest[:12]}: arrived damaged; it is not kept")
        if all(self.index.holds(shard.settings, texture.pixel_hash) for texture in shard.textures):
            return False
        self.add_file(shard, data)
        self._append(shard)
        return True

    def add_file(self, shard: Shard, data: bytes) -> None:
        """Write the file of a shard that the index does not name yet."""
        write_bytes(shard_path(self._folder, shard.digest), data)

    def add_pack(self, pack: Pack) -> bool:
        """Keep a pack as a shard, as `add` does."""
        data = pack_bytes(pack)
        return self.add(shard_of(pack, data), data)

    def remember(self, files: Sequence[ImageFile]) -> None:
        """Note what was found in image files."""
        if files:
            self._append(ImageFiles(tuple(files)))

    def replace_index(self, records: Sequence[Record]) -> None:
        """Write the index anew, of these records. Raises InputError."""
        lines = [record_line(Beginning()), *map(record_line, records)]
        write_bytes(self._folder / INDEX_FILE, b"".join(lines))
        self.index = read_index(self._folder)

    def _append(self, record: Record) -> None:
        path, line = self._folder / INDEX_FILE, record_line(record)
        try:
            with path.open("r+b") as file:
                file.seek(self.index.whole_bytes)
                file.write(line)
                file.flush()
                os.fsync(file.fileno())
        except OSError as error:
            self._cut_torn_line()
            raise InputError(f"{path}: cannot be written ({error.strerror}); check space and permissions") from error
        self.index.whole_bytes += len(line)
        self.index.take(record)

    def _cut_torn_line(self) -> None:
        with suppress(OSError):
            os.truncate(self._folder / INDEX_FILE, self.index.whole_bytes)

    def _unlock(self) -> None:
        os.close(self._lock)


def _locked(folder: Path) -> int:
    """Open and lock the library's lock file; return its handle. Raises InputError."""
    try:
        if folder.is_dir() and any(folder.iterdir()) and not (is_library(folder) or (folder / LOCK_FILE).exists()):
            raise InputError(f"{folder}: holds other files and no library; name an empty folder, or a new one")
        (folder / SHARDS_FOLDER).mkdir(parents=True, exist_ok=True)
        handle = os.open(folder / LOCK_FILE, os.O_RDWR | os.O_CREAT, 0o666)
    except OSError as error:
        raise InputError(f"{folder}: cannot be written ({error.strerror}); choose a writable folder") from error
    try:
        hold_lock(handle)
    except BlockingIOError as error:
        os.close(handle)
        raise InputError(f"{folder}: another process is writing to this library; wait until it ends") from error
    except OSError:
        # A file system without locks.
        return handle
    return handle


SMALL_SHARD = 1 << 22
"""Bytes below which shards are joined."""
LARGEST_JOINED = 1 << 26
"""Bytes of shards that are joined into one, at most."""
_SHARD_NAME = re.compile(rf"[0-9a-f]{{{NAME_DIGITS}}}{re.escape(SHARD_SUFFIX)}")


def problems(folder: Path) -> Iterator[str]:
    """Yield one line for everything in the library in `folder` that is not as it was written. Reads every byte; changes nothing.

    Raises InputError where there is no library.
    """
    index = read_index(folder)
    for number in index.damaged_lines:
        yield f"{index.folder}: line {number} of the index is damaged"
    for shard in index.shards.values():
        try:
            problem = _problem(index, shard)
        except InputError as error:
            problem = str(error)
        if problem:
            yield problem
    for path in _not_in_index(index):
        yield f"{path}: is not in the index"


def _problem(index: LibraryIndex, shard: Shard) -> str:
    path = index.path(shard)
    try:
        data = read_file(path)
    except FileNotFoundError:
        return f"{path}: is missing"
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); check the disk and its permissions") from error
    if hashlib.sha256(data).hexdigest() != shard.digest:
        return f"{path}: its bytes have changed since it was written"
    try:
        pack = read_pack(path)
    except InputError as error:
        return str(error)
    return "" if shard_of(pack, data) == shard else f"{path}: the index describes other content"


def _not_in_index(index: LibraryIndex) -> list[Path]:
    """Return files of shards that the index does not name: a process ended before it could say that they are there."""
    named = {shard_path(index.folder, digest) for digest in index.shards}
    found = sorted((index.folder / SHARDS_FOLDER).glob(f"*{SHARD_SUFFIX}"))
    return [path for path in found if path not in named and _SHARD_NAME.fullmatch(path.name)]


@dataclass(frozen=True)
class Compaction:
    """The result of `compact`."""

    shards_before: int
    shards: int
    adopted: int
    """Shards that were whole, but not in the index."""
    dropped: tuple[str, ...]
    """Lines about what was lost or damaged: those textures are to be encoded again."""
    textures: int


def compact(writer: LibraryWriter) -> Compaction:
    """Take shards that the index lacks into it and damaged ones out, join small ones of one settings key, and write the index anew.

    Shards that are no longer named are removed last, so that a compaction that is stopped loses nothing. Raises InputError, also for
    a shard that is there and cannot be read: it may be whole.
    """
    before = len(writer.index.shards)
    adopted = _adopted(writer)
    dropped, kept = list[str](), list[Shard]()
    for shard in writer.index.shards.values():
        problem = _problem(writer.index, shard)
        if problem:
            dropped.append(problem)
        else:
            kept.append(shard)
    kept = list(_joined(writer, kept))
    files = ImageFiles(tuple(writer.index.files[path] for path in sorted(writer.index.files)))
    kept.sort(key=lambda shard: (shard.settings, shard.digest))
    writer.replace_index([*kept, *([files] if files.files else [])])
    for path in _not_in_index(writer.index):
        path.unlink(missing_ok=True)
    textures = len(writer.index.places)
    return Compaction(before, len(kept), adopted, tuple(dropped), textures)


def _adopted(writer: LibraryWriter) -> int:
    count = 0
    for path in _not_in_index(writer.index):
        try:
            pack = read_pack(path)
            data = pack_bytes(pack)
        except InputError:
            continue
        if path == shard_path(writer.index.folder, shard_of(pack, data).digest):
            count += writer.add(shard_of(pack, data), data)
    return count


def _joined(writer: LibraryWriter, shards: list[Shard]) -> Iterator[Shard]:
    """Yield `shards`, of which small ones of one key are joined; the files of joined ones are written, the small ones left."""
    index = LibraryIndex(writer.index.folder)
    for shard in shards:
        index.take(shard)
    by_key = index.shards_with({pixel_hash for _, pixel_hash in index.places})
    groups = [found for each in by_key.values() for found in _bundles(each)]
    for group in groups:
        whole = [shard for shard, hashes in group if len(hashes) == len(shard.textures)]
        if len(group) == 1 and whole:
            yield whole[0]
            continue
        pack: Pack = joined_pack([read_shards(index, [each]) for each in group])
        data = pack_bytes(pack)
        joined = shard_of(pack, data)
        writer.add_file(joined, data)
        yield joined


def _bundles(shards: list[tuple[Shard, frozenset[str]]]) -> Iterator[list[tuple[Shard, frozenset[str]]]]:
    """Small shards together, up to a size; large ones alone. In the order of digests, so that equal libraries stay equal."""
    bundle: list[tuple[Shard, frozenset[str]]] = []
    size = 0
    for shard, hashes in sorted(shards, key=lambda each: each[0].digest):
        if shard.bytes >= SMALL_SHARD:
            yield [(shard, hashes)]
            continue
        if bundle and size + shard.bytes > LARGEST_JOINED:
            yield bundle
            bundle, size = [], 0
        bundle.append((shard, hashes))
        size += shard.bytes
    if bundle:
        yield bundle
