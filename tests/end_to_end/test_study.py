"""`ntc-viewer study`: every study of a small scene or folder, and what it writes."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from lab.bench.stability_block_cases import block_cases
from lab.bench.stability_cases import stability_cases
from lab.commands import study_stability
from tests.end_to_end.conftest import two_squares
from viewer import cli
from viewer.scene.images import read_image, write_png

pytestmark = pytest.mark.guards("lab")


def camera(x: float, target: float, distance: float) -> dict[str, Any]:
    return {"name": f"at {x}", "eye": [x, 0.2, distance], "target": [target, 0.0, 0.0], "fov": 45.0}


@pytest.fixture(scope="module")
def row_of_squares(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A scene of six textures, with a pack of three decoders, and beside it views.json of four cameras."""
    folder = tmp_path_factory.mktemp("row")
    scene = two_squares(count=6).write(folder / "row.glb")
    cameras = [camera(x, 0.5 * x, distance) for x, distance in ((-2.0, 3.0), (-1.5, 4.0), (1.5, 3.0), (2.0, 5.0))]
    (folder / "views.json").write_text(json.dumps(cameras))
    pack = str(folder / "row.clustered.ntc")
    assert cli.main(["encode", str(scene), "--out", pack, "--grouping", "clustered", "--clusters", "3"]) == 0
    return scene


