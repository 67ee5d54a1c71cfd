"""`ntc-viewer study clusters`."""

import json
from pathlib import Path

import pytest

from viewer import cli
from viewer.scene.images import read_image


def test_the_built_in_scene_is_studied(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "o"
    assert cli.main(["study", "clusters", "--out", str(out), "--clusters", "8", "--features", "low_level"]) == 0
    record = json.loads((out / "clusters.json").read_text())
    rows = {row["grouping"]: row for row in record["rows"] if row["groups"] in (8, 55)}
    assert rows["covisible"]["held_out_cut_percent"] > rows["clustered"]["held_out_cut_percent"]
    assert any(row["grouping"] == "pack clustered" and row["psnr_db"] > 20 for row in record["rows"])
    assert (out / "clusters.csv").read_text().count("\n") == len(record["rows"]) + 1
    assert "| covisible | low_level | 8 |" in (out / "clusters.md").read_text()
    assert read_image(out / "clusters.png").shape[1] > 1000
    assert "covisible" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["study"], "no such study"),
        (["study", "nothing"], "study nothing: no such study (there are: clusters"),
        (["study", "clusters", "--out", "o", "--clusters", "0"], "--clusters 0: must be at least 1"),
        (["study", "clusters", "--out", "o", "--features", "shape"], "shape"),
        (["study", "clusters", "nowhere.glb", "--out", "o"], "nowhere.glb"),
        (["study", "clusters", "--out", "o", "--views", "nowhere.json"], "nowhere.json"),
    ],
)
def test_bad_input_is_one_line(
    arguments: list[str],
    words: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    assert cli.main(arguments) == 2
    errors = capsys.readouterr().err
    assert [line for line in errors.splitlines() if line.startswith("error: ") and words in line]
    assert "Traceback" not in errors
    assert list(tmp_path.iterdir()) == []


def test_help_lists_the_studies(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stopped:
        cli.main(["study", "--help"])
    assert stopped.value.code == 0
    assert "clusters" in capsys.readouterr().out
