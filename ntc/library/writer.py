"""Adding to a library: a shard is written whole, then one line of the index says that it is there."""

import hashlib
import os
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from types import TracebackType

from ntc.codec.latents import latent_levels
from ntc.codec.model import EncodedTexture, Pack
from ntc.codec.quality import finite_or_none
from ntc.codec.registry import codec_of
from ntc.errors import InputError
from ntc.io import hold_lock, write_bytes
from ntc.library.index import INDEX_FILE, SHARDS_FOLDER, LibraryIndex, is_library, read_index, shard_path
from ntc.library.joining import settings_of
from ntc.library.records import Beginning, ImageFile, ImageFiles, Record, Shard, StoredTexture, record_line
from ntc.pack.file import pack_bytes

LOCK_FILE = "lock"


def stored_texture(texture: EncodedTexture, pack: Pack) -> StoredTexture:
    """What the index says of a texture of `pack`."""
    levels = latent_levels(texture.width, texture.height, pack.config)
    texels = sum(level.texel_width * level.texel_height for level in levels)
    stored = codec_of(pack.config).texture_bytes(texture, pack.config)
    bits = 8.0 * (stored.latents + stored.constants)
    psnr_db = finite_or_none(texture.psnr_db)
    return StoredTexture(texture.pixel_hash, texture.name, texture.width, texture.height, bits / texels, psnr_db)


def shard_of(pack: Pack, data: bytes) -> Shard:
    """The record of a shard with the bytes `data`, which are those of `pack`."""
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

    def __exit__(
        self, _kind: type[BaseException] | None, _error: BaseException | None, _at: TracebackType | None
    ) -> None:
        self._unlock()

    def add(self, shard: Shard, data: bytes) -> bool:
        """Keep a shard, unless every texture of it is there so encoded: then False. Raises InputError where it cannot be written, or
        `data` are not what the record says."""
        if hashlib.sha256(data).hexdigest() != shard.digest:
            raise InputError(f"shard {shard.digest[:12]}: came with other bytes than were sent; they are not kept")
        if all(self.index.holds(shard.settings, texture.pixel_hash) for texture in shard.textures):
            return False
        self.add_file(shard, data)
        self._append(shard)
        return True

    def add_file(self, shard: Shard, data: bytes) -> None:
        """Write the file of a shard that the index does not name yet."""
        write_bytes(shard_path(self._folder, shard.digest), data)

    def add_pack(self, pack: Pack) -> bool:
        """`add` of a pack."""
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
    """An open file that no other process holds the lock of. Raises InputError."""
    try:
        if folder.is_dir() and any(folder.iterdir()) and not (is_library(folder) or (folder / LOCK_FILE).exists()):
            raise InputError(f"{folder}: holds other files and no library; name an empty folder, or a new one")
        (folder / SHARDS_FOLDER).mkdir(parents=True, exist_ok=True)
        handle = os.open(folder / LOCK_FILE, os.O_RDWR | os.O_CREAT, 0o666)
    except OSError as error:
        raise InputError(f"{folder}: no library can be written there ({error.strerror}); choose a folder") from error
    try:
        hold_lock(handle)
    except BlockingIOError as error:
        os.close(handle)
        raise InputError(f"{folder}: another process adds to this library; wait until it has ended") from error
    except OSError:
        # A file system without locks.
        return handle
    return handle
