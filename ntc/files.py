"""Atomic file writing: a reader sees the old file or the new one, never half of one."""

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from ntc.errors import InputError


@contextmanager
def atomic_path(destination: Path) -> Iterator[Path]:
    """Yield a temporary path beside `destination` that replaces it when the block ends without an exception.

    The temporary file keeps the destination's suffix, because image writers choose the format by it.
    Raises InputError where the folder cannot be written; on any exception the temporary file is removed.
    """
    destination = Path(destination)
    try:
        destination.parent.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(
            dir=destination.parent, prefix=f".{destination.stem}.", suffix=destination.suffix
        )
    except OSError as error:
        raise InputError(f"{destination}: cannot be written ({error.strerror}); choose a writable folder") from error
    os.close(handle)
    temporary = Path(name)
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


def write_bytes(destination: Path, data: bytes) -> None:
    """Write `data` to `destination` atomically."""
    with atomic_path(destination) as temporary:
        temporary.write_bytes(data)


def write_text(destination: Path, text: str) -> None:
    """Write `text` as UTF-8 to `destination` atomically."""
    write_bytes(destination, text.encode("utf-8"))
