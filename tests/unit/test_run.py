"""The test command (tests/run) gives its processes what makes them quick."""

import os
import subprocess
from pathlib import Path

import pytest

pytestmark = pytest.mark.process

RUN = Path(__file__).resolve().parents[1] / "run"
VARIABLE = "PYTHONDONTWRITEBYTECODE"


def test_processes_keep_the_byte_code_of_what_they_import(tmp_path: Path) -> None:
    commands = tmp_path / "bin"
    commands.mkdir()
    for name, line in (("lint-imports", ":"), ("python", f'echo "${{{VARIABLE}-kept}}"')):
        (commands / name).write_text(f"#!/bin/sh\n{line}\n", encoding="utf-8")
        (commands / name).chmod(0o755)
    environment = {**os.environ, "NTC_VIEWER_ENVIRONMENT": str(tmp_path), VARIABLE: "1"}
    command = ["bash", str(RUN), "quick"]
    result = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    assert result.stdout.split() == ["kept"]
