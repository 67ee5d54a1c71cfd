"""Seed the faults of seeded_faults.json one at a time in a copy of a checkout, and print which of them the tests catch."""

import argparse
import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Final

ROOT: Final = Path(__file__).resolve().parents[1]


@dataclass(frozen=True)
class Fault:
    """Fault, with the tests that should catch it."""

    name: str
    file: str
    old: str
    """Text that is in the file exactly once."""
    new: str
    test: str
    """File or node id, as pytest takes it."""


def copy_tracked(repository: Path, folder: Path) -> None:
    """Copy the files of `repository` that git tracks, as they are now, to `folder`."""
    listed = subprocess.run(["git", "ls-files", "-z"], cwd=repository, capture_output=True, text=True, check=True)
    for name in filter(None, listed.stdout.split("\0")):
        if (repository / name).is_file():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(repository / name, folder / name)


def status_of(test: str, folder: Path) -> int:
    """Return the exit status of pytest for `test` in the copy in `folder`."""
    command = [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider", test]
    environment = {**os.environ, "PYTHONPATH": str(folder)}
    return subprocess.run(command, cwd=folder, env=environment, capture_output=True, check=False).returncode


def outcome_of(fault: Fault, folder: Path) -> str:
    """Seed `fault` in the copy in `folder`, run its tests and remove it again. Returns `caught`, or the result of the tests."""
    path = folder / fault.file
    content = path.read_bytes().decode() if path.is_file() else ""
    if (count := content.count(fault.old)) != 1:
        return f"not seeded: the text is {count} times in {fault.file}"
    path.write_bytes(content.replace(fault.old, fault.new).encode())
    status = status_of(fault.test, folder)
    path.write_bytes(content.encode())
    return {0: "missed", 1: "caught"}.get(status, f"missed: pytest ended with status {status}")


def main() -> int:
    """Return 0 if all faults are caught, else 1."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", metavar="NAME", help="faults to seed; default: all")
    parser.add_argument("--repository", type=Path, default=ROOT, help="checkout that is copied; default: this one")
    parser.add_argument("--check", action="store_true", help="first run the tests without a fault: they must pass")
    options = parser.parse_args()
    faults = [Fault(**entry) for entry in json.loads(Path(__file__).with_suffix(".json").read_text(encoding="utf-8"))]
    if unknown := set(options.names) - {fault.name for fault in faults}:
        parser.error(f"no such fault: {', '.join(sorted(unknown))}")
    chosen = [fault for fault in faults if not options.names or fault.name in options.names]
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        copy_tracked(options.repository, folder)
        tests = {fault.test for fault in chosen} if options.check else set()
        failing, caught = {test for test in tests if status_of(test, folder)}, 0
        for fault in chosen:
            began = time.monotonic()
            outcome = "missed: fails without it" if fault.test in failing else outcome_of(fault, folder)
            caught += outcome == "caught"
            sys.stdout.write(f"{fault.name:42} {time.monotonic() - began:6.1f} s  {outcome}\n")
            sys.stdout.flush()
    sys.stdout.write(f"{len(chosen)} faults, {caught} caught, {len(chosen) - caught} missed\n")
    return int(caught < len(chosen))


if __name__ == "__main__":
    sys.exit(main())
