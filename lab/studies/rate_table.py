"""Table and plots of rate and distortion of several codecs."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from lab.studies.set_quality import SetQuality
from viewer.scene.text_table import Cell, Column, Table

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
"""Beginnings of the names of curves that are dashed: those of other programs' formats."""


@dataclass(frozen=True)
class RatePoint:
    """Point of a rate curve: one codec in one setting on the whole set."""

    curve: str
    """Name of the curve, such as codec and grouping. A line joins the points of a curve."""
    setting: str
    """Setting of the point, such as its bits or quality."""
    quality: SetQuality

    def row(self) -> dict[str, Cell]:
        """Return the point as a row of the table."""
        return {"curve": self.curve, "setting": self.setting, **asdict(self.quality)}


def rate_table(points: Sequence[RatePoint]) -> Table:
    """Return the table, with a row for each point in order."""
    rows: list[Mapping[str, Cell]] = [point.row() for point in points]
    return Table([c for c in COLUMNS if any(row.get(c.key) is not None for row in rows)], rows)


def rate_figure(points: Sequence[RatePoint], title: str) -> Figure:
    """Return two plots of PSNR over bits per texel."""
    figure = Figure(figsize=(12, 5.2), layout="constrained")
    figure.suptitle(title, fontsize=10)
    for axes, (key, label) in zip(figure.subplots(1, len(PLOTTED)), PLOTTED, strict=True):
        _draw_curves(axes, points, "bits_per_texel", key)
        axes.set_xlabel("bits per texel, all mips and tables")
        axes.set_ylabel(label)
    _add_legend(figure)
    return figure


def disk_figure(points: Sequence[RatePoint], title: str) -> Figure:
    """Return a plot of mean PSNR over the bits of whole files."""
    figure = Figure(figsize=(6.4, 5.2), layout="constrained")
    figure.suptitle(title, fontsize=10)
    axes = figure.subplots()
    _draw_curves(axes, [point for point in points if _is_file(point)], "file_bits_per_texel", "mean_db")
    axes.set_xlabel("bits per texel of mip 0, whole files with all mips")
    axes.set_ylabel(PLOTTED[0][1])
    _add_legend(figure)
    return figure


def _draw_curves(axes: Axes, points: Sequence[RatePoint], bits: str, key: str) -> None:
    for number, name in enumerate(dict.fromkeys(point.curve for point in points)):
        qualities = [point.quality for point in points if point.curve == name]
        line = sorted((getattr(quality, bits), getattr(quality, key)) for quality in qualities)
        style = "--" if name.startswith(DASHED) else "-"
        axes.plot(*zip(*line, strict=True), style, marker="o", markersize=3, color=f"C{number % 10}", label=name)
    axes.grid(alpha=0.3)


def _add_legend(figure: Figure) -> None:
    figure.legend(*figure.axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=4, fontsize=8)


def _is_file(point: RatePoint) -> bool:
    return point.quality.file_bits_per_texel is not None


def disk_rows(points: Sequence[RatePoint], decibels: Sequence[float]) -> list[dict[str, Cell]]:
    """Return a row for each PSNR of `decibels`: bits per texel of files at which each curve reaches it, None outside the curve."""
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
            # Bits grow about exponentially with dB, therefore their logarithm is interpolated.
            row[name] = float(2.0 ** np.interp(wanted, reached, np.log2(bits))) if inside else None
        rows.append(row)
    return rows
