"""Does freezing the decoder help, and when (the paper's Figs. on freezing)."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from matplotlib.figure import Figure

from lab.studies.quality_table import by_key
from lab.studies.runs import Run, RunResult
from lab.studies.settings import StudySettings
from ntc.codec.grid.training.config import FreezingConfig
from ntc.codec.model import Grouping

STARTS = (0.25, 0.5, 0.75)
GRADUAL = 0.1
"""Length of gradual freezing (the paper's T), as a share of the training."""


def _schedules() -> dict[str, FreezingConfig | None]:
    found: dict[str, FreezingConfig | None] = {"none": None}
    for start in STARTS:
        found[f"gradual from {start:.0%}"] = FreezingConfig(start, GRADUAL)
        found[f"abrupt at {start:.0%}"] = FreezingConfig(start, 0.0)
    return found


def freezing_runs(grouping: Grouping, output_channels: int, settings: StudySettings) -> tuple[Run, ...]:
    """Every way of freezing under the paper's recipe, and under `best` (which trains decoders on rounded latents at last,
    unless they are frozen)."""
    runs = []
    for seed in settings.seeds:
        for recipe in ("paper", "best"):
            codec = settings.codec(recipe, output_channels)
            training = settings.training(recipe, seed)
            for name, freezing in _schedules().items():
                rounded = training.rounded_share if freezing is None else 0.0
                changed = replace(training, freezing=freezing, rounded_share=rounded)
                runs.append(Run(f"{recipe}, {name}", grouping, codec, changed))
    return tuple(runs)


def freezing_figure(results: Sequence[RunResult], title: str) -> Figure:
    """Running PSNR of the samples over the training, a line for each way of freezing."""
    figure = Figure(figsize=(11, 4.5), layout="constrained")
    figure.suptitle(title, fontsize=10)
    found = by_key(results)
    for axes, recipe in zip(figure.subplots(1, 2), ("paper", "best"), strict=True):
        for key, same in found.items():
            if not key[0].startswith(f"{recipe}, ") or not same[0].curve:
                continue
            steps, decibels = np.asarray(same[0].curve, np.float64).T
            name = key[0].removeprefix(f"{recipe}, ")
            axes.plot(steps, decibels, label=name, linestyle="--" if name.startswith("abrupt") else "-", linewidth=1.2)
        axes.set_title(f"recipe {recipe}")
        axes.set_xlabel("step")
        axes.set_ylabel("PSNR of the samples, dB")
        axes.grid(alpha=0.3)
        axes.legend(fontsize=8)
    return figure
