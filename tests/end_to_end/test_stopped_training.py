"""`encode --state`: Ctrl-C, then the same command again, ends in the pack of an undisturbed training."""

import signal
import subprocess
import sys
from contextlib import nullcontext
from itertools import count
from pathlib import Path

import numpy as np
import pytest

from viewer import cli
from viewer.scene.images import write_png

QUESTIONS_BEFORE = 20
"""Steps that Ctrl-C comes after."""


@pytest.fixture
def images(tmp_path: Path) -> Path:
    """A folder of two small images."""
    random = np.random.default_rng(0)
    for number in range(2):
        write_png(tmp_path / "in" / f"{number}.png", random.integers(0, 256, (32, 32, 3), np.uint8))
    return tmp_path / "in"


def command(images: Path, out: Path, *more: str) -> list[str]:
    """An encoding of a few seconds."""
    return [
        "encode",
        str(images),
        "--out",
        str(out),
        "--grouping",
        "single",
        "--steps",
        "300",
        "--device",
        "cpu",
        *more,
    ]


def interrupted(words: list[str]) -> subprocess.Popen[str]:
    """The process, after Ctrl-C at its first line of progress."""
    process = subprocess.Popen(
        [sys.executable, "-m", "viewer", *words], stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    assert process.stderr is not None
    for line in process.stderr:
        if "step " in line:
            break
    process.send_signal(signal.SIGINT)
    process.communicate(timeout=120)
    return process


def test_it_ends_alike(tmp_path: Path, images: Path) -> None:
    whole, resumed, state = tmp_path / "whole.ntc", tmp_path / "resumed.ntc", tmp_path / "a.state"
    assert cli.main(command(images, whole)) == 0
    assert interrupted(command(images, resumed, "--state", str(state))).returncode == 130
    assert state.exists()
    assert not resumed.exists()
    assert cli.main(command(images, resumed, "--state", str(state))) == 0
    assert resumed.read_bytes() == whole.read_bytes()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["in", "resumed.ntc", "whole.ntc"]


def test_without_a_state_nothing_stays(tmp_path: Path, images: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    asked = count(1)
    monkeypatch.setattr(
        "viewer.cli.encode.deferred_interrupt", lambda: nullcontext(lambda: next(asked) > QUESTIONS_BEFORE)
    )
    assert cli.main(command(images, tmp_path / "a.ntc")) == 130
    assert next(asked) > QUESTIONS_BEFORE
    assert [path.name for path in tmp_path.iterdir()] == ["in"]
