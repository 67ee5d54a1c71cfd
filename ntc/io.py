"""Reading whole files, and atomic writing: a reader sees the old file or the new one, never half of one."""

import errno
import json
import os
import shutil
import stat
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from ntc.errors import InputError

if sys.platform != "win32":
    import fcntl

PARTIAL_MARK = ".partial"
"""Mark before the suffix of a file that is being written, or that a killed process left."""
STEM_SHOWN = 100
"""Letters of the destination's name that the temporary one repeats: both together must stay a valid name."""
STALE_SECONDS = 24 * 3600.0
"""Age from which leftovers are removed where files cannot be locked."""
LARGEST_FILE = 1 << 32
"""Bytes: the most that is read of any one file; a GLB cannot be longer."""


def read_file(path: Path, largest: int = LARGEST_FILE) -> bytes:
    """Return the bytes of the regular file at `path`, which has at most `largest`.

    Raises OSError, whose `strerror` says why, for anything that is not a regular file (a pipe would block, a device may
    never end), for longer files, before memory is allocated, and for a file that changes while it is read.
    """
    handle = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0))
    with os.fdopen(handle, "rb") as file:
        status = os.fstat(file.fileno())
        if stat.S_ISDIR(status.st_mode):
            raise IsADirectoryError(errno.EISDIR, "it is a folder", str(path))
        if not stat.S_ISREG(status.st_mode):
            raise OSError(errno.EINVAL, "it is no regular file", str(path))
        if status.st_size > largest:
            raise OSError(errno.EFBIG, f"it has {status.st_size} bytes, at most {largest} are read", str(path))
        data = file.read(status.st_size)
        after = os.fstat(file.fileno())
        if (len(data), after.st_mtime_ns, after.st_size) != (status.st_size, status.st_mtime_ns, status.st_size):
            raise OSError(errno.EAGAIN, "it changed while it was read", str(path))
        return data


def _prefix(destination: Path) -> str:
    return f".{destination.stem[:STEM_SHOWN]}."


def is_partial(path: Path) -> bool:
    """Return whether `path` is named like a file that is being written, or that a killed process left."""
    return path.name.startswith(".") and (path.stem.endswith(PARTIAL_MARK) or path.suffix == PARTIAL_MARK)


def hold_lock(handle: int) -> None:
    """Hold the lock of the open file as long as it is open. Raises BlockingIOError where another process holds it."""
    if sys.platform != "win32":
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)


def _is_stale(leftover: Path) -> bool:
    """Return whether no process writes `leftover` any more: its writer would hold the lock. Raises OSError without locks."""
    if sys.platform == "win32":
        return time.time() - leftover.stat().st_mtime > STALE_SECONDS
    handle = os.open(leftover, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK)
    try:
        hold_lock(handle)
    except BlockingIOError:
        return False
    finally:
        os.close(handle)
    return True


def _remove_leftovers(destination: Path) -> None:
    """Remove what killed processes left of earlier attempts to write `destination`."""
    prefix, suffix = _prefix(destination), f"{PARTIAL_MARK}{destination.suffix}"
    with suppress(OSError), os.scandir(destination.parent) as entries:
        # Names alone: a folder may hold 100,000 files, and making a Path of each takes longer than writing one.
        for name in [entry.name for entry in entries if entry.name.startswith(prefix)]:
            path = destination.with_name(name)
            with suppress(OSError):
                if name.endswith(suffix) and _is_stale(path):
                    path.unlink()


def _make_temporary(destination: Path) -> tuple[int, Path]:
    """Return (open and locked file, its path) beside `destination`. Raises OSError."""
    while True:
        handle, name = tempfile.mkstemp(
            dir=destination.parent, prefix=_prefix(destination), suffix=f"{PARTIAL_MARK}{destination.suffix}"
        )
        # Another process may take the new file for a leftover before it is locked: then make one more.
        with suppress(OSError):  # A file system without locks.
            try:
                hold_lock(handle)
            except BlockingIOError:
                os.close(handle)
                continue
        if sys.platform == "win32" or os.fstat(handle).st_nlink > 0:
            return handle, Path(name)
        os.close(handle)


