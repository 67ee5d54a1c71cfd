"""Table of quality, size and speed of trainings, as means over seeds."""

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from lab.studies.runs import RunResult
from ntc.codec.quality import PsnrSummary
from viewer.scene.text_table import Cell, Column, Table

Key = tuple[str, str, int]
"""Key of a row: (variant, grouping, number of groups)."""

COLUMNS = (
    Column("variant", "variant"),
    Column("grouping", "grouping"),
    Column("groups", "decoders"),
    Column("mean_db", "mean dB"),
    Column("of_mean_mse_db", "dB of mean MSE"),
    Column("median_db", "median dB"),
    Column("worst_share_db", "worst 5 % dB"),
    Column("minimum_db", "worst dB"),
    Column("deviation_db", "deviation over seeds dB", 3),
    Column("ssim", "SSIM", 4),
    Column("flip", "FLIP", 4),
    Column("bits_per_texel", "bits/texel", 3),
    Column("multiply_adds", "multiply-adds"),
    Column("texels_per_second", "Ktexel/s", 0),
    Column("seconds", "s", 0),
    Column("seeds", "seeds"),
)


def textures_db(results: Sequence[RunResult]) -> NDArray[np.float64]:
    """Return [textures] PSNR in dB, means over the seeds; NaN where a texture is exact."""
    rows = [[np.nan if value is None else value for value in result.psnr_db] for result in results]
    return np.asarray(np.mean(rows, axis=0), np.float64)


def by_key(results: Sequence[RunResult]) -> dict[Key, list[RunResult]]:
    """Return results grouped by variant and grouping, in order of appearance."""
    groups: dict[Key, list[RunResult]] = {}
    for result in results:
        groups.setdefault((result.name, result.grouping, result.groups), []).append(result)
    return groups


def _mean(values: Sequence[float]) -> float | None:
    return float(np.mean(values)) if len(values) else None


def quality_row(key: Key, results: Sequence[RunResult]) -> dict[str, Cell]:
    """Return the row of the results of one key."""
    known = [[value for value in result.psnr_db if value is not None] for result in results]
    summaries = [summary for values in known if (summary := PsnrSummary.of(values)) is not None]
    speeds = [result.texels / max(result.seconds, 1e-3) / 1e3 for result in results if result.texels]
    means = [summary.mean_db for summary in summaries]
    return {
        "variant": key[0],
        "grouping": key[1],
        "groups": key[2],
        "mean_db": _mean(means),
        "of_mean_mse_db": _mean([summary.of_mean_mse_db for summary in summaries]),
        "median_db": _mean([summary.median_db for summary in summaries]),
        "worst_share_db": _mean([summary.worst_share_db for summary in summaries]),
        "minimum_db": _mean([summary.minimum_db for summary in summaries]),
        "deviation_db": float(np.std(means, ddof=1)) if len(means) > 1 else None,
        "ssim": _mean([float(np.mean(result.ssim)) for result in results if result.ssim]),
        "flip": _mean([float(np.mean(result.flip)) for result in results if result.flip]),
        "bits_per_texel": _mean([result.bits_per_texel for result in results]),
        "multiply_adds": results[0].multiply_adds,
        "texels_per_second": _mean(speeds),
        "seconds": _mean([result.seconds for result in results]),
        "seeds": len(results),
    }


def quality_table(results: Sequence[RunResult]) -> Table:
    """Return the table, with a row for each variant and grouping."""
    rows: list[Mapping[str, Cell]] = [quality_row(key, same) for key, same in by_key(results).items()]
    used = [c for c in COLUMNS if any(row.get(c.key) is not None for row in rows)]
    return Table(used, rows)


def quality_figure(table: Table, title: str) -> Figure:
    """Return a plot of the mean of dB and the dB of the mean MSE, with a pair of bars for each row."""
    figure = Figure(figsize=(10, 0.5 * len(table.rows) + 1.6), layout="constrained")
    figure.suptitle(title, fontsize=10)
    axes = figure.subplots()
    places = np.arange(len(table.rows))
    for shift, key, label in ((-0.2, "mean_db", "mean of dB"), (0.2, "of_mean_mse_db", "dB of the mean MSE")):
        values = [float(row.get(key) or 0.0) for row in table.rows]
        bars = axes.barh(places + shift, values, 0.38, label=label)
        axes.bar_label(bars, [f"{value:.2f}" for value in values], padding=3, fontsize=8)
    axes.set_yticks(places, [_label(row) for row in table.rows])
    axes.invert_yaxis()
    axes.margins(y=0.01)
    lowest = min(float(row.get("of_mean_mse_db") or 0.0) for row in table.rows)
    axes.set_xlim(left=max(0.0, lowest - 3.0))
    axes.set_xlabel("PSNR, dB")
    figure.legend(loc="outside lower right", ncols=2)
    return figure


def _label(row: Mapping[str, Cell]) -> str:
    if row.get("grouping") in (None, "-"):
        return str(row["variant"])
    return f"{row['variant']}, {row['grouping']} ({row['groups']})"
