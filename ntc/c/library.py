"""libntc as a shared library. `python -m ntc.c.library` builds it beside its source, as installation does if there is a C compiler.

Only the standard library is imported, because the build of the package runs this file.
"""

import ctypes
import functools
import hashlib
import os
import shutil
import subprocess
import sys
from pathlib import Path

FOLDER = Path(__file__).parent
SUFFIX = {"win32": ".dll", "darwin": ".dylib"}.get(sys.platform, ".so")
FLAGS = ("-std=c99", "-O3", "-shared", "-fPIC")


class Options(ctypes.Structure):
    """The struct `ntc_options` of ntc.h."""

    _fields_ = (
        ("allocate", ctypes.c_void_p),
        ("release", ctypes.c_void_p),
        ("user", ctypes.c_void_p),
        ("tables", ctypes.c_char_p),
        ("tables_bytes", ctypes.c_size_t),
    )


def library_path() -> Path:
    """Return the path of the shared library. Its name holds a hash of the source, so a library of another source is not loaded."""
    source = b"".join((FOLDER / name).read_bytes() for name in ("ntc.h", "ntc.c"))
    return FOLDER / f"libntc-{hashlib.sha256(source).hexdigest()[:12]}{SUFFIX}"


def build() -> Path | None:
    """Compile libntc beside its source with the C compiler in `CC`, or the system's. Return its path, or None if that fails."""
    compiler = os.environ.get("CC") or next((name for name in ("cc", "gcc", "clang") if shutil.which(name)), None)
    path = library_path()
    if compiler is None:
        return None
    # A new file replaces the old one, because processes may have the old one loaded.
    made = path.with_name(f"{path.name}.{os.getpid()}")
    try:
        subprocess.run(
            [*compiler.split(), *FLAGS, FOLDER / "ntc.c", "-lm", "-o", made], check=True, capture_output=True
        )
        for old in FOLDER.glob(f"libntc-*{SUFFIX}"):
            old.unlink()
        made.replace(path)
    except (OSError, subprocess.CalledProcessError):
        made.unlink(missing_ok=True)
        return None
    return path


@functools.cache
def library() -> ctypes.CDLL | None:
    """Return libntc, or None if it was not built or cannot be loaded."""
    try:
        libntc = ctypes.CDLL(str(library_path()))
    except OSError:
        return None
    libntc.ntc_close.restype = None
    return libntc


if __name__ == "__main__":
    built = build()
    if built is None:
        sys.exit("error: libntc was not built; install a C compiler, or name one by CC")
    sys.stdout.write(f"wrote {built}\n")
