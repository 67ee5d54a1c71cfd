"""Budgets: which limit holds for a value, what is found, and what a budget file may be."""

import datetime
from pathlib import Path

import msgspec
import pytest

from ntc.codec.maps import MapName
from ntc.errors import InputError
from viewer.checking.budget import Budget, read_budget, suggested_budget
from viewer.checking.findings import Finding, failures, find
from viewer.checking.record import FORMAT, MapRecord, PackRecord, Record, TextureRecord, ViewRecord

TODAY = datetime.date(2026, 5, 1)


def texture(
    name: str, psnr: float = 40.0, degrees: float = 1.0, size: int = 1000, materials: tuple[str, ...] = ()
) -> TextureRecord:
    maps: dict[MapName, MapRecord] = {
        "base": MapRecord(psnr),
        "normal": MapRecord(35.0, degrees),
        "metalness": MapRecord(None),
    }
    return TextureRecord(
        name, f"content of {name}", f"hash of {name}", 64, 64, size, 8.0 * size / 4096, maps, materials
    )


def record(*textures: TextureRecord, disk: int = 100_000, flip: float = 0.02) -> Record:
    views = (ViewRecord("door", "sun", "content", 38.0, flip, 0.5),)
    return Record(FORMAT, "2026-04-01T00:00:00+00:00", "town.glb", PackRecord(disk, 4.0, 200, 50_000), textures, views)


def found(text: str, own: Record, accepted: Record | None = None) -> tuple[Finding, ...]:
    budget = msgspec.toml.decode(text, type=Budget)
    return find(own, budget, accepted, TODAY)


def texts(findings: tuple[Finding, ...]) -> list[str]:
    return [each.text for each in findings]


def test_the_most_particular_limit_holds() -> None:
    budget = """
        [textures]
        psnr_db = 39
        [map.normal]
        psnr_db = 34
        normal_degrees = 0.5
        [[name]]
        pattern = "ROOF*"
        maps = ["base"]
        psnr_db = 42
        [[name]]
        pattern = "brick"
        psnr_db = 10
    """
    own = record(texture("roof_9"), texture("wall", materials=("Brick",)), texture("door", psnr=38.5))
    assert texts(found(budget, own)) == [
        "door, map normal: angle of normals 1.00 degrees, limit at most 0.50 degrees",
        "roof_9, map normal: angle of normals 1.00 degrees, limit at most 0.50 degrees",
        "wall, map normal: angle of normals 1.00 degrees, limit at most 0.50 degrees",
        "roof_9, map base: PSNR 40.00 dB, limit at least 42.00 dB",
        "door, map base: PSNR 38.50 dB, limit at least 39.00 dB",
    ]


def test_exact_maps_and_values_on_their_limit_pass() -> None:
    assert found("[textures]\npsnr_db = 35\nbytes = 1000\n[map.metalness]\npsnr_db = 99", record(texture("roof"))) == ()


def test_pack_and_views_have_limits() -> None:
    limits = "[pack]\ndisk_bytes = 99_999\nmultiply_adds = 200\n[view]\nflip = 0.019\npsnr_db = 38.0"
    assert texts(found(limits, record())) == [
        "view door, sun: FLIP 0.0200, limit at most 0.0190",
        "all packs: size on disk 100,000 bytes, limit at most 99,999 bytes",
    ]


@pytest.mark.parametrize(("until", "fails"), [("2026-05-01", False), ("2026-04-30", True)])
def test_an_exception_holds_until_its_last_day(until: str, fails: bool) -> None:
    text = f"""
        [textures]
        psnr_db = 41
        [map.normal]
        psnr_db = 0
        [[exception]]
        pattern = "roof"
        maps = ["base"]
        measures = ["psnr_db"]
        reason = "the artist repaints it"
        until = {until}
    """
    (finding,) = found(text, record(texture("roof")))
    assert len(failures((finding,))) == fails
    assert f"{until}: the artist repaints it" in finding.text


def test_a_fifth_of_a_decibel_and_one_per_cent_of_bytes_are_found_and_named() -> None:
    accepted = record(texture("roof"), texture("wall"))
    assert found("", accepted, accepted) == ()
    worse = record(texture("roof", psnr=39.8), texture("wall", size=1010), disk=101_000, flip=0.0215)
    assert sorted(texts(found("", worse, accepted))) == [
        "all packs: size on disk 101,000 bytes, accepted 100,000 bytes",
        "roof, map base: PSNR 39.80 dB, accepted 40.00 dB",
        "wall: bits per texel 1.973, accepted 1.953",
        "wall: size 1,010 bytes, accepted 1,000 bytes",
    ]
    better = record(texture("roof", psnr=41.0, size=900), texture("wall"), disk=90_000)
    assert found("", better, accepted) == ()
    assert (
        len(found("[worse]\npsnr_db = 0.3\nbytes = 0.02\nbits_per_texel = 0.02\ndisk_bytes = 0.02", worse, accepted))
        == 0
    )
    assert texts(found("", record(texture("roof")), accepted)) == ["wall: was accepted, and is not there any more"]


def test_textures_of_one_name_are_told_apart() -> None:
    accepted = record(texture("roof"), texture("roof"))
    own = record(texture("roof"), texture("roof", psnr=39.0))
    assert texts(found("", own, accepted)) == [
        "roof, map base (number 2 of that name): PSNR 39.00 dB, accepted 40.00 dB"
    ]


def test_a_suggested_budget_is_kept_by_what_it_was_made_from(tmp_path: Path) -> None:
    own = record(texture("roof"), texture("wall", psnr=31.234, degrees=7.77, size=2222))
    path = tmp_path / "budget.toml"
    path.write_text(suggested_budget(own))
    assert find(own, read_budget(path), None, TODAY) == ()
    worse = record(texture("roof"), texture("wall", psnr=30.0, degrees=9.0, size=2500), disk=110_000, flip=0.03)
    assert len(find(worse, read_budget(path), None, TODAY)) == 5


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("[textures]\npsnr = 30", "unknown field"),
        ("[textures]\npsnr_db = 'high'", "textures.psnr_db"),
        ("[textures]\npsnr_db = nan", "textures.psnr_db"),
        ("[map.bump]\npsnr_db = 30", "bump"),
        ("[[name]]\npsnr_db = 30", "pattern"),
        ("[[exception]]\npattern = 'a'\nuntil = 2026-01-01", "reason"),
        ("[[exception]]\npattern = 'a'\nreason = 'b'\nuntil = 'soon'", "until"),
        ("[worse]\nbeauty = 1", "beauty"),
        ("psnr_db 30", "not valid TOML"),
        ("a = " + "[" * 5000, "not valid TOML"),
        ("\xff\xfe", "not valid TOML"),
    ],
)
def test_a_wrong_budget_is_refused_in_one_line(tmp_path: Path, text: str, problem: str) -> None:
    path = tmp_path / "budget.toml"
    path.write_bytes(text.encode("latin-1"))
    with pytest.raises(InputError) as raised:
        read_budget(path)
    line = str(raised.value)
    assert line.startswith(f"{path}: ")
    assert problem in line
    assert line.endswith("write one with ntc-viewer check --suggest FILE")
    assert "\n" not in line


def test_a_budget_that_is_no_file_is_refused(tmp_path: Path) -> None:
    for path in (tmp_path, tmp_path / "absent.toml"):
        with pytest.raises(InputError, match="cannot be read"):
            read_budget(path)
