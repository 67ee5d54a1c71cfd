"""Virtual screen for windows without a user."""

import os
import shutil
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from ntc.errors import InputError


def remembering_in(folder: Path, display: str) -> dict[str, str]:
    """Return the environment of a window on `display` that has its settings, caches and data in `folder`."""
    variables = {f"NTC_VIEWER_{kind}_DIR": str(folder / kind.lower()) for kind in ("CONFIG", "CACHE", "DATA")}
    return {**os.environ, **variables, "DISPLAY": display}


@contextmanager
def virtual_display(width: int = 1024, height: int = 640) -> Iterator[str]:
    """Yield the DISPLAY of a screen of `width` x `height` pixels. Raises InputError where it cannot start."""
    if shutil.which("Xvfb") is None:
        raise InputError("Xvfb is not installed: no virtual screen for a window")
    reading, writing = os.pipe()
    server = subprocess.Popen(
        # The number depends on this process, because an ending server removes the socket of another one with its number.
        # -noreset: without it the server restarts when a program closes its last window, and the next window has no screen.
        f"Xvfb :{1000 + os.getpid() % 50000} -displayfd {writing} -screen 0 {width}x{height}x24 -nolisten tcp -noreset".split(),
        pass_fds=[writing],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    os.close(writing)
    try:
        with os.fdopen(reading) as answer:
            number = answer.readline().strip()
        if not number:
            raise InputError("Xvfb did not start: no virtual screen for a window")
        yield f":{number}"
    finally:
        server.terminate()
        server.wait()
