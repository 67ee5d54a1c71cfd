"""What each part of the recipe `best` is worth: it is changed, all else and the number of samples being equal."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from lab.studies.quality_table import COLUMNS, by_key, quality_row, textures_db
from lab.studies.runs import Run, RunResult
from lab.studies.settings import StudySettings
from ntc.codec.grid.model import GridConfig
from ntc.codec.grid.training.config import FreezingConfig, TrainingConfig, in_the_manner_of, recipe_codec
from ntc.codec.model import Grouping
from viewer.cli.table import Cell, Column, Table

BEST = "best"
PAPER = "paper"
Change = Callable[[GridConfig, TrainingConfig], tuple[GridConfig, TrainingConfig]]


def _codec(**changes: object) -> Change:
    return lambda codec, training: (replace(codec, **changes), training)  # type: ignore[arg-type]


def _training(**changes: object) -> Change:
    return lambda codec, training: (codec, replace(training, **changes))  # type: ignore[arg-type]


CHANGES: Mapping[str, Change] = {
    BEST: lambda codec, training: (codec, training),
    "without adapters": _codec(adapters=False, adapter_output=False),
    "adapters without output layer": _codec(adapter_output=False),
    "decoders in single precision": _codec(weight_bits=32),
    "4 channels of 8 bits": _codec(latent_channels=4, latent_bits=8),
    "latents not clipped": _training(latent_clip=None),
    "latents start at chance": _training(latent_start="chance"),
    "hidden layers by Adam": _training(hidden_optimizer="adam"),
    "cosine schedule": _training(schedule="cosine"),
    "constant rates": _training(schedule="constant"),
    "rounded only at the end": _training(rounded_share=0.0),
    "with the paper's freezing": _training(freezing=FreezingConfig()),
    "with balanced losses": _training(balance=0.5),
    PAPER: lambda codec, training: (
        recipe_codec("paper", codec.output_channels, codec.levels),
        in_the_manner_of("paper", training),
    ),
}
"""Changes of codec and training by the variant's name."""


def ablation_runs(grouping: Grouping, output_channels: int, settings: StudySettings) -> tuple[Run, ...]:
    """All variants with all seeds, seed by seed."""
    codec = settings.codec("best", output_channels)
    return tuple(
        Run(name, grouping, *change(codec, settings.training("best", seed)))
        for seed in settings.seeds
        for name, change in CHANGES.items()
    )


ADDED_COLUMNS = (
    Column("mean_gain_db", "mean against best dB"),
    Column("mse_gain_db", "of mean MSE against best dB"),
    Column("largest_loss_db", "most best loses on a texture dB"),
)


def ablation_table(results: Sequence[RunResult]) -> Table:
    """One row for each variant, means over the seeds."""
    found = {key[0]: (key, same) for key, same in by_key(results).items()}
    best_row, best = quality_row(*found[BEST]), textures_db(found[BEST][1])
    rows: list[Mapping[str, Cell]] = []
    for key, same in found.values():
        row = quality_row(key, same)
        own = textures_db(same)
        row["mean_gain_db"] = float(row["mean_db"] or 0.0) - float(best_row["mean_db"] or 0.0)
        row["mse_gain_db"] = float(row["of_mean_mse_db"] or 0.0) - float(best_row["of_mean_mse_db"] or 0.0)
        row["largest_loss_db"] = max(0.0, float(np.nanmax(own - best)))
        rows.append(row)
    hidden = ("grouping", "groups", "ssim", "flip")
    return Table([*(column for column in COLUMNS if column.key not in hidden), *ADDED_COLUMNS], rows)
