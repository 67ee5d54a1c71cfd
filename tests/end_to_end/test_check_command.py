"""`ntc-viewer check`: an unchanged scene passes and is not measured again; a worse texture is found and named."""

import json
from pathlib import Path
from xml.etree import ElementTree

import pytest

from tests.end_to_end.export.material_scene import materials_scene
from viewer import cli
from viewer.checking.record import read_record


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with scene.glb, its packs at 8 and 3 bits apart from it, and the accepted report of the first one."""
    folder = tmp_path_factory.mktemp("checked")
    scene = materials_scene(128).write(folder / "scene.glb")
    (folder / "packs").mkdir()
    for bits in ("8", "3"):
        out = folder / "packs" / f"{bits}.ntc"
        assert cli.main(["encode", str(scene), "--out", str(out), "--grouping", "single", "--bits", bits]) == 0
    assert checked(folder, "8", "--out", str(folder / "accepted"), "--suggest", str(folder / "budget.toml")) == 0
    return folder


@pytest.fixture(scope="module", autouse=True)
def cache(tmp_path_factory: pytest.TempPathFactory) -> None:
    """Measured values of this module alone."""
    patch = pytest.MonkeyPatch()
    patch.setenv("NTC_VIEWER_CACHE_DIR", str(tmp_path_factory.mktemp("cache")))


def checked(folder: Path, bits: str, *options: str) -> int:
    pack = folder / "packs" / f"{bits}.ntc"
    return cli.main(
        [
            "check",
            str(folder / "scene.glb"),
            "--pack",
            str(pack),
            "--size",
            "96x64",
            "--views",
            "1",
            "--close",
            "1",
            *options,
        ]
    )


def test_an_unchanged_scene_passes_without_measuring_again(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    limits = ["--budget", str(folder / "budget.toml"), "--against", str(folder / "accepted" / "report.json")]
    capsys.readouterr()
    assert checked(folder, "8", *limits) == 0
    out = capsys.readouterr().out
    assert "(0 measured now), 4 lit views (0 measured now): all within the budget" in out


def test_fewer_bits_are_found_and_reported(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    limits = ["--budget", str(folder / "budget.toml"), "--against", str(folder / "accepted" / "report.json")]
    capsys.readouterr()
    assert checked(folder, "3", *limits, "--out", str(tmp_path / "report")) == 1
    out = capsys.readouterr().out
    before, after = (read_record(path / "report.json") for path in (folder / "accepted", tmp_path / "report"))
    for texture, own in zip(before.textures, after.textures, strict=True):
        for name, quality in texture.maps.items():
            worse = (own.maps[name].psnr_db or 99.0) < (quality.psnr_db or 99.0) - 0.1
            assert (f"{texture.name}, map {name}: PSNR {own.maps[name].psnr_db or 99.0:.2f} dB" in out) == worse
    assert len(after.past) == 1
    root = ElementTree.fromstring((tmp_path / "report" / "junit.xml").read_bytes())
    assert sum(int(suite.get("failures", "0")) for suite in root) > 0
    sarif = json.loads((tmp_path / "report" / "check.sarif").read_bytes())
    told = [line for line in out.splitlines() if ", limit at " in line or ", accepted " in line]
    assert len(sarif["runs"][0]["results"]) == len(told)
    shown = (tmp_path / "report" / "index.html").read_text()
    assert shown.count("<img") == len(after.textures)
    assert "bits per texel" in shown


def test_a_pack_alone_is_checked_by_what_its_encoder_measured(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    capsys.readouterr()
    budget = folder / "of_the_pack.toml"
    assert cli.main(["check", str(folder / "packs" / "3.ntc"), "--suggest", str(budget)]) == 0
    assert cli.main(["check", str(folder / "packs" / "8.ntc"), "--budget", str(budget)]) == 1
    out = capsys.readouterr().out
    assert "as their encoder measured them" in out
    assert "size on disk" in out


def test_a_library_is_checked(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    library = tmp_path / "library"
    assert cli.main(["library", "add", str(library), str(folder / "packs" / "8.ntc")]) == 0
    assert cli.main(["check", str(library), "--against", str(folder / "accepted" / "report.json")]) == 0
    assert "all within the budget" in capsys.readouterr().out


def test_the_encoder_records_what_is_measured(folder: Path) -> None:
    """Both ways to know the quality of a texture agree."""
    assert cli.main(["check", str(folder / "packs" / "8.ntc"), "--out", str(folder / "recorded")]) == 0
    recorded, measured = (read_record(folder / name / "report.json") for name in ("recorded", "accepted"))
    own = {texture.content: texture for texture in recorded.textures}
    for texture in measured.textures:
        for name, quality in texture.maps.items():
            assert own[texture.content].maps[name].psnr_db == pytest.approx(quality.psnr_db, abs=0.02)


def test_a_damaged_cache_is_measured_again(folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("NTC_VIEWER_CACHE_DIR", str(tmp_path))
    arguments = ("8", "--views", "0", "--against", str(folder / "accepted" / "report.json"))
    assert checked(folder, *arguments) == 0
    files = [path for path in (tmp_path / "checks").rglob("*") if path.is_file()]
    whole = [path.read_bytes() for path in files]
    assert files
    for path in files:
        path.write_bytes(b'{"maps": {"base": {"psnr_db": "good"}}}')
    assert checked(folder, *arguments) == 0
    assert [path.read_bytes() for path in files] == whole
