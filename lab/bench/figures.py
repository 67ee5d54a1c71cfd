"""Plots of `ntc-viewer bench`."""

from collections.abc import Sequence
from typing import Any, Literal

from matplotlib.axes import Axes
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import NullFormatter

from lab.bench.scaling import LAYOUTS, PATHS, Layout, ScalingRow, SweepName
from lab.bench.tables import time_and_quality
from viewer.cli.table import Table

MARKERS = "os^Dvp*"
FILLS = (1.0, 0.0, 0.5, 0.2)
"""Opacity of the fill of a point, one for each precision."""
SWEEPS: dict[SweepName, str] = {
    "resolution": "pixels",
    "textures": "textures, one decoder for all",
    "decoders": "decoders",
    "decoder size": "neurons of each hidden layer",
}
"""Labels of the horizontal axes of the four plots."""
LINES: dict[Layout, Literal["-", "--"]] = {"blocks": "-", "interleaved": "--"}


def time_error_figure(table: Table, title: str) -> Figure:
    """PSNR over the time of the decode pass, the Pareto front joined and ringed: up and to the left is better."""
    figure = Figure(figsize=(9, 5.5), layout="constrained")
    figure.suptitle(title, fontsize=10)
    axes = figure.subplots()
    shown = [row for row in table.rows if row["psnr_db"] is not None]

    def distinct(key: str) -> list[str]:
        return list(dict.fromkeys(str(row[key]) for row in shown))

    colors = {name: f"C{number % 10}" for number, name in enumerate(distinct("source"))}
    markers = {name: MARKERS[number % len(MARKERS)] for number, name in enumerate(distinct("path"))}
    fills = {name: FILLS[number % len(FILLS)] for number, name in enumerate(distinct("precision"))}
    for row in shown:
        color = colors[str(row["source"])]
        axes.scatter(
            *time_and_quality(row),
            edgecolors=color,
            facecolors=to_rgba(color, fills[str(row["precision"])]),
            marker=markers[str(row["path"])],
        )
    front = sorted(time_and_quality(row) for row in shown if row["pareto"])
    times, worths = [time for time, _ in front], [worth for _, worth in front]
    axes.plot(times, worths, color="grey", linewidth=1.0, zorder=0)
    axes.scatter(times, worths, s=130, facecolors="none", edgecolors="black")
    plain: dict[str, Any] = {"linestyle": "none", "color": "black", "markeredgecolor": "black"}
    handles = [Line2D([], [], linestyle="none", marker="o", color=color, label=name) for name, color in colors.items()]
    handles += [Line2D([], [], marker=marker, label=name, **plain) for name, marker in markers.items()]
    handles += [
        Line2D([], [], marker="o", markerfacecolor=to_rgba("black", fill), label=name, **plain)
        for name, fill in fills.items()
    ]
    handles.append(Line2D([], [], marker="o", markersize=11, markerfacecolor="none", label="Pareto front", **plain))
    figure.legend(handles=handles, loc="outside right upper", fontsize=8)
    axes.set_xlabel("decode pass, ms, mean of the cameras")
    axes.set_ylabel("PSNR against the reference picture, dB")
    axes.set_xlim(left=0.0)
    axes.ticklabel_format(useOffset=False)
    axes.grid(alpha=0.3)
    return figure


def scaling_figure(rows: Sequence[ScalingRow], title: str) -> Figure:
    """Time over what each of the four sweeps changes; both axes logarithmic, minimum to maximum shaded."""
    figure = Figure(figsize=(10, 7.5), layout="constrained")
    figure.suptitle(title, fontsize=10)
    for axes, (sweep, label) in zip(figure.subplots(2, 2).flat, SWEEPS.items(), strict=True):
        _draw_sweep(axes, [row for row in rows if row.sweep == sweep])
        axes.set_xlabel(label)
    handles = [
        Line2D([], [], color=f"C{number}", linestyle=LINES[layout], label=f"{path}, {layout}")
        for number, path in enumerate(PATHS)
        for layout in LAYOUTS
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=len(handles), fontsize=8)
    return figure


def _draw_sweep(axes: Axes, rows: Sequence[ScalingRow]) -> None:
    for number, path in enumerate(PATHS):
        for layout in LAYOUTS:
            curve = sorted((row for row in rows if (row.path, row.layout) == (path, layout)), key=lambda row: row.value)
            values, color = [row.value for row in curve], f"C{number}"
            spread = [row.min_ms for row in curve], [row.max_ms for row in curve]
            line: dict[str, Any] = {"color": color, "linestyle": LINES[layout], "marker": "o", "markersize": 4.0}
            axes.plot(values, [row.median_ms for row in curve], **line)
            axes.fill_between(values, *spread, color=color, alpha=0.15, linewidth=0.0)
    axes.set_xscale("log")
    axes.set_yscale("log")
    names = {row.value: f"{row.width}x{row.height}" if row.sweep == "resolution" else f"{row.value}" for row in rows}
    axes.set_xticks(list(names), list(names.values()))
    axes.set_xticks([], minor=True)
    axes.yaxis.set_major_formatter("{x:g}")
    low, high = axes.get_ylim()
    # Numbers between powers of ten are only written where they do not run into each other.
    axes.yaxis.set_minor_formatter("{x:g}" if high < 20.0 * low else NullFormatter())
    axes.tick_params(axis="y", which="minor", labelsize=7)
    axes.set_ylabel("decode pass, ms")
    axes.grid(alpha=0.3)
