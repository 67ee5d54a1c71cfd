"""Tables of `ntc-viewer bench`."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import TypeVar

import numpy as np

from lab.bench.scene import SceneBenchRow
from lab.bench.worst_case import WorstCaseRow
from viewer.scene.text_table import Cell, Column, Table

Number = TypeVar("Number", int, float)
OTHER_PASSES = ("cull", "visibility", "composite")
"""Passes of a frame besides the one that writes albedo."""
WORST_CASE_COLUMNS = (
    Column("size", "pixels"),
    Column("cut", "decoded as"),
    Column("decoders", "decoders in a wave"),
    Column("path", "path"),
    Column("precision", "precision"),
    Column("median_ms", "ms"),
    Column("min_ms", "min ms"),
    Column("max_ms", "max ms"),
    Column("to_shared", "times the shared decoder"),
    Column("to_one", "times one decoder by this path"),
    Column("gigaflops", "GFLOP/s"),
    Column("largest_difference", "largest difference", 6),
)
SCENE_COLUMNS = (
    Column("source", "pack"),
    Column("path", "path"),
    Column("precision", "precision"),
    Column("filter", "filter"),
    Column("decode_ms", "decode ms"),
    *(Column(f"{name}_ms", f"{name} ms") for name in OTHER_PASSES),
    Column("frame_ms", "frame ms"),
    Column("to_deferred", "times deferred fp32"),
    Column("decoded_pixels", "decoded pixels"),
    Column("excess", "excess"),
    Column("psnr_db", "PSNR dB"),
    Column("flip", "FLIP", 4),
    Column("reference_step", "most 8-bit steps from the reference"),
    Column("float64_millionths", "largest error against float64, millionths", 3),
    Column("float64_psnr_db", "PSNR dB against float64"),
    Column("float64_step", "most 8-bit steps from float64"),
    Column("largest_step", "most 8-bit steps from deferred fp32"),
    Column("pareto", "on the Pareto front"),
)


def pareto_front(points: Sequence[tuple[float, float]]) -> tuple[bool, ...]:
    """Return for each (cost, quality) whether no other point is at least as good in both and better in one.

    Equal points are on the front together.
    """

    def beats(other: tuple[float, float], point: tuple[float, float]) -> bool:
        return other != point and other[0] <= point[0] and other[1] >= point[1]

    return tuple(not any(beats(other, point) for other in points) for point in points)


def worst_case_table(rows: Sequence[WorstCaseRow]) -> Table:
    """Return the table of the worst case, with a row for each size and way to decode."""

    def cells(row: WorstCaseRow) -> dict[str, Cell]:
        cut = "one picture" if row.tiles == 1 else f"{row.tiles} tiles of {row.tile_width}x{row.tile_height}"
        return {**asdict(row), "size": f"{row.width}x{row.height}", "cut": cut}

    return Table(WORST_CASE_COLUMNS, [cells(row) for row in rows])


def _mean(values: Sequence[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return float(np.mean(known)) if known else None


def _most(values: Sequence[Number | None]) -> Number | None:
    return max((value for value in values if value is not None), default=None)


def scene_table(rows: Sequence[SceneBenchRow]) -> Table:
    """Return the table of a scene, with a row for each slot: means over the cameras, and whether it is on the Pareto front."""
    slots = list(dict.fromkeys((row.source, row.path, row.precision, row.filter) for row in rows))
    table: list[dict[str, Cell]] = []
    for slot in slots:
        same = [row for row in rows if (row.source, row.path, row.precision, row.filter) == slot]
        largest = _most([row.float64_max for row in same])
        table.append(
            {
                "source": slot[0],
                "path": slot[1],
                "precision": slot[2],
                "filter": slot[3],
                "decode_ms": _mean([row.decode_ms for row in same]),
                "frame_ms": _mean([row.frame_ms for row in same]),
                **{f"{name}_ms": _mean([row.passes_ms.get(name) for row in same]) for name in OTHER_PASSES},
                "decoded_pixels": int(np.mean([row.decoded_pixels for row in same])),
                "excess": sum(row.excess for row in same),
                "psnr_db": _mean([row.psnr_db for row in same]),
                "flip": _mean([row.flip for row in same]),
                "reference_step": _most([row.reference_step for row in same]),
                "float64_max": largest,
                "float64_millionths": None if largest is None else largest * 1e6,
                "float64_psnr_db": _mean([row.float64_psnr_db for row in same]),
                "float64_step": _most([row.float64_step for row in same]),
                "largest_step": _most([row.largest_step for row in same]),
            }
        )
    exact = {
        row["source"]: row["decode_ms"]
        for row in table
        if (row["path"], row["precision"], row["filter"]) == ("deferred", "fp32", "exact")
    }
    for row in table:
        base = exact.get(row["source"])
        row["to_deferred"] = float(row["decode_ms"] or 0.0) / float(base) if base else None
        row["pareto"] = ""
    judged = [row for row in table if row["psnr_db"] is not None]
    for row, is_on_front in zip(judged, pareto_front([time_and_quality(row) for row in judged]), strict=True):
        row["pareto"] = "yes" if is_on_front else ""
    return Table(SCENE_COLUMNS, table)


def time_and_quality(row: Mapping[str, Cell]) -> tuple[float, float]:
    """Return (ms of the decode pass, PSNR in dB, rounded to hundredths) of a slot."""
    return float(row["decode_ms"] or 0.0), round(float(row["psnr_db"] or 0.0), 2)


NEAR_DB = 0.1
"""Invisible loss of PSNR in dB, which a faster path may have."""


def path_to_take(table: Table) -> str:
    """Return a line for each pack of a scene's table: its fastest path whose PSNR is within NEAR_DB of the pack's best."""
    lines = []
    packs = [row for row in table.rows if row["path"] and row["psnr_db"] is not None]
    for source in dict.fromkeys(row["source"] for row in packs):
        points = [time_and_quality(row) for row in packs if row["source"] == source]
        rows = [row for row in packs if row["source"] == source]
        best = max(quality for _, quality in points)
        near = [row for row in rows if time_and_quality(row)[1] >= best - NEAR_DB]
        row = min(near, key=time_and_quality)
        time, quality = time_and_quality(row)
        lines.append(f"{source}: take --path {row['path']} in {row['precision']}: {time:.1f} ms, {quality:.2f} dB")
    return "\n".join(lines)
