"""How wide the decoder must be, shared and not (the paper's Fig. on MLP size; the depth is fixed here)."""

from collections.abc import Sequence
from dataclasses import replace

from matplotlib.figure import Figure

from lab.studies.quality_table import by_key, quality_row
from lab.studies.runs import Run, RunResult
from lab.studies.settings import StudySettings
from ntc.codec.model import Grouping

WIDTHS = (16, 32, 64, 128)


def mlp_size_runs(groupings: Sequence[Grouping], output_channels: int, settings: StudySettings) -> tuple[Run, ...]:
    """Every width under both recipes, for every grouping."""
    runs = []
    for seed in settings.seeds:
        for recipe in ("paper", "best"):
            codec = settings.codec(recipe, output_channels)
            training = settings.training(recipe, seed)
            for width in WIDTHS:
                wide = replace(codec, hidden_width=width)
                runs += [Run(f"{recipe}, {width} wide", grouping, wide, training) for grouping in groupings]
    return tuple(runs)


def mlp_size_figure(results: Sequence[RunResult], title: str) -> Figure:
    """PSNR over the multiply-adds of a decode, a line for each recipe and grouping."""
    figure = Figure(figsize=(11, 4.5), layout="constrained")
    figure.suptitle(title, fontsize=10)
    lines: dict[str, list[tuple[float, float, float]]] = {}
    for key, same in by_key(results).items():
        row = quality_row(key, same)
        name = f"{key[0].partition(',')[0]}, {key[1]}"
        point = (float(same[0].multiply_adds), float(row["mean_db"] or 0.0), float(row["of_mean_mse_db"] or 0.0))
        lines.setdefault(name, []).append(point)
    for number, (axes, heading) in enumerate(
        zip(figure.subplots(1, 2), ("mean of dB", "dB of the mean MSE"), strict=True)
    ):
        for name, points in lines.items():
            axes.plot([p[0] for p in points], [p[1 + number] for p in points], marker="o", label=name)
        axes.set_xscale("log", base=2)
        axes.set_xlabel("multiply-adds of a decode")
        axes.set_ylabel(f"{heading}")
        axes.grid(alpha=0.3)
        axes.legend(fontsize=8)
    return figure
