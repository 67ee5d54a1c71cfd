"""Processes as the system sees them: whether one has ended, and whether it ends with its parent."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

SECONDS = 120.0


def state_of(process: int) -> str:
    """State of a process by /proc: Z has ended; empty: there is none."""
    try:
        return Path(f"/proc/{process}/stat").read_text().split()[2]
    except OSError:
        return ""


def wait_for_end(process: int) -> None:
    began = time.monotonic()
    while state_of(process) not in ("", "Z"):
        assert time.monotonic() - began < SECONDS
        time.sleep(0.05)


def assert_ends_with_its_parent(code: str) -> None:
    """Run `code`, which prints the id of a process that it has started; kill the parent, and wait for the end of the child."""
    parent = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True)
    assert parent.stdout is not None
    child = int(parent.stdout.readline())
    os.kill(parent.pid, signal.SIGKILL)
    parent.wait()
    parent.stdout.close()
    wait_for_end(child)
