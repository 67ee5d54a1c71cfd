"""The window in a process of its own, on a virtual screen."""

import os
import subprocess
import sys
from pathlib import Path


def run_window(
    display: str, folder: Path, *arguments: str, cwd: Path | None = None, timeout: float = 120.0, **variables: str
) -> subprocess.CompletedProcess[str]:
    """What `python ARGUMENTS` does with its settings in `folder`; run there, or in `cwd`, with further environment variables."""
    return subprocess.run(
        [sys.executable, *arguments],
        cwd=cwd or folder,
        env={
            **os.environ,
            "DISPLAY": display,
            "NTC_VIEWER_CONFIG_DIR": str(folder / "settings"),
            **variables,
        },
        capture_output=True,
        text=True,
        timeout=timeout,
        check=False,
    )
