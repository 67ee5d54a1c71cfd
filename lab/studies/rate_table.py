"""Rate and distortion of several codecs: the table of their points, and the plot of their curves."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass

import numpy as np
from matplotlib.figure import Figure

from lab.studies.set_quality import SetQuality
from viewer.cli.table import Cell, Column, Table

COLUMNS = (
    Column("curve", "codec"),
    Column("setting", "setting"),
    Column("bits_per_texel", "bits/texel", 3),
    Column("file_bits_per_texel", "bits/texel of files", 3),
    Column("mean_db", "mean dB"),
    Column("of_mean_mse_db", "dB of mean MSE"),
    Column("worst_db", "worst dB"),
    Column("ssim", "SSIM", 4),
    Column("flip", "FLIP", 4),
    Column("ssimulacra2", "SSIMULACRA2", 1),
    Column("jod", "JOD", 2),
    Column("seconds", "s", 1),
)
PLOTTED = (("mean_db", "PSNR, mean of textures, dB"), ("of_mean_mse_db", "PSNR of the mean MSE, dB"))
DASHED = ("BC", "ASTC", "JPEG", "AVIF", "XUASTC", "ETC1S")
"""Curves that are not this program's are dashed."""


@dataclass(frozen=True)
class RatePoint:
    """One codec in one setting on the whole set."""

    curve: str
    """The codec, and of which kind: points of one curve are joined."""
    setting: str
    """What distinguishes it from the other points of its curve."""
    quality: SetQuality

    def row(self) -> dict[str, Cell]:
        """The point as a row of the table."""
        return {"curve": self.curve, "setting": self.setting, **asdict(self.quality)}


def rate_table(points: Sequence[RatePoint]) -> Table:
    """One row for each point, in their order."""
    rows: list[Mapping[str, Cell]] = [point.row() for point in points]
    return Table([c for c in COLUMNS if any(row.get(c.key) is not None for row in rows)], rows)


def rate_figure(panels: Mapping[str, Sequence[RatePoint]]) -> Figure:
    """PSNR over bits a texel: a row of two plots for each set of textures, by its title."""
    figure = Figure(figsize=(12, 4.4 * len(panels) + 0.8), layout="constrained")
    grid = figure.subplots(len(panels), len(PLOTTED), squeeze=False)
    names = list(dict.fromkeys(point.curve for points in panels.values() for point in points))
    for (title, points), row in zip(panels.items(), grid, strict=True):
        for axes, (key, label) in zip(row, PLOTTED, strict=True):
            for number, name in enumerate(names):
                line = sorted(
                    (point.quality.bits_per_texel, getattr(point.quality, key))
                    for point in points
                    if point.curve == name
                )
                style = "--" if name.startswith(DASHED) else "-"
                axes.plot(
                    *zip(*line, strict=True), style, marker="o", markersize=3, color=f"C{number % 10}", label=name
                )
            axes.set_xlabel("bits per texel, all mips and tables")
            axes.set_ylabel(label)
            axes.set_title(title, fontsize=10)
            axes.grid(alpha=0.3)
    handles, labels = grid[0][0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=4, fontsize=8)
    return figure


def disk_figure(panels: Mapping[str, Sequence[RatePoint]]) -> Figure:
    """Mean PSNR over the bits of whole files: a plot for each set of textures, by its title."""
    figure = Figure(figsize=(6.4 * len(panels), 5.2), layout="constrained")
    grid = figure.subplots(1, len(panels), squeeze=False)[0]
    names = list(dict.fromkeys(each.curve for points in panels.values() for each in points if _is_file(each)))
    for (title, points), axes in zip(panels.items(), grid, strict=True):
        for number, name in enumerate(names):
            line = sorted(
                (each.quality.file_bits_per_texel or 0.0, each.quality.mean_db)
                for each in points
                if each.curve == name and _is_file(each)
            )
            style = "--" if name.startswith(DASHED) else "-"
            axes.plot(*zip(*line, strict=True), style, marker="o", markersize=3, color=f"C{number % 10}", label=name)
        axes.set_xlabel("bits per texel of mip 0, whole files with all mips")
        axes.set_ylabel(PLOTTED[0][1])
        axes.set_title(title, fontsize=10)
        axes.grid(alpha=0.3)
    handles, labels = grid[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=4, fontsize=8)
    return figure


def _is_file(point: RatePoint) -> bool:
    return point.quality.file_bits_per_texel is not None


def disk_rows(points: Sequence[RatePoint], decibels: Sequence[float]) -> list[dict[str, Cell]]:
    """For each of `decibels`, the bits a texel of files at which each curve reaches it, between its points; None beyond them."""
    rows = list[dict[str, Cell]]()
    for wanted in decibels:
        row: dict[str, Cell] = {"mean_db": wanted}
        for name in dict.fromkeys(each.curve for each in points if _is_file(each)):
            line = sorted(
                (each.quality.mean_db, each.quality.file_bits_per_texel or 0.0)
                for each in points
                if each.curve == name and _is_file(each)
            )
            reached, bits = zip(*line, strict=True)
            inside = reached[0] <= wanted <= reached[-1]
            # Bits grow by a factor for each dB.
            row[name] = float(2.0 ** np.interp(wanted, reached, np.log2(bits))) if inside else None
        rows.append(row)
    return rows
