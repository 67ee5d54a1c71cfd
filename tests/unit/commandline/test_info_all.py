"""`info --all` describes a whole folder, whatever lies there."""

import json
from pathlib import Path

import pytest

from ntc.pack.file import write_pack
from tests.support.gltf_builder import GltfBuilder, noise, png
from tests.support.packs import random_pack
from viewer import cli
from viewer.cli import info_all


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
    assert "normal textures" in rows[1][6]
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
    def broken(path: Path) -> None:
        raise ZeroDivisionError("a\x1b[2J")

    monkeypatch.setattr(info_all, "load_scene", broken)
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


def test_an_empty_folder(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["info", "--all", str(tmp_path)]) == 0
    assert capsys.readouterr().out == "0 files: 0 read, 0 refused, 0 crashed\n"
