"""Looking after a library: whether all of it is as it was written, and fewer, larger shards."""

import hashlib
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from ntc.codec.model import Pack
from ntc.errors import InputError
from ntc.io import read_file
from ntc.library.index import NAME_DIGITS, SHARD_SUFFIX, SHARDS_FOLDER, LibraryIndex, read_index, shard_path
from ntc.library.joining import joined_pack
from ntc.library.reading import read_shards
from ntc.library.records import ImageFiles, Shard
from ntc.library.writer import LibraryWriter, shard_of
from ntc.pack.file import pack_bytes, read_pack

SMALL_SHARD = 1 << 22
"""Bytes below which shards are joined."""
LARGEST_JOINED = 1 << 26
"""Bytes of shards that are joined into one, at most."""
_SHARD_NAME = re.compile(rf"[0-9a-f]{{{NAME_DIGITS}}}{re.escape(SHARD_SUFFIX)}")


def problems(folder: Path) -> Iterator[str]:
    """One line for everything in the library in `folder` that is not as it was written. Reads every byte; changes nothing.

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
        return f"{path}: its bytes are not those that were written"
    try:
        pack = read_pack(path)
    except InputError as error:
        return str(error)
    return "" if shard_of(pack, data) == shard else f"{path}: the index says something else of it"


def _not_in_index(index: LibraryIndex) -> list[Path]:
    """Files of shards that the index does not name: a process ended before it could say that they are there."""
    named = {shard_path(index.folder, digest) for digest in index.shards}
    found = sorted((index.folder / SHARDS_FOLDER).glob(f"*{SHARD_SUFFIX}"))
    return [path for path in found if path not in named and _SHARD_NAME.fullmatch(path.name)]


@dataclass(frozen=True)
class Compaction:
    """What `compact` came to."""

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
    """`shards`, of which small ones of one key are joined; the files of joined ones are written, the small ones left."""
    index = LibraryIndex(writer.index.folder)
    for shard in shards:
        index.take(shard)
    groups = [found for each in _by_key(index).values() for found in _bundles(each)]
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


def _by_key(index: LibraryIndex) -> dict[str, list[tuple[Shard, frozenset[str]]]]:
    return index.shards_with({pixel_hash for _, pixel_hash in index.places})


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
