"""What each part of the recipe `best` is worth: it is left out, all else and the number of samples being equal."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np
from matplotlib.figure import Figure

from ntc.config import CodecConfig
from ntc.metrics import PsnrSummary
from ntc.pack import Grouping
from ntc.studies.ablation_config import AblationConfig
from ntc.studies.runs import Run, RunResult
from ntc.studies.table import Cell, Column, Table
from ntc.training_config import FreezingConfig, TrainingConfig

BEST = "best"
PAPER = "paper"
Change = Callable[[CodecConfig, TrainingConfig], tuple[CodecConfig, TrainingConfig]]

PAPER_SETTINGS = {
    "latent_rate": 4e-3,
    "decoder_rate": 4e-4,
    "latent_start": "chance",
    "hidden_optimizer": "adam",
    "schedule": "constant",
    "freezing": FreezingConfig(),
    "rounded_share": 0.0,
}
"""Rates, start, optimiser and freezing of the paper; samples and steps are those of the study."""

CHANGES: Mapping[str, Change] = {
    BEST: lambda codec, training: (codec, training),
    "without adapters": lambda codec, training: (replace(codec, adapters=False), training),
    "latents start at chance": lambda codec, training: (codec, replace(training, latent_start="chance")),
    "hidden layers by Adam": lambda codec, training: (codec, replace(training, hidden_optimizer="adam")),
    "cosine schedule": lambda codec, training: (codec, replace(training, schedule="cosine")),
    "constant rates": lambda codec, training: (codec, replace(training, schedule="constant")),
    "rounded only at the end": lambda codec, training: (codec, replace(training, rounded_share=0.0)),
    "with the paper's freezing": lambda codec, training: (codec, replace(training, freezing=FreezingConfig())),
    PAPER: lambda codec, training: (
        replace(codec, adapters=False),
        replace(training, recipe="paper", **PAPER_SETTINGS),  # type: ignore[arg-type]
    ),
}
"""Each variant by its name."""


def ablation_runs(grouping: Grouping, output_channels: int, config: AblationConfig) -> tuple[Run, ...]:
    """All variants with all seeds, seed by seed."""
    codec = CodecConfig(levels=config.levels, output_channels=output_channels, adapters=True)
    runs = []
    for seed in config.seeds:
        training = TrainingConfig(
            steps=config.steps,
            texels_per_texture=config.texels_per_texture,
            seed=seed,
            device=config.device,  # type: ignore[arg-type]
        )
        runs += [Run(name, grouping, *change(codec, training)) for name, change in CHANGES.items()]
    return tuple(runs)


COLUMNS = (
    Column("variant", "variant"),
    Column("mean_db", "mean dB"),
    Column("of_mean_mse_db", "dB of mean MSE"),
    Column("minimum_db", "worst dB"),
    Column("mean_gain_db", "mean against best, dB"),
    Column("largest_loss_db", "most that best loses on a texture, dB"),
    Column("bits_per_texel", "bits/texel", 3),
    Column("texels_per_second", "Ktexel/s", 0),
    Column("seeds", "seeds"),
)


def ablation_table(results: Sequence[RunResult]) -> Table:
    """One row for each variant, means over the seeds."""
    by_name = {name: [result for result in results if result.name == name] for name in CHANGES}
    rows: list[Mapping[str, Cell]] = []
    best = _textures(by_name[BEST])
    for name, found in by_name.items():
        if not found:
            continue
        summaries = [PsnrSummary.of([value for value in result.psnr_db if value is not None]) for result in found]
        known = [summary for summary in summaries if summary is not None]
        own = _textures(found)
        rows.append(
            {
                "variant": name,
                "mean_db": float(np.mean([summary.mean_db for summary in known])),
                "of_mean_mse_db": float(np.mean([summary.of_mean_mse_db for summary in known])),
                "minimum_db": float(np.mean([summary.minimum_db for summary in known])),
                "mean_gain_db": float(np.nanmean(own - best)),
                "largest_loss_db": max(0.0, float(np.nanmax(own - best))),
                "bits_per_texel": float(np.mean([result.bits_per_texel for result in found])),
                "texels_per_second": float(np.mean([r.texels / max(r.seconds, 1e-3) / 1e3 for r in found])),
                "seeds": len(found),
            }
        )
    return Table(COLUMNS, rows)


def _textures(results: Sequence[RunResult]) -> np.ndarray:
    """[textures] dB, means over the seeds; NaN where a texture is exact."""
    return np.mean([[np.nan if v is None else v for v in result.psnr_db] for result in results], axis=0)


def ablation_figure(table: Table, title: str) -> Figure:
    """Mean of dB and dB of the mean MSE of each variant."""
    figure = Figure(figsize=(10, 0.5 * len(table.rows) + 1.5), layout="constrained")
    figure.suptitle(title)
    axes = figure.subplots()
    places = np.arange(len(table.rows))
    for shift, key, label in ((-0.2, "mean_db", "mean of dB"), (0.2, "of_mean_mse_db", "dB of the mean MSE")):
        values = [float(row[key] or 0.0) for row in table.rows]
        bars = axes.barh(places + shift, values, 0.38, label=label)
        axes.bar_label(bars, [f"{value:.2f}" for value in values], padding=3, fontsize=8)
    axes.set_yticks(places, [str(row["variant"]) for row in table.rows])
    axes.invert_yaxis()
    lowest = min(float(row["of_mean_mse_db"] or 0.0) for row in table.rows)
    axes.set_xlim(left=max(0.0, lowest - 3.0))
    axes.set_xlabel("PSNR, dB")
    axes.legend(loc="lower right")
    return figure
