"""A virtual screen for windows that nobody watches."""

import os
import shutil
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from ntc.errors import InputError


def remembering_in(folder: Path, display: str) -> dict[str, str]:
    """The environment of a window on `display` whose settings, caches and data lie in `folder`, and nowhere else."""
    variables = {f"NTC_VIEWER_{kind}_DIR": str(folder / kind.lower()) for kind in ("CONFIG", "CACHE", "DATA")}
    return {**os.environ, **variables, "DISPLAY": display}


@contextmanager
def virtual_display(width: int = 1024, height: int = 640) -> Iterator[str]:
    """DISPLAY of a screen of so many pixels, while the block runs. Raises InputError where there can be none."""
    if shutil.which("Xvfb") is None:
        raise InputError("Xvfb is not installed: no virtual screen for a window")
    reading, writing = os.pipe()
    server = subprocess.Popen(
        # A number of this process: a server that ends removes the socket of one that has just taken the same number.
        # Nor does it start anew when a program closes its only window: the next one would find no screen.
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
