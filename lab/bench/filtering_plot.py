"""Table and curves of `ntc-viewer study filtering`."""

from collections.abc import Callable, Sequence

import numpy as np
from matplotlib.figure import Figure

from lab.bench.filtering_sweeps import FilteringRow
from viewer.cli.table import Cell, Column, Table

COLUMNS = (
    Column("way", "way"),
    Column("magnified", "magnified, dB"),
    Column("minified", "minified, dB"),
    Column("straight", "straight on, dB"),
    Column("grazing", "most tilted, dB"),
    Column("moving", "moving, dB"),
    Column("flicker", "flicker, 8-bit steps", 3),
)


def _mean(values: Sequence[float]) -> float | None:
    return float(np.mean(values)) if values else None


def filtering_table(rows: Sequence[FilteringRow]) -> Table:
    """A row for each way: means over parts of the sweeps."""
    table: list[dict[str, Cell]] = []
    for way in dict.fromkeys(row.way for row in rows):
        own = [row for row in rows if row.way == way]
        shrinking = [row for row in own if row.sweep == "shrinking"]
        tilting = sorted((row for row in own if row.sweep == "tilting"), key=lambda row: row.value)
        moving = [row for row in own if row.sweep == "moving"]
        table.append(
            {
                "way": way,
                "magnified": _mean([row.psnr_db for row in shrinking if row.value < 1.0]),
                "minified": _mean([row.psnr_db for row in shrinking if row.value > 1.0]),
                "straight": tilting[0].psnr_db if tilting else None,
                "grazing": tilting[-1].psnr_db if tilting else None,
                "moving": _mean([row.psnr_db for row in moving]),
                "flicker": _mean([row.flicker for row in moving if row.flicker is not None]),
            }
        )
    return Table(COLUMNS, table)


def _styles(names: Sequence[str]) -> dict[str, tuple[str, str]]:
    """(colour, line style) of each way: one colour for a way with several packs ("pack: way"), one style for a pack."""
    colours = {way: f"C{number}" for number, way in enumerate(dict.fromkeys(name.split(": ")[-1] for name in names))}
    packs = list(dict.fromkeys(name.partition(": ")[0] for name in names if ": " in name))
    lines = dict(zip(packs, (":", "-", "-."), strict=False))
    return {
        name: (
            colours[name.split(": ")[-1]],
            "--" if "reference" in name else lines.get(name.partition(": ")[0], "-"),
        )
        for name in names
    }


def filtering_figure(rows: Sequence[FilteringRow], title: str) -> Figure:
    """Four curves: shrinking, tilting, moving, flicker."""
    figure = Figure(figsize=(11, 7.5), layout="constrained")
    figure.suptitle(title, fontsize=10)
    axes = figure.subplots(2, 2).ravel()
    panels: tuple[tuple[str, str, str, Callable[[FilteringRow], float | None]], ...] = (
        ("shrinking", "texels a pixel, straight on", "PSNR, dB", lambda row: row.psnr_db),
        ("tilting", "degrees between normal and view", "PSNR, dB", lambda row: row.psnr_db),
        ("moving", "frame of a turning camera", "PSNR, dB", lambda row: row.psnr_db),
        ("moving", "frame of a turning camera", "flicker, 8-bit steps", lambda row: row.flicker),
    )
    styles = _styles(list(dict.fromkeys(row.way for row in rows)))
    for axis, (sweep, across, upward, value) in zip(axes, panels, strict=True):
        for way, (colour, line) in styles.items():
            points = [(row.value, value(row)) for row in rows if row.way == way and row.sweep == sweep]
            points = [point for point in points if point[1] is not None]
            axis.plot(
                [x for x, _ in points],
                [y for _, y in points],
                marker=".",
                color=colour,
                linestyle=line,
                label=way,
            )
        axis.set_xlabel(across)
        axis.set_ylabel(upward)
        axis.grid(alpha=0.3)
        if sweep == "shrinking":
            axis.set_xscale("log", base=2)
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=4, fontsize=8)
    return figure
