"""Reports of a check: JUnit XML, SARIF, the page and the record that later checks read."""

import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import msgspec
import numpy as np
import pytest

from ntc.api import encode
from ntc.codec.encoding import BitsTarget
from ntc.codec.maps import MapName
from ntc.codec.textures import SourceTexture
from ntc.content_cache import ContentCache
from ntc.errors import InputError
from ntc.metrics.metrics import bits_with_mips
from tests.unit.viewer.checking.test_budget import found, record, texture
from viewer.checking.ci_files import junit_xml, sarif_json
from viewer.checking.page import PageContent, page, past_of
from viewer.checking.record import read_record
from viewer.checking.remedies import rate_curve
from viewer.training.rates import RateCurve, RatePoint

BUDGET = """
    [map.base]
    psnr_db = 41
    [[exception]]
    pattern = "old*"
    reason = "it goes"
    until = 2026-12-31
"""
HOSTILE = "roof</script><b>&'\"\x1b[31m\ud800"


def test_junit_has_a_case_for_each_subject() -> None:
    own = record(texture("roof"), texture("old_sign"), texture(HOSTILE))
    root = ElementTree.fromstring(junit_xml(own, found(BUDGET, own)))
    suites = {suite.get("name"): suite for suite in root}
    assert {name: suite.get("tests") for name, suite in suites.items()} == {
        "texture": "3",
        "map": "9",
        "view": "1",
        "pack": "1",
    }
    assert (suites["map"].get("failures"), suites["map"].get("skipped")) == ("2", "1")
    failed = [case.get("name") for case in suites["map"] if case.find("failure") is not None]
    assert failed[0] == "roof, map base"
    assert suites["map"].find("testcase/skipped") is not None


def test_sarif_names_rule_level_and_reason() -> None:
    own = record(texture("roof"), texture("old_sign"), texture(HOSTILE))
    document = json.loads(sarif_json(own, found(BUDGET, own), "1.2.3"))
    (run,) = document["runs"]
    rules = {rule["id"] for rule in run["tool"]["driver"]["rules"]}
    assert document["version"] == "2.1.0"
    assert [result["level"] for result in run["results"]] == ["error", "error", "note"]
    assert all(result["ruleId"] in rules and result["message"]["text"] for result in run["results"])
    assert run["results"][-1]["suppressions"] == [{"kind": "external", "justification": "it goes"}]


def curve_of(*points: tuple[float, Mapping[MapName, float]]) -> RateCurve:
    """A curve of these bits and qualities in dB by map."""
    return RateCurve(tuple(RatePoint(bits, min(by_map.values()), by_map) for bits, by_map in points), 1 << 10)


def test_the_page_escapes_names_and_tells_the_bits_that_mend() -> None:
    own = record(texture("roof"), texture(HOSTILE))
    curve = curve_of((1.0, {"base": 38.0, "normal": 30.0}), (4.0, {"base": 44.0, "normal": 36.0}))
    shown = page(PageContent(own, found(BUDGET, own), {"content of roof": b"picture"}, {"content of roof": curve}))
    assert "needs about 2.0 bits per texel" in shown
    assert "data:image/jpeg;base64,cGljdHVyZQ==" in shown
    assert "</script><b>" not in shown
    shown.encode("utf-8")
    assert "Trend" not in shown
    later = msgspec.structs.replace(own, past=(past_of(own),))
    assert "Trend" in page(PageContent(later, ()))
    assert "All values are within the budget" in page(PageContent(later, ()))


@pytest.mark.parametrize(
    ("points", "needed"),
    [
        (((1.0, 20.0), (4.0, 28.0)), "about 4.0"),
        (((1.0, 20.0), (2.0, 27.0)), "more than 2.0"),
        (((1.0, 40.0), (4.0, 99.0)), "about 1.0"),
        (((1.0, 99.0), (4.0, 99.0)), "about 1.0"),
    ],
)
def test_the_page_tells_the_bits_within_the_points_of_the_curve(
    points: tuple[tuple[float, float], ...], needed: str
) -> None:
    own = record(texture("roof"))
    by_map: list[tuple[float, Mapping[MapName, float]]] = [(bits, {"base": 40.0, "normal": db}) for bits, db in points]
    curve = curve_of(*by_map)
    finding = found(BUDGET, own)[0]
    finding = replace(finding, subject=replace(finding.subject, map="normal"), bound=28.0)
    content = PageContent(own, (finding,), {}, {"content of roof": curve})
    assert f"needs {needed} bits per texel" in page(content)


def test_the_curve_of_a_texture_is_measured_once_on_all_its_texels(tmp_path: Path) -> None:
    pixels = np.random.default_rng(0).integers(0, 256, (32, 48, 3), np.uint8)
    source, cache = SourceTexture("noise", pixels, "hash"), ContentCache(tmp_path)
    pack = encode([source], codec="block", target=BitsTarget(4.0))
    curve = rate_curve(source, pack, cache)
    assert curve is not None
    assert rate_curve(source, pack, cache) == curve
    point = curve.points[2]
    assert point.bits == pytest.approx(bits_with_mips(pack))
    assert point.psnr_db == point.by_map["base"] == pytest.approx(pack.textures[0].psnr_db)


def test_a_record_is_read_as_it_was_written(tmp_path: Path) -> None:
    own, path = record(texture("roof")), tmp_path / "report.json"
    path.write_bytes(msgspec.json.encode(own))
    assert read_record(path) == own


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"format": 99}', "[" * 100_000, '{"textures": [1]}'])
def test_a_wrong_record_is_refused_in_one_line(tmp_path: Path, text: str) -> None:
    path = tmp_path / "report.json"
    path.write_text(text)
    with pytest.raises(InputError) as raised:
        read_record(path)
    assert str(raised.value).startswith(f"{path}: ")
    assert "\n" not in str(raised.value)


def test_a_record_of_another_format_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "report.json"
    path.write_bytes(msgspec.json.encode(msgspec.structs.replace(record(), format=99)))
    with pytest.raises(InputError, match="has format 99"):
        read_record(path)
