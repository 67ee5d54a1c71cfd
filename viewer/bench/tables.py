"""Tables and the plot of `ntc-viewer bench`."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import TypeVar

import numpy as np
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure

from ntc.studies.table import Cell, Column, Table
from viewer.bench.pareto import pareto_front
from viewer.bench.scaling import LAYOUTS, PATHS, ScalingRow, SweepName
from viewer.bench.scene import SceneBenchRow
from viewer.bench.worst_case import WorstCaseRow

Number = TypeVar("Number", int, float)
WORST_CASE_COLUMNS = (
    Column("size", "pixels"),
    Column("cut", "decoded as"),
    Column("decoders", "decoders in a wave"),
    Column("path", "path"),
    Column("precision", "precision"),
    Column("median_ms", "ms"),
    Column("least_ms", "least ms"),
    Column("most_ms", "most ms"),
    Column("to_shared", "times the shared decoder"),
    Column("to_one", "times one decoder by this path"),
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
    Column("reference_step", "most 8-bit steps from the reference"),
    Column("float64_max", "largest error against float64", 6),
    Column("float64_psnr_db", "PSNR dB against float64"),
    Column("float64_step", "most 8-bit steps from float64"),
    Column("largest_step", "most 8-bit steps from the first path"),
    Column("pareto", "on the Pareto front"),
)
SCALING_COLUMNS = (
    Column("sweep", "sweep"),
    Column("value", "value"),
    Column("layout", "layout"),
    Column("path", "path"),
    Column("size", "pixels"),
    Column("tiles", "tiles"),
    Column("textures", "textures"),
    Column("decoders", "decoders"),
    Column("hidden_width", "hidden neurons"),
    Column("median_ms", "ms"),
    Column("least_ms", "least ms"),
    Column("most_ms", "most ms"),
    Column("nanoseconds_per_pixel", "ns a pixel", 3),
)
FILLS = (1.0, 0.0, 0.5)
"""Opacity of a point's filling, by precision."""
SWEEPS: dict[SweepName, str] = {
    "resolution": "pixels",
    "textures": "textures, one decoder",
    "decoders": "decoders",
    "decoder size": "neurons of each hidden layer",
}
"""What the four plots of the scaling have below them."""


def worst_case_table(rows: Sequence[WorstCaseRow]) -> Table:
    """One row for each size and way to decode."""

    def cells(row: WorstCaseRow) -> dict[str, Cell]:
        cut = "one picture" if row.tiles == 1 else f"{row.tiles} tiles of {row.tile_width}x{row.tile_height}"
        return {**asdict(row), "size": f"{row.width}x{row.height}", "cut": cut}

    return Table(WORST_CASE_COLUMNS, [cells(row) for row in rows])


def scaling_table(rows: Sequence[ScalingRow]) -> Table:
    """One row for each point of each curve."""
    return Table(SCALING_COLUMNS, [{**asdict(row), "size": f"{row.width}x{row.height}"} for row in rows])


def _mean(values: Sequence[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return float(np.mean(known)) if known else None


def _most(values: Sequence[Number | None]) -> Number | None:
    return max((value for value in values if value is not None), default=None)


def scene_table(rows: Sequence[SceneBenchRow]) -> Table:
    """One row for each slot: means over the cameras, and whether no other is both faster and closer to the reference."""
    slots = list(dict.fromkeys((row.source, row.path, row.precision) for row in rows))
    table: list[dict[str, Cell]] = []
    for slot in slots:
        same = [row for row in rows if (row.source, row.path, row.precision) == slot]
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
                "reference_step": _most([row.reference_step for row in same]),
                "float64_max": _most([row.float64_max for row in same]),
                "float64_psnr_db": _mean([row.float64_psnr_db for row in same]),
                "float64_step": _most([row.float64_step for row in same]),
                "largest_step": _most([row.largest_step for row in same]),
            }
        )
    exact = {
        row["source"]: row["decode_ms"] for row in table if (row["path"], row["precision"]) == ("deferred", "fp32")
    }
    for row in table:
        base = exact.get(row["source"])
        row["to_deferred"] = float(row["decode_ms"] or 0.0) / float(base) if base else None
        row["pareto"] = ""
    judged = [row for row in table if row["psnr_db"] is not None]
    for row, kept in zip(judged, pareto_front([_time_and_quality(row) for row in judged]), strict=True):
        row["pareto"] = "yes" if kept else ""
    return Table(SCENE_COLUMNS, table)


