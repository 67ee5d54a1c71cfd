"""Runs and tables that reproduce the paper's Tables 2 to 4: groupings under the paper's recipe and under `best`."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from lab.studies.quality_table import by_key, quality_row, textures_db
from lab.studies.runs import Run, RunResult
from lab.studies.settings import StudySettings
from ntc.codec.model import Grouping
from viewer.scene.text_table import Cell, Column, Table

PAPER, EIGHT_BITS, BEST = "paper", "best, 4 channels of 8 bits", "best"
VARIANTS = (PAPER, EIGHT_BITS, BEST)
"""Variants of the codec. EIGHT_BITS has the paper's grid; BEST has as many bits in 8 channels of 4."""


def paper_runs(
    groupings: Sequence[Grouping],
    output_channels: int,
    settings: StudySettings,
    variants: Sequence[str] = VARIANTS,
) -> tuple[Run, ...]:
    """Return the runs of every variant, grouping and seed; the first seed also measures SSIM and FLIP."""
    runs = []
    for seed in settings.seeds:
        for variant in variants:
            recipe = "paper" if variant == PAPER else "best"
            codec = settings.codec(recipe, output_channels)  # type: ignore[arg-type]
            if variant == EIGHT_BITS:
                codec = replace(codec, latent_channels=4, latent_bits=8)
            training = settings.training(recipe, seed)  # type: ignore[arg-type]
            first = seed == settings.seeds[0]
            runs += [Run(variant, grouping, codec, training, pictures=first) for grouping in groupings]
    return tuple(runs)


GAP_COLUMNS = (
    Column("variant", "variant"),
    Column("grouping", "grouping"),
    Column("groups", "decoders"),
    Column("mean_db", "mean dB"),
    Column("of_mean_mse_db", "dB of mean MSE"),
    Column("bits_per_texel", "bits/texel", 3),
    Column("to_own_baseline_db", "mean, to its baseline"),
    Column("mse_to_own_baseline_db", "of mean MSE, to its baseline"),
    Column("to_paper_db", "mean, to the paper's recipe"),
    Column("mse_to_paper_db", "of mean MSE, to the paper's recipe"),
    Column("largest_loss_db", "most a texture loses to the paper's recipe"),
    Column("to_paper_baseline_db", "mean, to the paper's baseline"),
)


def gap_table(results: Sequence[RunResult]) -> Table:
    """Return a table of the loss by sharing and of the gain by the recipe, in dB."""
    results_of = by_key(results)
    rows = {key: quality_row(key, same) for key, same in results_of.items() if key[1] != "-"}
    baselines = {key[0]: row for key, row in rows.items() if key[1] == "baseline"}
    table: list[Mapping[str, Cell]] = []
    for key, row in rows.items():
        baseline, paper = baselines.get(key[0]), rows.get((PAPER, *key[1:]))
        entry = {name: row[name] for name in ("variant", "grouping", "groups", "mean_db", "of_mean_mse_db")}
        entry["bits_per_texel"] = row["bits_per_texel"]
        entry["to_own_baseline_db"] = _difference(row, baseline, "mean_db")
        entry["mse_to_own_baseline_db"] = _difference(row, baseline, "of_mean_mse_db")
        entry["to_paper_baseline_db"] = _difference(row, baselines.get(PAPER), "mean_db")
        if key[0] != PAPER:
            entry["to_paper_db"] = _difference(row, paper, "mean_db")
            entry["mse_to_paper_db"] = _difference(row, paper, "of_mean_mse_db")
        if key[0] != PAPER and paper is not None:
            losses = textures_db(results_of[(PAPER, *key[1:])]) - textures_db(results_of[key])
            entry["largest_loss_db"] = max(0.0, float(np.nanmax(losses)))
        table.append(entry)
    return Table(GAP_COLUMNS, table)


def _difference(row: Mapping[str, Cell], other: Mapping[str, Cell] | None, key: str) -> float | None:
    if other is None or row.get(key) is None or other.get(key) is None:
        return None
    return float(row[key] or 0.0) - float(other[key] or 0.0)
