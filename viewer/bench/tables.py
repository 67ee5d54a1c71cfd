"""Tables and the plot of `ntc-viewer bench`."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict

import numpy as np
from matplotlib.figure import Figure

from ntc.studies.table import Cell, Column, Table
from viewer.bench.scene import SceneBenchRow
from viewer.bench.worst_case import WorstCaseRow

WORST_CASE_COLUMNS = (
    Column("decoders", "decoders in a wave"),
    Column("path", "path"),
    Column("precision", "precision"),
    Column("median_ms", "ms"),
    Column("least_ms", "least ms"),
    Column("most_ms", "most ms"),
    Column("to_shared", "times the shared decoder"),
    Column("gigaflops", "GFLOP/s"),
    Column("largest_difference", "largest difference", 6),
)
SCENE_COLUMNS = (
    Column("source", "pack"),
    Column("path", "path"),
    Column("precision", "precision"),
    Column("decode_ms", "decode ms"),
    Column("frame_ms", "frame ms"),
    Column("to_deferred", "times deferred fp32"),
    Column("decoded_pixels", "decoded pixels"),
    Column("excess", "excess"),
    Column("psnr_db", "PSNR dB"),
    Column("flip", "FLIP", 4),
    Column("largest_step", "most 8-bit steps from deferred fp32"),
    Column("pareto", "on the Pareto front"),
)


def worst_case_table(rows: Sequence[WorstCaseRow]) -> Table:
    """One row for each way to decode."""
    return Table(WORST_CASE_COLUMNS, [asdict(row) for row in rows])


def _mean(values: Sequence[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return float(np.mean(known)) if known else None


def scene_table(rows: Sequence[SceneBenchRow]) -> Table:
    """One row for each slot: means over the cameras, and whether no other is both faster and closer to the reference."""
    slots = list(dict.fromkeys((row.source, row.path, row.precision) for row in rows))
    table: list[dict[str, Cell]] = []
    for slot in slots:
        same = [row for row in rows if (row.source, row.path, row.precision) == slot]
        steps = [row.largest_step for row in same if row.largest_step is not None]
        table.append(
            {
                "source": slot[0],
                "path": slot[1],
                "precision": slot[2],
                "decode_ms": _mean([row.decode_ms for row in same]),
                "frame_ms": _mean([row.frame_ms for row in same]),
                "decoded_pixels": int(np.mean([row.decoded_pixels for row in same])),
                "excess": sum(row.excess for row in same),
                "psnr_db": _mean([row.psnr_db for row in same]),
                "flip": _mean([row.flip for row in same]),
                "largest_step": max(steps, default=None),
            }
        )
    exact = {
        row["source"]: row["decode_ms"] for row in table if (row["path"], row["precision"]) == ("deferred", "fp32")
    }
    for row in table:
        base = exact.get(row["source"])
        row["to_deferred"] = float(row["decode_ms"] or 0.0) / float(base) if base else None
        row["pareto"] = "yes" if row["psnr_db"] is not None and not any(_beats(other, row) for other in table) else ""
    return Table(SCENE_COLUMNS, table)


def _beats(other: Mapping[str, Cell], row: Mapping[str, Cell]) -> bool:
    if other is row or other["psnr_db"] is None:
        return False
    better = float(other["psnr_db"]) - float(row["psnr_db"] or 0.0)
    faster = float(row["decode_ms"] or 0.0) - float(other["decode_ms"] or 0.0)
    return (better >= 0.0 and faster > 0.0) or (better > 0.0 and faster >= 0.0)


def time_error_figure(table: Table, title: str) -> Figure:
    """PSNR over the time of the decode pass, the Pareto front joined: up and to the left is better."""
    figure = Figure(figsize=(9, 5.5), layout="constrained")
    figure.suptitle(title, fontsize=10)
    axes = figure.subplots()
    shown = [row for row in table.rows if row["psnr_db"] is not None]
    colors = {name: f"C{number}" for number, name in enumerate(dict.fromkeys(str(row["source"]) for row in shown))}
    markers = {"deferred": "o", "forward": "s", "binned": "^"}
    for row in shown:
        axes.scatter(
            float(row["decode_ms"] or 0.0),
            float(row["psnr_db"] or 0.0),
            color=colors[str(row["source"])],
            marker=markers.get(str(row["path"]), "D"),
            facecolors="none" if row["precision"] == "fp16" else None,
            label=f"{row['source']}, {row['path']}, {row['precision']}",
        )
    front = sorted((float(row["decode_ms"] or 0.0), float(row["psnr_db"] or 0.0)) for row in shown if row["pareto"])
    axes.plot([x for x, _ in front], [y for _, y in front], color="grey", linewidth=1.0, label="Pareto front")
    axes.set_xlabel("decode pass, ms, mean of the cameras")
    axes.set_ylabel("PSNR against the reference picture, dB")
    axes.set_xlim(left=0.0)
    axes.grid(alpha=0.3)
    axes.legend(fontsize=7, ncols=2)
    return figure
