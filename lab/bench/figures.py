"""Plots of `ntc-viewer bench`."""

from typing import Any

from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from lab.bench.tables import time_and_quality
from viewer.scene.text_table import Table

MARKERS = "os^Dvp*"
FILLS = (1.0, 0.0, 0.5, 0.2)
"""Opacities of the fill of points, by precision."""


def time_error_figure(table: Table, title: str) -> Figure:
    """Return a plot of PSNR over the time of the decode pass, with rings and a line at the Pareto front. Up and left is better."""
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
    times, qualities = [time for time, _ in front], [quality for _, quality in front]
    axes.plot(times, qualities, color="grey", linewidth=1.0, zorder=0)
    axes.scatter(times, qualities, s=130, facecolors="none", edgecolors="black")
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
