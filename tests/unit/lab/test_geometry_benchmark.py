"""The table of scenes of very many triangles is that of the committed figures."""

import json
from pathlib import Path

from lab.benchmarks.geometry.__main__ import plot, tables

ROOT = Path(__file__).resolve().parents[3]
FIGURES = ROOT / "lab/benchmarks/results/geometry_llvmpipe.json"
MOST_MIB = 4096
"""Of the process, up to the first picture; the renderer's own buffers lie in it."""


def test_the_table_has_every_scene() -> None:
    records = json.loads(FIGURES.read_text())["scenes"]
    assert all(f"| {record['scene']} |" in tables(records) for record in records)


def test_fifty_million_triangles_open_below_four_gigabytes() -> None:
    records = json.loads(FIGURES.read_text())["scenes"]
    largest = max(records, key=lambda record: record["triangles"])
    assert largest["triangles"] > 50_000_000
    assert largest["first_picture_peak_mib"] < MOST_MIB
    assert largest["arrays_bytes_a_triangle"] < 24


def test_figures_are_plotted(tmp_path: Path) -> None:
    file = tmp_path / "plot.png"
    plot(json.loads(FIGURES.read_text())["scenes"], file)
    assert file.stat().st_size > 10_000
