"""`ntc-viewer study clusters`."""

import json
from pathlib import Path

import numpy as np
import pytest

from viewer import cli
from viewer.scene.images import read_image, write_png


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
        (["study", "nothing"], "study nothing: no such study (there are: clusters, ablation"),
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


def test_an_ablation_trains_every_variant_and_goes_on_where_it_was(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    random = np.random.default_rng(0)
    for number in range(3):
        write_png(tmp_path / "in" / f"{number}.png", random.integers(0, 256, (16, 16, 3), np.uint8))
    out = tmp_path / "o"
    arguments = ["study", "ablation", str(tmp_path / "in"), "--out", str(out), "--clusters", "2", "--steps", "6"]
    arguments += ["--texels-per-texture", "32", "--device", "cpu"]
    assert cli.main(arguments) == 0
    record = json.loads((out / "ablation.json").read_text())
    variants = [row["variant"] for row in record["rows"]]
    assert variants[0] == "best"
    assert variants[-1] == "paper"
    assert {"without adapters", "hidden layers by Adam"} <= set(variants)
    assert all(row["mean_db"] > 3.0 for row in record["rows"])
    assert read_image(out / "ablation.png").shape[1] > 500
    runs = {path: path.stat().st_mtime_ns for path in (out / "runs").iterdir()}
    assert len(runs) == len(variants)
    gone, broken = list(runs)[:2]
    gone.unlink()
    broken.write_text("{")
    assert cli.main(arguments) == 0
    again = {path: path.stat().st_mtime_ns for path in (out / "runs").iterdir()}
    assert again.keys() == runs.keys()
    assert {path for path in runs if again[path] != runs[path]} == {gone, broken}
    figures = [[row["mean_db"] for row in json.loads((out / "ablation.json").read_text())["rows"]]]
    assert figures == [[row["mean_db"] for row in record["rows"]]]
    capsys.readouterr()
    assert cli.main([*arguments[:-2], "--steps", "0"]) == 2
    assert "--steps 0: must be at least 1" in capsys.readouterr().err
