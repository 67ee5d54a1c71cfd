"""Memory of a test process, and its limit: what tests that are over have drawn and trained is let go of."""

import ctypes
from pathlib import Path
from typing import Final

STATUS: Final = Path("/proc/self/status")
MOST_MEGABYTES: Final = 1500
"""Memory that tests may add to that of a process with all its imports; `bash tests/run` has two processes at a time."""
MOST_GROWTH: Final = 50
"""Megabytes that a test process may grow before what tests have left is freed. That takes a part of a second."""


def megabytes() -> int:
    """Memory of this process in MB, without pages of files, such as those of libraries. 0 on other systems than Linux."""
    if not STATUS.exists():
        return 0
    lines = (line.split() for line in STATUS.read_text(encoding="ascii").splitlines())
    return next((int(line[1]) * 1024 // 1_000_000 for line in lines if line[0] == "RssAnon:"), 0)


def trim() -> None:
    """Give freed memory back to the system, where the C library can: it keeps much of what threads and compilers have freed."""
    if STATUS.exists() and hasattr(library := ctypes.CDLL(None), "malloc_trim"):
        library.malloc_trim(0)


def excess(most: int) -> str:
    """Message where this process has more than `most` MB, else nothing."""
    used = megabytes()
    if used <= most:
        return ""
    return f"the test process has {used} MB of memory, above {most} MB: free what this test or one before it holds"
