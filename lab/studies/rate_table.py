"""Rate and distortion of several codecs: the table of their points, and the plot of their curves."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass

from matplotlib.figure import Figure

from lab.studies.set_quality import SetQuality
from viewer.cli.table import Cell, Column, Table

COLUMNS = (
    Column("curve", "codec"),
    Column("setting", "setting"),
    Column("bits_per_texel", "bits/texel", 3),
    Column("mean_db", "mean dB"),
    Column("of_mean_mse_db", "dB of mean MSE"),
    Column("worst_db", "worst dB"),
    Column("ssim", "SSIM", 4),
    Column("flip", "FLIP", 4),
    Column("seconds", "s", 1),
)
PLOTTED = (("mean_db", "PSNR, mean of textures, dB"), ("of_mean_mse_db", "PSNR of the mean MSE, dB"))
DASHED = ("BC", "ASTC", "JPEG", "AVIF")
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
