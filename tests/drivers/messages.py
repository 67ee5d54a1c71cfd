"""Keeps what drivers write on stderr apart from what the program writes there.

Drivers of OpenGL and Vulkan look for folders of the user's session, and say so where one is missing, as on a fresh machine. With
mesa-vulkan-drivers, Vulkan's device selection asks libwayland, which writes "error: XDG_RUNTIME_DIR is invalid or not set".
"""

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Final

RUNTIME_VARIABLE: Final = "XDG_RUNTIME_DIR"
"""Environment variable: folder for sockets, for its user alone. No test finds the user's own Wayland screen in a private one."""
SHADERS_VARIABLE: Final = "MESA_SHADER_CACHE_DIR"
"""Environment variable: folder in which Mesa caches compiled shaders."""
OWN_CACHE: Final = Path(__file__).resolve().parents[2] / ".shader_cache"
"""Folder for compiled shaders where the user's folder for caches cannot be written, and for what compilers have said of them."""


@contextmanager
def own_session_folders() -> Iterator[None]:
    """Set both variables for this process and for those that it starts; their private folder is removed at the end.

    The shader cache stays for the next run, which takes a fraction of the time with it: where the user has it, else in OWN_CACHE.
    """
    with tempfile.TemporaryDirectory(prefix="ntc-viewer-", ignore_cleanup_errors=True) as private:
        os.environ[RUNTIME_VARIABLE] = private
        folders = (folder for folder in (_user_cache(), OWN_CACHE) if folder is not None and _can_be_written(folder))
        os.environ.setdefault(SHADERS_VARIABLE, str(next(folders, private)))
        yield


def _user_cache() -> Path | None:
    """The folder of this user's caches, or None for a user without a home."""
    try:
        return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    except RuntimeError:
        return None


def _can_be_written(folder: Path) -> bool:
    """Whether files can be written in `folder`. Like Mesa, it makes the folder, but none above it."""
    if not folder.is_absolute():
        return False
    try:
        folder.mkdir(mode=0o700, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return True
    except OSError:
        return False


def error_line(stderr: str) -> str:
    """The program's only line that starts with `error: `. Fails for none, for several, and for a traceback.

    Other lines are left out: they may be warnings of a driver.
    """
    assert "Traceback" not in stderr, stderr
    lines = [line for line in stderr.splitlines() if line.startswith("error: ")]
    assert len(lines) == 1, stderr
    return lines[0]