def _time_and_quality(row: Mapping[str, Cell]) -> tuple[float, float]:
    return float(row["decode_ms"] or 0.0), float(row["psnr_db"] or 0.0)


def time_error_figure(table: Table, title: str) -> Figure:
    """PSNR over the time of the decode pass, the Pareto front joined: up and to the left is better."""
    figure = Figure(figsize=(9, 5.5), layout="constrained")
    figure.suptitle(title, fontsize=10)
    axes = figure.subplots()
    shown = [row for row in table.rows if row["psnr_db"] is not None]
    colors = {name: f"C{number}" for number, name in enumerate(dict.fromkeys(str(row["source"]) for row in shown))}
    markers = dict(zip(dict.fromkeys(str(row["path"]) for row in shown), "os^Dvp*", strict=False))
    fills = dict(zip(dict.fromkeys(str(row["precision"]) for row in shown), FILLS, strict=False))
    for row in shown:
        axes.scatter(
            *_time_and_quality(row),
            edgecolors=colors[str(row["source"])],
            marker=markers.get(str(row["path"]), "P"),
            facecolors=to_rgba(colors[str(row["source"])], fills.get(str(row["precision"]), 0.15)),
            label=f"{row['source']}, {row['path']}, {row['precision']}",
        )
    front = sorted(_time_and_quality(row) for row in shown if row["pareto"])
    axes.plot([x for x, _ in front], [y for _, y in front], color="grey", linewidth=1.0, zorder=0)
    axes.scatter(
        [x for x, _ in front], [y for _, y in front], s=130, facecolors="none", edgecolors="black", label="Pareto front"
    )
    axes.set_xlabel("decode pass, ms, mean of the cameras")
    axes.set_ylabel("PSNR against the reference picture, dB")
    axes.set_xlim(left=0.0)
    axes.grid(alpha=0.3)
    axes.legend(fontsize=7, ncols=2)
    return figure


def scaling_figure(rows: Sequence[ScalingRow], title: str) -> Figure:
    """Time over what each of the four sweeps changes; both axes logarithmic."""
    figure = Figure(figsize=(10, 7.5), layout="constrained")
    figure.suptitle(title, fontsize=10)
    lines = {"blocks": "-", "interleaved": "--"}
    for axes, (sweep, label) in zip(figure.subplots(2, 2).flat, SWEEPS.items(), strict=True):
        for number, path in enumerate(PATHS):
            for layout in LAYOUTS:
                curve = [row for row in rows if (row.sweep, row.path, row.layout) == (sweep, path, layout)]
                if not curve:
                    continue
                curve.sort(key=lambda row: row.value)
                values = [row.value for row in curve]
                axes.plot(
                    values,
                    [row.median_ms for row in curve],
                    color=f"C{number}",
                    linestyle=lines[layout],
                    marker="o",
                    markersize=4,
                    label=f"{path}, {layout}",
                )
                spread = [row.least_ms for row in curve], [row.most_ms for row in curve]
                axes.fill_between(values, *spread, color=f"C{number}", alpha=0.15, linewidth=0.0)
        axes.set_xscale("log")
        axes.set_yscale("log")
        axes.set_xlabel(label)
        axes.set_ylabel("decode pass, ms")
        axes.grid(alpha=0.3)
        if axes.lines:
            axes.legend(fontsize=7)
    return figure
