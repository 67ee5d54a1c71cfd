"""What `info` prints: of a folder whatever lies there, of a pack its certified errors, a table in three forms."""

import csv
import io
import json
from pathlib import Path

import pytest

from lab.bench.random_pack import random_pack
from ntc.codec.grid.model import GridConfig
from ntc.pack.file import read_pack, write_pack
from tests.support.gltf_builder import GltfBuilder, noise, png
from viewer import cli
from viewer.cli.info import pack_json, pack_lines
from viewer.cli.sources import resolve_precision
from viewer.scene.text_table import Column, Table

HALVES = GridConfig(hidden_width=16, weight_bits=16)
TABLE = Table(
    (Column("name", "name"), Column("excess", "excess"), Column("cut", "cut %", 1)),
    ({"name": "a|b", "excess": 12345, "cut": 12.34}, {"name": "c", "cut": float("inf")}, {"name": "d", "cut": None}),
)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A scene, a pack, broken ones, and things that are neither."""
    folder = tmp_path / "all"
    (folder / "sub").mkdir(parents=True)
    builder = GltfBuilder()
    material = builder.material(builder.image(png(noise())), normalTexture={"index": 0})
    builder.drawn(builder.triangle(material)).write(folder / "sub" / "good.glb")
    write_pack(folder / "a.ntc", random_pack(((8, 8),), (0,)))
    (folder / "torn.glb").write_bytes((folder / "sub" / "good.glb").read_bytes()[:-5])
    (folder / "z.GLTF").write_text("{")
    (folder / "notes.txt").write_text("no scene")
    (folder / ".a.x.partial.ntc").write_bytes(b"left by a killed process")
    (folder / "link.glb").symlink_to(folder / "sub" / "good.glb")
    (folder / "loop").symlink_to(folder)
    return folder


def test_a_table_of_all_files_sorted(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["info", "--all", str(folder)]) == 0
    printed = capsys.readouterr()
    rows = [line.split(" | ") for line in printed.out.splitlines() if line.startswith("| ")][1:]
    assert [row[0].removeprefix("| ") for row in rows] == ["a.ntc", "sub/good.glb", "torn.glb", "z.GLTF"]
    assert rows[0][2] == "read"
    assert rows[1][3:5] == ["1", "1"]
    assert "normal maps" in rows[1][5]
    assert rows[2][2].startswith("refused: truncated GLB")
    assert printed.out.endswith("4 files: 2 read, 2 refused, 0 crashed\n")
    assert printed.err == ""


def test_json(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["info", "--all", str(folder), "--json"]) == 0
    content = json.loads(capsys.readouterr().out)
    assert (content["read"], content["refused"], content["crashed"]) == (2, 2, 0)
    assert [file["outcome"] for file in content["files"]] == ["read", "read", "refused", "refused"]
    assert content["files"][1]["triangles"] == 1


def test_a_fault_of_the_reader_does_not_end_the_table(
    folder: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(_path: Path) -> None:
        raise ZeroDivisionError("a\x1b[2J")

    monkeypatch.setattr("viewer.cli.info.load_scene", broken)
    assert cli.main(["info", "--all", str(folder)]) == 0
    printed = capsys.readouterr().out
    assert "crashed: ZeroDivisionError: a[2J" in printed
    assert "1 read, 0 refused, 3 crashed" in printed


@pytest.mark.parametrize(
    ("arguments", "word"), [([], "--all"), (["x.glb", "--all", "y"], "--all"), (["--all", "nowhere"], "nowhere")]
)
def test_bad_arguments(arguments: list[str], word: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["info", *arguments]) == 2
    assert word in capsys.readouterr().err


def test_info_shows_bounds_of_every_precision(tmp_path: Path) -> None:
    write_pack(tmp_path / "a.ntc", random_pack(config=HALVES))
    pack = read_pack(tmp_path / "a.ntc")
    found = pack_json(pack)["certified_error"]
    assert list(found) == ["fp32", "fp16", "fp16-arithmetic", "fp16-accumulate"]
    assert found["fp16"] == found["fp32"], "weights are halves"
    for bounds in found.values():
        assert 0.0 < bounds["sampled_texels_error"] <= bounds["error"] <= 1.0
        assert not bounds["may_overflow"]
    lines = pack_lines(pack)
    assert any(line.startswith("fp16-accumulate ") and line.endswith("never") for line in lines)
    assert pack_lines(pack) == lines, "computed anew, and the same"


def test_auto_takes_halves_where_they_do_not_show(capsys: pytest.CaptureFixture[str]) -> None:
    assert resolve_precision("auto", random_pack(config=HALVES)) == "fp16"
    assert "precision fp16: " in capsys.readouterr().out
    assert resolve_precision("auto", None) == "fp32"
    assert resolve_precision("fp16-arithmetic", None) == "fp16-arithmetic"


def test_table_as_markdown() -> None:
    assert TABLE.markdown() == (
        "| name | excess | cut % |\n|---|--:|--:|\n| a\\|b | 12,345 | 12.3 |\n| c | - | - |\n| d | - | - |\n"
    )


def test_table_as_csv_keeps_full_precision() -> None:
    rows = list(csv.DictReader(io.StringIO(TABLE.csv())))
    assert rows[0] == {"name": "a|b", "excess": "12345", "cut": "12.34"}
    assert rows[2] == {"name": "d", "excess": "", "cut": ""}


def test_table_as_text_is_aligned() -> None:
    assert TABLE.text() == "name  excess  cut %\na|b   12,345   12.3\nc          -      -\nd          -      -\n"