def test_stability_is_studied(
    row_of_squares: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    out = tmp_path / "o"
    # tests/gl/lab/test_stability.py tests every case.
    for name, cases in (("stability_cases", stability_cases), ("block_cases", block_cases)):
        monkeypatch.setattr(study_stability, name, lambda *given, of=cases: of(*given)[::6])
    arguments = [
        "study",
        "stability",
        str(row_of_squares),
        "--out",
        str(out),
        "--texels",
        "20",
        "--bound-texels",
        "4000",
    ]
    arguments += ["--size", "32x18"]
    assert cli.main([*arguments, "--grouping", "clustered", "--precisions", "fp32"]) == 0
    record = json.loads((out / "stability.json").read_text())
    paths = {row["path"] for row in record["rows"]}
    assert paths == {"texels", "deferred", "deferred, shared", "binned", "forward", "cached"}
    assert all(row["not_finite"] == 0 and row["holds"] is not False for row in record["rows"])
    assert all(check["beyond"] == 0 for check in record["bounds"])
    assert record["trained"][0]["largest_loss_db"] < 0.1
    assert (out / "stability.csv").read_text().count("\n") == len(record["rows"]) + 1
    assert read_image(out / "stability.png").shape[1] > 300
    assert "0 values beyond" in capsys.readouterr().out
    assert cli.main([*arguments, "--grouping", "nothing"]) == 2


@pytest.fixture
def images(tmp_path: Path) -> Path:
    """A folder of three small images in two categories."""
    random = np.random.default_rng(0)
    for number, category in enumerate(("stone", "wood", "wood")):
        write_png(tmp_path / "in" / category / f"{number}.png", random.integers(0, 256, (16, 16, 3), np.uint8))
    return tmp_path / "in"


def study(name: str, source: Path, out: Path, *more: str) -> list[str]:
    """Arguments of a study of very short trainings."""
    return [
        *("study", name, str(source), "--out", str(out), "--clusters", "2", "--steps", "6"),
        *("--texels-per-texture", "32", "--device", "cpu", *more),
    ]


def record(out: Path, name: str) -> dict[str, Any]:
    """The JSON that a study wrote, after a look at its other files."""
    found: dict[str, Any] = json.loads((out / f"{name}.json").read_text())
    assert (out / f"{name}.csv").read_text().count("\n") == len(found["rows"]) + 1
    assert (out / f"{name}.md").read_text().count("\n|") == len(found["rows"]) + 2
    assert read_image(out / f"{name}.png").shape[1] > 500
    assert found["machine"]["torch"]
    assert found["settings"]["steps"] == 6
    return found


def test_a_study_goes_on_where_it_was(tmp_path: Path, images: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "o"
    arguments = study("paper-textures", images, out, "--groupings", "baseline", "single")
    assert cli.main(arguments) == 0
    first = record(out, "paper-textures")
    assert all(row["mean_db"] > 3.0 for row in first["rows"])
    runs = {path: path.stat().st_mtime_ns for path in (out / "runs").iterdir()}
    assert len(runs) == len(first["rows"]) == 6
    gone, broken = list(runs)[:2]
    gone.unlink()
    broken.write_text("{")
    assert cli.main(arguments) == 0
    again = {path: path.stat().st_mtime_ns for path in (out / "runs").iterdir()}
    assert again.keys() == runs.keys()
    assert {path for path in runs if again[path] != runs[path]} == {gone, broken}
    found = [row["mean_db"] for row in record(out, "paper-textures")["rows"]]
    assert found == [row["mean_db"] for row in first["rows"]]
    capsys.readouterr()
    assert cli.main([*arguments, "--steps", "0"]) == 2
    assert "--steps 0: must be at least 1" in capsys.readouterr().err


def test_the_papers_table_of_textures(tmp_path: Path, images: Path) -> None:
    out = tmp_path / "o"
    assert cli.main(study("paper-textures", images, out, "--seeds", "0", "1", "--blocks")) == 0
    rows = {(row["variant"], row["grouping"]): row for row in record(out, "paper-textures")["rows"]}
    assert {grouping for _, grouping in rows} == {"baseline", "clustered", "random", "category", "single", "-"}
    assert {variant for variant, _ in rows} == {"paper", "best", "best, 4 channels of 8 bits", "BC1", "BC7"}
    assert rows["BC1", "-"]["bits_per_texel"] == 4.0
    assert rows["BC7", "-"]["bits_per_texel"] == 8.0
    assert rows["BC7", "-"]["mean_db"] > rows["BC1", "-"]["mean_db"]
    assert rows["best", "single"]["seeds"] == 2
    for row in rows.values():
        assert 0.0 <= row["flip"] <= 1.0
        assert -1.0 <= row["ssim"] <= 1.0
    gaps = {(row["variant"], row["grouping"]): row for row in record(out, "paper-textures-gaps")["rows"]}
    assert gaps["best", "baseline"]["to_own_baseline_db"] == 0.0
    gained = rows["best", "single"]["mean_db"] - rows["paper", "single"]["mean_db"]
    assert gaps["best", "single"]["to_paper_db"] == pytest.approx(gained)


def test_the_papers_tables_of_scenes(row_of_squares: Path, tmp_path: Path) -> None:
    out = tmp_path / "o"
    more = ["--size", "64x36", "--texture-size", "16", "--groupings", "baseline", "covisible", "--more-clusters", "3"]
    more += ["--views", str(row_of_squares.with_name("views.json"))]
    assert cli.main(study("paper-scenes", row_of_squares, out, *more)) == 0
    rows = {(row["variant"], row["grouping"], row["groups"]) for row in record(out, "paper-scenes")["rows"]}
    assert ("best", "covisible", 3) in rows
    assert ("paper", "covisible", 2) in rows
    rendered = {(row["recipe"], row["grouping"]): row for row in record(out, "paper-scenes-rendered")["rows"]}
    assert rendered["best", "baseline"]["excess"] > rendered["best", "covisible"]["excess"]
    assert rendered["best", "covisible"]["cut_percent"] > 50.0
    assert rendered["best", "baseline"]["views"] == 4
    assert {path.name for path in (out / "packs").iterdir()} == {
        f"{recipe}.{grouping}.ntc" for recipe in ("paper", "best") for grouping in ("baseline", "covisible")
    }


def test_rate_and_distortion(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("quicktex")
    images, out = tmp_path / "in", tmp_path / "o"
    y, x = np.mgrid[0:64, 0:64]
    for number in range(2):
        waves = np.stack([128 + 100 * np.sin(x / (3 + number + i) + y / 7) for i in range(3)], axis=-1)
        write_png(images / f"{number}.png", waves.astype(np.uint8))
    arguments = ["study", "rate", str(images), "--out", str(out), "--bits", "3", "5", "1000", "--groupings", "single"]
    arguments += ["--texture-size", "64", "--formats", "bc1", "bc7", "--grid-steps", "3", "--flip-every", "2"]
    assert cli.main(arguments) == 0
    found = json.loads((out / "rate.json").read_text())
    curves = [row["curve"] for row in found["rows"]]
    block = {"block 8x8, single", "block 4x4, single"}
    assert set(curves) - {"XUASTC", "ETC1S"} == {"BC1", "BC7", "JPEG XL", "JPEG 4:2:0", "grid, single"} | block
    assert curves.count("grid, single") == 4
    rows = {(row["curve"], row["setting"]): row for row in found["rows"]}
    assert 5.3 <= rows["BC1", "bc1"]["bits_per_texel"] < 5.5
    assert rows["BC7", "bc7"]["mean_db"] > rows["BC1", "bc1"]["mean_db"]
    exact, coarse = rows["JPEG XL", "distance 0.1"], rows["JPEG XL", "distance 5"]
    assert exact["mean_db"] > coarse["mean_db"]
    assert exact["bits_per_texel"] > coarse["bits_per_texel"]
    assert all(0.0 <= row["flip"] <= 1.0 and row["worst_db"] <= row["mean_db"] for row in found["rows"])
    assert "block 8x8, single, 1000 bits: left out" in capsys.readouterr().err
    assert (out / "rate.md").read_text().count("\n|") == len(found["rows"]) + 2
    assert read_image(out / "rate.png").shape[1] > 500
    assert (out / "rate.png").stat().st_size < 200_000
    for wrong, line in (("--bits 0", "--bits 0: must be above 0"), ("--most 0", "--most 0: must be at least 1")):
        assert cli.main(["study", "rate", str(images), "--out", str(out), *wrong.split()]) == 2
        assert line in capsys.readouterr().err


def test_help_lists_the_studies(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stopped:
        cli.main(["study", "--help"])
    assert stopped.value.code == 0
    assert "paper-scenes" in capsys.readouterr().out
