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
    never end) and for longer files, before memory is taken; and for a file that changes while it is read, for its beginning
    may be of the old one and its end of the new one.
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
