"""Table of rendered packs: PSNR of pictures and divergence over the cameras of a scene, by pack."""

import math
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from ntc.metrics.divergence import DivergenceStatistics
from ntc.pack.file import read_pack
from viewer.gl.context import create_headless_context
from viewer.inspect.measurement import measure
from viewer.render.renderer import Renderer
from viewer.scene.model import Scene
from viewer.scene.text_table import Cell, Column, Table
from viewer.state.view_state import Slot, ViewState
from viewer.viewpoints.scene_views import ViewSource, cameras_of

COLUMNS = (
    Column("recipe", "recipe"),
    Column("grouping", "grouping"),
    Column("decoders", "decoders"),
    Column("rendered_db", "rendered mean dB"),
    Column("worst_db", "worst view dB"),
    Column("excess", "excess, all views"),
    Column("cut_percent", "cut of baseline's excess %", 1),
    Column("score", "divergence score", 3),
    Column("views", "views"),
)


@dataclass(frozen=True)
class RenderedPack:
    """Pack to render."""

    recipe: str
    grouping: str
    file: Path


def rendered_table(scene: Scene, views: Path | None, packs: Sequence[RenderedPack], size: tuple[int, int]) -> Table:
    """Return a row for each pack over all cameras of the scene, or of the file `views`, at `size` pixels; path deferred, fp32.

    PSNR compares 8-bit sRGB of the covered pixels with the picture of the original images. Raises InputError.
    """
    cameras = cameras_of(scene, ViewSource(views))
    if not cameras:
        sys.stderr.write(f"note: {scene.name} has no cameras; name some with --views for rendered figures\n")
        return Table(COLUMNS, ())
    renderer = Renderer(create_headless_context(), scene)
    rows: list[Mapping[str, Cell]] = []
    baselines: dict[str, int] = {}
    for shown in packs:
        pack = read_pack(shown.file)
        renderer.set_packs({shown.grouping: pack})
        decibels: list[float] = []
        statistics: list[DivergenceStatistics] = []
        for camera in cameras:
            slot = Slot(shown.grouping)
            renderer.render(ViewState(camera, size, slot_a=slot), whole=True)
            (picture,) = measure(renderer, [slot], {shown.grouping: pack})
            decibel = picture.psnr_db(picture.covered)
            if decibel is not None:
                decibels.append(decibel)
            statistics.append(picture.divergence_statistics)
        excess = sum(entry.excess for entry in statistics)
        if shown.grouping == "baseline":
            baselines[shown.recipe] = excess
        known = baselines.get(shown.recipe)
        finite = [value for value in decibels if math.isfinite(value)]
        rows.append(
            {
                "recipe": shown.recipe,
                "grouping": shown.grouping,
                "decoders": len(pack.decoders),
                "rendered_db": float(np.mean(finite)) if finite else None,
                "worst_db": min(finite, default=None),
                "excess": excess,
                "cut_percent": 100.0 * (1.0 - excess / known) if known else None,
                "score": float(np.mean([entry.score for entry in statistics])),
                "views": len(cameras),
            }
        )
    renderer.release()
    return Table(COLUMNS, rows)


def rendered_figure(table: Table, title: str) -> Figure:
    """Return a plot of rendered PSNR over divergence. Up and left is better."""
    figure = Figure(figsize=(8, 5), layout="constrained")
    figure.suptitle(title, fontsize=10)
    axes = figure.subplots()
    for row in table.rows:
        axes.scatter(float(row["score"] or 0.0), float(row["rendered_db"] or 0.0), color=_color(row))
        axes.annotate(
            f"{row['recipe']}, {row['grouping']}",
            (float(row["score"] or 0.0), float(row["rendered_db"] or 0.0)),
            textcoords="offset points",
            xytext=(5, 4),
            fontsize=8,
        )
    axes.set_xlabel("divergence score: mean excess of a block")
    axes.set_ylabel("rendered PSNR, mean of the views, dB")
    axes.grid(alpha=0.3)
    return figure


def _color(row: Mapping[str, Cell]) -> str:
    return "tab:blue" if row["recipe"] == "paper" else "tab:orange"
