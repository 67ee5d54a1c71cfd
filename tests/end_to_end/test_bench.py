"""`ntc-viewer bench`: every kind of it on very small pictures, and bad input."""

import json
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any, get_args

import numpy as np
import pytest

from lab.bench.interleaved import time_interleaved, warm_up_rounds
from lab.bench.random_pack import random_pack
from lab.commands import bench as command
from ntc.codec.grid.model import GridConfig
from ntc.pack.file import write_pack
from tests.end_to_end.conftest import two_squares
from viewer import cli
from viewer.gl.context import create_headless_context
from viewer.gl.features import WITHOUT_VARIABLE
from viewer.render.resources.decoding_shaders import EVERYWHERE
from viewer.scene.images import read_image
from viewer.scene.load import load_scene
from viewer.state.view_state import DecodePath, Precision

TINY = ("--repeats", "1", "--codec", "paper", "--hidden-width", "4")
WORST = ("--what", "worst-case", "--worst-sizes", "16x16", "40x24", "--decoders", "1", "3")


@pytest.fixture(scope="module")
def scene_path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """scene.glb with a small random pack beside it."""
    path = two_squares().write(tmp_path_factory.mktemp("bench") / "scene.glb")
    hashes = [texture.pixel_hash for texture in load_scene(path).textures]
    codec = GridConfig(hidden_width=4, positional_octaves=1)
    write_pack(path.with_name("scene.random.ntc"), random_pack(((32, 32), (16, 16)), (0, 1), codec, hashes=hashes))
    return path


def numbers(value: object) -> Iterator[float]:
    """All numbers in a JSON value."""
    if isinstance(value, dict | list):
        for part in value.values() if isinstance(value, dict) else value:
            yield from numbers(part)
    elif isinstance(value, int | float):
        yield value


def recorded(path: Path, *parts: str) -> dict[str, Any]:
    """The record at `path` after a look at what every record has."""
    record: dict[str, Any] = json.loads(path.read_text())
    assert set(record) == {"machine", *parts}
    assert {"renderer", "vendor", "driver", "timer", "processor", "cores", "python"} <= set(record["machine"])
    assert all(math.isfinite(number) for number in numbers(record))
    for part in parts:
        assert record[part]["settings"]["repeats"] == 1
        for row in record[part]["rows"]:
            median = row.get("median_ms", row.get("decode_ms"))
            assert 0.0 < row["min_ms"] <= median <= row["max_ms"]
    return record


def rows_of_table(path: Path) -> int:
    """Rows of the table in a Markdown file."""
    lines = [line for line in path.read_text().splitlines() if line.startswith("|")]
    assert len({line.replace("\\|", "").count("|") for line in lines}) == 1
    return len(lines) - 2


