"""A kilobyte that claims four gigabytes is refused in one line, at once, and takes no memory to speak of."""

import json
import subprocess
import sys
from typing import Any

import pytest

from tests.support.claims import claims

LARGEST_FILE = 4096
MOST_GROWN_KB = 16 << 10
MOST_SECONDS = 1.0
NAMES = tuple(name for name, _ in claims())


@pytest.fixture(scope="module")
def rows(tmp_path_factory: pytest.TempPathFactory) -> dict[str, dict[str, Any]]:
    """By file, what a process whose address space is limited wrote of it."""
    folder = tmp_path_factory.mktemp("claims")
    for name, content in claims():
        assert len(content) < LARGEST_FILE
        (folder / name).write_bytes(content)
    command = [sys.executable, "-m", "tests.support.claims", str(folder)]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    return {row["name"]: row for row in map(json.loads, done.stdout.splitlines())}


@pytest.mark.process
@pytest.mark.parametrize("name", NAMES)
def test_a_claim_is_refused_before_memory_is_taken(rows: dict[str, dict[str, Any]], name: str) -> None:
    row = rows[name]
    assert name in row["refusal"]
    assert row["refusal"].isprintable()
    assert row["grown_kb"] < MOST_GROWN_KB
    # Processor time, so that other processes do not count.
    assert row["seconds"] < MOST_SECONDS
    assert "No module" not in row["refusal"]
