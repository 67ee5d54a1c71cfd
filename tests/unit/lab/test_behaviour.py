"""Records of behaviour: which runs there are, and what a comparison of two records finds."""

from pathlib import Path

import numpy as np
import pytest

from lab.benchmarks.behaviour.comparison import compare
from lab.benchmarks.behaviour.inputs import pattern, png
from lab.benchmarks.behaviour.parts import PARTS


@pytest.mark.parametrize("part", PARTS)
def test_runs_of_a_part_have_folders_of_their_own(part: str) -> None:
    names = [run.name for run in PARTS[part]()]
    assert names
    assert len(set(names)) == len(names)
    assert not [name for name in names if "/" in name]


def record(folder: Path, pixels: np.ndarray, text: str) -> Path:
    (folder / "pictures" / "run").mkdir(parents=True)
    (folder / "pictures" / "run" / "color.png").write_bytes(png(pixels))
    (folder / "pictures" / "run" / "output.txt").write_text(text)
    return folder


def test_equal_records(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    a, b = (record(tmp_path / name, pattern(3), "exit status 0\n") for name in "ab")
    assert compare(a, b)
    assert capsys.readouterr().out == "pictures: 2 files equal, 0 different\n"


def test_differences_are_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    other = pattern(3)
    other[2, 5, 1] ^= 4
    a, b = record(tmp_path / "a", pattern(3), "exit status 0\n"), record(tmp_path / "b", other, "exit status 2\n")
    (b / "pictures" / "run" / "extra.json").write_text("{}")
    assert not compare(a, b)
    assert capsys.readouterr().out.splitlines() == [
        "pictures: 0 files equal, 3 different",
        "  pictures/run/color.png: 1 pixels by up to 4",
        "  pictures/run/extra.json: only in B",
        "  pictures/run/output.txt: 1 bytes of 14 and 14",
    ]