def test_the_worst_case_with_tiles_where_memory_ends(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(command, "MEBIBYTE", 1 << 10)
    out = tmp_path / "r.json"
    assert cli.main(["bench", "--json", str(out), "--memory-mb", "16", *TINY, *WORST, "--precisions", "fp32"]) == 0
    rows = recorded(out, "worst_case")["worst_case"]["rows"]
    found = {(row["width"], row["decoders"], row["path"]) for row in rows}
    ways = {(count, path) for count in (1, 3) for path in ("deferred", "binned")} | {(1, "deferred, shared")}
    assert found == {(width, *way) for width in (16, 40) for way in ways}
    assert len(rows) == len(found)
    for row in rows:
        assert (row["tiles"] > 1) == (row["width"] == 40)
        assert row["tile_width"] * row["tile_height"] * row["tiles"] >= row["width"] * row["height"]
        assert row["largest_difference"] <= 1e-4
        assert (row["to_shared"] == 1.0) or row["path"] != "deferred, shared"
        assert (row["to_one"] == 1.0) or row["decoders"] != 1
    table = tmp_path / "r.worst-case.md"
    assert rows_of_table(table) == len(rows)
    assert "one picture" in table.read_text()
    assert "tiles of 1" in table.read_text() or "tiles of 2" in table.read_text()
    assert {path.name for path in tmp_path.iterdir()} == {"r.json", "r.worst-case.md"}
    assert str(out) in capsys.readouterr().out


def test_a_scene(tmp_path: Path, scene_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "r.json"
    arguments = ["bench", str(scene_path), "--json", str(out), *TINY, "--what", "scene", "--size", "48x32"]
    assert cli.main([*arguments, "--precisions", *get_args(Precision)]) == 0
    assert ": take --path " in capsys.readouterr().err
    scene = recorded(out, "scene")["scene"]
    decoded = [row for row in scene["rows"] if row["source"] != "reference"]
    # Half arithmetic besides, where the driver has it.
    found = {(row["path"], row["precision"]) for row in decoded}
    for precisions, holds in ((EVERYWHERE, found.issuperset), (get_args(Precision), found.issubset)):
        assert holds({(path, precision) for path in get_args(DecodePath) for precision in precisions})
    assert len(scene["rows"]) == len(decoded) + 1
    for row in decoded:
        assert row["passes_ms"]["visibility"] > 0.0
        assert row["frame_ms"] >= row["passes_ms"]["visibility"]
        assert 0 < row["decoded_pixels"] <= 48 * 32
        assert 3.0 < row["psnr_db"] < 60.0
        assert 0.0 < row["flip"] <= 1.0
        assert 1 <= row["reference_step"] <= 255
        assert row["float64_pixels"] == row["decoded_pixels"]
    plain = next(row for row in decoded if (row["path"], row["precision"]) == ("deferred", "fp32"))
    assert plain["largest_step"] == 0
    assert plain["float64_max"] <= 1e-4
    assert plain["float64_psnr_db"] > 80.0
    reference = scene["rows"][0]
    assert (reference["psnr_db"], reference["float64_max"], reference["decoded_pixels"]) == (None, None, 0)
    front = [row for row in scene["table"] if row["pareto"]]
    assert front
    assert min(decoded, key=lambda row: float(row["decode_ms"]))["path"] in {row["path"] for row in front}
    assert rows_of_table(tmp_path / "r.md") == len(scene["table"])
    assert read_image(tmp_path / "r.png").shape[1] > 500
    assert {path.name for path in tmp_path.iterdir()} == {"r.json", "r.md", "r.png"}


def test_what_was_done_is_kept_when_it_is_stopped(
    tmp_path: Path, scene_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def stopped(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(command, "bench_scene", stopped)
    arguments = [
        "bench",
        str(scene_path),
        "--json",
        str(tmp_path / "r.json"),
        *TINY,
        "--precisions",
        "fp32",
        *WORST[2:],
        "--thorough",
    ]
    assert cli.main(arguments) == cli.INTERRUPTED
    assert "interrupted" in capsys.readouterr().err
    recorded(tmp_path / "r.json", "worst_case")
    assert {path.name for path in tmp_path.iterdir()} == {"r.json", "r.worst-case.md"}


def test_candidates_take_turns() -> None:
    context = create_headless_context()
    called: list[str] = []
    told: list[tuple[int, int]] = []
    runs = [lambda name=name: called.append(name) for name in "abc"]
    spreads = time_interleaved(context, runs, 3, lambda done, of: told.append((done, of)))
    rounds = warm_up_rounds(context) + 3
    assert "".join(called) == "abc" * rounds
    assert told == [(number + 1, rounds) for number in range(rounds)]
    assert len(spreads) == 3
    assert all(0.0 <= spread.min_ms <= spread.median_ms <= spread.max_ms for spread in spreads)
    assert np.isfinite([spread.median_ms for spread in spreads]).all()
    context.gl.release()


def test_without_compute_the_scene_alone_is_timed_by_the_paths_that_draw(
    tmp_path: Path, scene_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv(WITHOUT_VARIABLE, "compute")
    out = tmp_path / "r.json"
    command = ["bench", str(scene_path), "--json", str(out), *TINY, "--size", "16x16", "--precisions", "fp32"]
    for arguments in (["--what", "worst-case"], ["--paths", "binned"]):
        assert cli.main([*command, *arguments]) == 2
        line = capsys.readouterr().err.strip()
        assert line.startswith(f"error: {' '.join(arguments)}: ")
        assert "OpenGL 4.3" in line
        assert "\n" not in line
        assert not out.exists()
    assert cli.main([*command, "--thorough"]) == 0
    assert capsys.readouterr().err.startswith("the worst case needs compute shaders")
    paths = {row["path"] for row in recorded(out, "scene")["scene"]["rows"]}
    assert paths == {"", "forward"}
