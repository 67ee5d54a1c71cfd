"""What `info` certifies of a pack, and what `--precision auto` takes for it."""

from pathlib import Path

import pytest
from tests.support.packs import random_pack

from ntc.codec.config import CodecConfig
from ntc.pack.file import read_pack, write_pack
from viewer.cli.info import pack_json, pack_lines
from viewer.cli.sources import resolve_precision

HALVES = CodecConfig(hidden_width=16, weight_bits=16)


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
    assert resolve_precision("auto", random_pack(config=HALVES), None) == "fp16"
    assert "precision fp16: " in capsys.readouterr().out
    assert resolve_precision("auto", None, None) == "fp32"
    assert resolve_precision("fp16-arithmetic", None, None) == "fp16-arithmetic"