@contextmanager
def atomic_path(destination: Path) -> Iterator[Path]:
    """Yield a temporary path beside `destination` that replaces it when the block ends without an exception.

    The temporary file keeps the destination's suffix, because image writers choose the format by it.
    Raises InputError where the folder cannot be written; on any exception the temporary file is removed. One that
    a killed process left is removed by the next write of the same destination.
    """
    destination = Path(destination)
    try:
        destination.parent.mkdir(parents=True, exist_ok=True)
        _remove_leftovers(destination)
        handle, temporary = _make_temporary(destination)
    except OSError as error:
        raise InputError(f"{destination}: cannot be written ({error.strerror}); choose a writable folder") from error
    if sys.platform == "win32":
        # Windows does not replace a file that is open.
        os.close(handle)
    try:
        yield temporary
        # mkstemp creates private files; what the user gets should follow their umask.
        umask = os.umask(0)
        os.umask(umask)
        temporary.chmod(0o666 & ~umask)
        with temporary.open("rb") as written:
            os.fsync(written.fileno())
        temporary.replace(destination)
    except OSError as error:
        raise InputError(
            f"{destination}: cannot be written ({error.strerror or error}); check space and permissions"
        ) from error
    finally:
        with suppress(FileNotFoundError):
            temporary.unlink()
        if sys.platform != "win32":
            os.close(handle)


@contextmanager
def atomic_folder(destination: Path, mark: str) -> Iterator[Path]:
    """Yield a new folder beside `destination`, which takes its place when the block ends without an exception.

    What it replaces is an empty folder, or one written earlier: such a folder has a file called `mark`. Raises InputError where there
    is something else, and where nothing can be written; then all is as it was.
    """
    if destination.exists() and not destination.is_dir():
        raise InputError(f"{destination}: is a file; name a folder")
    if destination.is_dir() and any(destination.iterdir()) and not (destination / mark).is_file():
        raise InputError(f"{destination}: holds other files than an earlier export; name a new or empty folder")
    try:
        destination.parent.mkdir(parents=True, exist_ok=True)
        prefix = f".{destination.name[:STEM_SHOWN]}."
        made = Path(tempfile.mkdtemp(prefix=prefix, suffix=PARTIAL_MARK, dir=destination.parent))
    except OSError as error:
        raise InputError(f"{destination}: cannot be written ({error.strerror}); choose a writable folder") from error
    before = made / "before"
    try:
        content = made / "content"
        content.mkdir()
        yield content
        if destination.exists():
            destination.rename(before)
        try:
            content.rename(destination)
        except OSError:
            if before.exists():
                before.rename(destination)
            raise
    except OSError as error:
        raise InputError(f"{destination}: cannot be written ({error.strerror}); check space and permissions") from error
    finally:
        shutil.rmtree(made, ignore_errors=True)


def numbered_path(path: Path) -> Path:
    """Return `path` where there is no such file, else the same name with the first free number: `view.json`, `view-2.json`."""
    number, free = 1, path
    while os.path.lexists(free):
        number += 1
        free = path.with_name(f"{path.stem}-{number}{path.suffix}")
    return free


def write_bytes(destination: Path, data: bytes) -> None:
    """Write `data` to `destination` atomically."""
    with atomic_path(destination) as temporary:
        temporary.write_bytes(data)


def write_text(destination: Path, text: str) -> None:
    """Write `text` as UTF-8 to `destination` atomically."""
    write_bytes(destination, text.encode("utf-8"))


LENGTH_BYTES = 8
"""A safetensors file begins with the length of its JSON header."""


def file_metadata(data: bytes) -> Mapping[str, Any]:
    """Return the string metadata of a safetensors file that safetensors has accepted; empty where it has none."""
    length = int.from_bytes(data[:LENGTH_BYTES], "little")
    header = json.loads(data[LENGTH_BYTES : LENGTH_BYTES + length])
    return header.get("__metadata__") or {}
