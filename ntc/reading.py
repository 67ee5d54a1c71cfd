"""Reading whole files that may be anything: a device, a pipe, a terabyte of holes."""

import errno
import os
import stat
from pathlib import Path

LARGEST_FILE = 1 << 32
"""Bytes: the most that is read of any one file; a GLB cannot be longer."""


def read_file(path: Path, largest: int = LARGEST_FILE) -> bytes:
    """The bytes of the regular file at `path`, which has at most `largest`.

    Raises OSError, whose `strerror` says so, for anything that is no regular file (a pipe would block, a device may
    never end) and for longer files, before memory is taken. A file that grows meanwhile is read as long as it was.
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
        return file.read(status.st_size)
