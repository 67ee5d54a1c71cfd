"""Cost of one decoder for all mips: each level against a codec that is trained on that level alone."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from lab.studies.runs import Run, RunResult
from lab.studies.settings import StudySettings
from ntc.codec.latents import latent_levels
from ntc.codec.model import Grouping
from ntc.codec.quality import PsnrSummary
from ntc.codec.textures import SourceTexture
from viewer.cli.table import Cell, Column, Table

ALL = "all levels"
COLUMNS = (
    Column("level", "level"),
    Column("side", "texels a side"),
    Column("all_db", "all levels together, mean dB"),
    Column("alone_db", "this level alone, mean dB"),
    Column("difference_db", "difference dB"),
    Column("all_mse_db", "together, dB of mean MSE"),
    Column("alone_mse_db", "alone, dB of mean MSE"),
    Column("difference_mse_db", "difference dB"),
)


def mip_runs(
    textures: Sequence[SourceTexture], grouping: Grouping, output_channels: int, settings: StudySettings
) -> tuple[Run, ...]:
    """One training of all levels, and one of each level alone, with as many steps."""
    codec = replace(settings.codec("best", output_channels), levels=None)
    deepest = max(len(latent_levels(*texture.size, codec)) for texture in textures)
    runs = []
    for seed in settings.seeds:
        training = settings.training("best", seed)
        runs.append(Run(ALL, grouping, codec, training, every_level=True))
        alone = replace(codec, levels=1)
        runs += [Run(f"level {level}", grouping, alone, training, level=level) for level in range(deepest)]
    return tuple(runs)


def _decibels(results: Sequence[RunResult], level: int | None) -> NDArray[np.float64]:
    """[textures], means over seeds; NaN where a texture is exact or lacks the level."""
    rows = []
    for result in results:
        if level is None:
            row = list(result.psnr_db)
        else:
            row = [levels[level] if level < len(levels) else None for levels in result.level_psnr_db]
        rows.append([np.nan if value is None else value for value in row])
    return np.asarray(np.mean(rows, axis=0), np.float64)


def mip_table(results: Sequence[RunResult], side: int) -> Table:
    """A row for each level, of textures `side` texels large, over the textures that have it."""
    together = [result for result in results if result.name == ALL]
    rows: list[Mapping[str, Cell]] = []
    for level in range(max(len(levels) for levels in together[0].level_psnr_db)):
        ours = _decibels(together, level)
        alone = _decibels([result for result in results if result.name == f"level {level}"], None)
        both = np.isfinite(ours) & np.isfinite(alone)
        first, second = (PsnrSummary.of(list(values[both])) for values in (ours, alone))
        if first is None or second is None:
            continue
        rows.append(
            {
                "level": level,
                "side": max(1, side >> level),
                "all_db": first.mean_db,
                "alone_db": second.mean_db,
                "difference_db": first.mean_db - second.mean_db,
                "all_mse_db": first.of_mean_mse_db,
                "alone_mse_db": second.of_mean_mse_db,
                "difference_mse_db": first.of_mean_mse_db - second.of_mean_mse_db,
            }
        )
    return Table(COLUMNS, rows)


def mip_figure(table: Table, title: str) -> Figure:
    """Both PSNRs over the level."""
    figure = Figure(figsize=(8, 4), layout="constrained")
    figure.suptitle(title, fontsize=10)
    axes = figure.subplots()
    levels = [int(row["level"] or 0) for row in table.rows]
    for key, label in (("all_db", "all levels together"), ("alone_db", "this level alone")):
        axes.plot(levels, [float(row[key] or 0.0) for row in table.rows], marker="o", label=label)
    axes.set_xticks(levels)
    axes.set_xlabel("level")
    axes.set_ylabel("mean PSNR, dB")
    axes.grid(alpha=0.3)
    axes.legend()
    return figure
