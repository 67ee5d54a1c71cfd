"""`ntc-viewer share`: the files of a comparison, and that it can be stopped and made again."""

import csv
import json
from pathlib import Path

import pytest

from ntc.pack.file import read_pack
from tests.end_to_end.conftest import two_squares
from viewer import cli

CAMERAS = [
    {"name": name, "eye": [x, 0.2, 3.0], "target": [x, 0.0, 0.0], "fov": 45.0}
    for name, x in (("left", -0.5), ("right", 0.5))
]


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    (tmp_path / "views.json").write_text(json.dumps(CAMERAS))
    return two_squares(count=4).write(tmp_path / "row.glb")


def shared(scene: Path, out: Path, *more: str) -> int:
    return cli.main(["share", str(scene), "--out", str(out), "--views", str(scene.with_name("views.json")), *more])


def test_groupings_are_trained_alike_and_measured(
    scene: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    arguments = ("--steps", "20", "--clusters", "2", "--seed", "0", "1", "--device", "cpu", "--size", "64x48")
    assert shared(scene, out, *arguments) == 0
    record = json.loads((out / "share.json").read_text())
    rows = record["rows"]
    assert [(row["name"], row["seed"]) for row in rows[:3]] == [("baseline", 0), ("baseline", 1), ("clustered-2", 0)]
    assert len(rows) == 8
    assert {row["steps"] for row in rows} == {20}
    assert len({row["samples"] for row in rows}) == 1
    assert len({row["latent_bytes"] for row in rows}) == 1
    by_name = {row["name"]: row for row in rows}
    assert by_name["baseline"]["held_out"]["excess"] >= by_name["covisible-2"]["held_out"]["excess"]
    assert by_name["single"]["held_out"]["excess"] == 0
    assert by_name["baseline"]["bytes"] > by_name["single"]["bytes"]
    assert all(row["ms"] for row in rows)
    for row in rows:
        pack = read_pack(out / f"{row['name']}.seed-{row['seed']}.ntc")
        quality = [texture.psnr_db or 0.0 for texture in pack.textures]
        assert row["worst_db"] == pytest.approx(min(quality))
        assert row["psnr_db"] == pytest.approx(sum(quality) / len(quality))
    with (out / "share.csv").open(newline="") as file:
        assert [line["name"] for line in csv.DictReader(file)] == [row["name"] for row in rows]
    assert (out / "share.png").read_bytes().startswith(b"\x89PNG")
    assert not list(out.glob("*.state"))
    printed = capsys.readouterr().out
    assert all(sentence in printed for sentence in record["sentences"])


def test_codec_block_is_compared_at_equal_bits_of_codes(scene: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    groupings = ("--groupings", "baseline", "single", "universal")
    assert shared(scene, out, "--codec", "block", *groupings, "--size", "64x48") == 0
    rows = {row["name"]: row for row in json.loads((out / "share.json").read_text())["rows"]}
    assert rows["baseline"]["latent_bytes"] == rows["single"]["latent_bytes"]
    assert rows["universal"]["decoder_bytes"] == 0 < rows["single"]["decoder_bytes"] < rows["baseline"]["decoder_bytes"]


def test_bad_input_is_one_line(scene: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["share", str(tmp_path), "--out", str(tmp_path / "out")]) == 2
    (tmp_path / "file").write_text("")
    assert shared(scene, tmp_path / "file") == 2
    lines = capsys.readouterr().err.strip().splitlines()
    assert "--out" in lines[-1]
    assert "name a folder" in lines[-1]
