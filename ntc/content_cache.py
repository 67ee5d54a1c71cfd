"""The one kind of cache on disk: a folder of files by content. It is bounded, and a damaged file counts as absent."""

import hashlib
from contextlib import suppress
from pathlib import Path
from typing import TypeVar

import msgspec

from ntc.errors import InputError
from ntc.io import is_partial, read_file, write_bytes

MOST_BYTES = 1 << 29
"""Limit of a folder in bytes."""
SUFFIX = ".cached"
DIGEST_BYTES = 16
TRIMS_PER_LIMIT = 8
"""Number of times that a folder is trimmed while as many bytes as its limit are written."""

Value = TypeVar("Value")


class ContentCache:
    """Bytes by key in a folder; several processes may use it. Errors of the disk cost time alone: what is absent is made again.

    The key names everything that the bytes follow from, and the version of what makes them.
    """

    def __init__(self, folder: Path | None, most_bytes: int = MOST_BYTES) -> None:
        """Use `folder`, with files of at most `most_bytes` together; None keeps nothing."""
        self._folder, self._most_bytes = folder, most_bytes
        self._until_trim = 0
        """Bytes to write before the folder is trimmed next."""

    def path(self, key: str) -> Path | None:
        """Return the path of a key's file. The name is a digest: nothing of the key becomes a path."""
        digest = hashlib.sha256(key.encode(errors="surrogateescape")).hexdigest()[:32]
        return None if self._folder is None else self._folder / f"{digest}{SUFFIX}"

    def read(self, key: str) -> bytes | None:
        """Return the bytes under `key` as they were written, None where they are absent or damaged."""
        path = self.path(key)
        if path is None:
            return None
        try:
            data = read_file(path, self._most_bytes + DIGEST_BYTES)
        except OSError:
            return None
        return data[DIGEST_BYTES:] if data[:DIGEST_BYTES] == _digest(data[DIGEST_BYTES:]) else None

    def write(self, key: str, data: bytes) -> None:
        """Write `data` under `key`; does nothing where the folder cannot be written."""
        path = self.path(key)
        if path is None:
            return
        with suppress(InputError):
            write_bytes(path, _digest(data) + data)
            self._until_trim -= len(data)
        if self._until_trim < 0:
            self._trim(path.parent)
            self._until_trim = self._most_bytes // TRIMS_PER_LIMIT

    def read_value(self, key: str, kind: type[Value]) -> Value | None:
        """Return the value of type `kind` under `key`, None where it is absent or of another type."""
        data = self.read(key)
        try:
            return None if data is None else msgspec.json.decode(data, type=kind)
        except ValueError:
            return None

    def write_value(self, key: str, value: object) -> None:
        """Write `value`, which msgspec can encode, under `key`."""
        self.write(key, msgspec.json.encode(value))

    def _trim(self, folder: Path) -> None:
        """Remove the oldest files until all together have at most the limit."""
        with suppress(OSError):
            files = [path for path in folder.glob(f"*{SUFFIX}") if path.is_file() and not is_partial(path)]
            by_age = sorted(((path.stat(), path) for path in files), key=lambda pair: pair[0].st_mtime_ns)
            excess = sum(status.st_size for status, _ in by_age) - self._most_bytes
            for status, path in by_age:
                if excess <= 0:
                    return
                path.unlink()
                excess -= status.st_size


def _digest(data: bytes) -> bytes:
    return hashlib.sha256(data).digest()[:DIGEST_BYTES]
