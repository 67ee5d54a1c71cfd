"""What studies have in common: the trainings they run, and the files they write."""

import json
import platform
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import torch
from matplotlib.figure import Figure
from rich.console import Console
from rich.progress import Progress, TimeRemainingColumn

from lab.bench.record import write_figure
from lab.studies.runs import Report, Run, RunResult, finished_run
from lab.studies.settings import StudySettings
from ntc.codec.textures import SourceTexture
from ntc.errors import InputError
from ntc.io import write_text
from viewer.cli.table import Table

Step = Callable[[Report], RunResult]


def write_study(folder: Path, name: str, title: str, table: Table, figure: Figure, record: Mapping[str, Any]) -> None:
    """Write NAME.md, .csv, .png and .json into `folder`. Raises InputError where it cannot be written."""
    write_text(folder / f"{name}.md", f"# {title}\n\n{table.markdown()}")
    write_text(folder / f"{name}.csv", table.csv())
    write_figure(folder / f"{name}.png", figure)
    write_text(folder / f"{name}.json", json.dumps(record, indent=1, allow_nan=False) + "\n")


def check_output(folder: Path) -> None:
    """Raises InputError where `folder` is a file."""
    if folder.exists() and not folder.is_dir():
        raise InputError(f"--out {folder}: is a file; name a folder")


@dataclass(frozen=True)
class StudyPage:
    """A table of a study, with its picture."""

    name: str
    """Name of the page's files."""
    table: Table
    figure: Figure


def training_steps(
    runs: Sequence[Run],
    textures: Sequence[SourceTexture],
    folder: Path,
    pack_file: Callable[[Run], Path | None] = lambda _run: None,
) -> list[tuple[str, Step]]:
    """(name, step) of each run of a study whose files lie in `folder`."""

    def step(run: Run) -> Step:
        return lambda report: finished_run(run, textures, folder / "runs", report, pack_file(run))

    return [(f"{run.name}, {run.grouping.name}, seed {run.training.seed}", step(run)) for run in runs]


def do_steps(steps: Sequence[tuple[str, Step]]) -> list[RunResult]:
    """Run all steps, with progress and ETA on standard error."""
    results = []
    console = Console(stderr=True, soft_wrap=True)
    with Progress(*Progress.get_default_columns()[:-1], TimeRemainingColumn(), console=console, transient=True) as bar:
        whole = bar.add_task("", total=len(steps))
        for number, (name, step) in enumerate(steps):
            bar.update(whole, description=name)

            def report(done: int, of: int, before: int = number) -> None:
                bar.update(whole, completed=before + done / max(1, of))

            result = step(report)
            results.append(result)
            console.print(f"{number + 1}/{len(steps)} {name}: {result.seconds:.0f} s", highlight=False)
    return results


def describe(source: Path, textures: Sequence[SourceTexture], settings: StudySettings, what: str) -> str:
    """One line that describes the trainings."""
    side = max(max(texture.size) for texture in textures)
    length = (
        "350 epochs" if settings.scale == "paper" else f"{settings.steps} steps of {settings.texels_per_texture} texels"
    )
    mips = "mip 0 alone" if settings.levels == 1 else "all mips"
    seeds = f"{len(settings.seeds)} seed{'s' if len(settings.seeds) > 1 else ''}"
    return f"{source.stem}: {len(textures)} textures of at most {side} texels, {what}, {length}, {mips}, {seeds}"


def machine() -> dict[str, Any]:
    """The machine that the figures were measured on."""
    device = torch.cuda.get_device_name() if torch.cuda.is_available() else None
    return {
        "processor": platform.machine(),
        "threads": torch.get_num_threads(),
        "cuda": device,
        "torch": torch.__version__,
        "python": platform.python_version(),
    }


def _all_runs(results: Sequence[RunResult]) -> dict[str, Any]:
    return {"runs": [{key: value for key, value in asdict(result).items() if key != "curve"} for result in results]}


def write_pages(
    out: Path,
    title: str,
    settings: StudySettings,
    pages: Sequence[StudyPage],
    results: Sequence[RunResult],
    began: float,
    more: dict[str, Any] | None = None,
) -> None:
    """Write the files of every page. Records hold the settings, that of the first page also every run."""
    for page in pages:
        record = {
            "study": page.name,
            "what": title,
            "settings": asdict(settings),
            "machine": machine(),
            "seconds": time.monotonic() - began,
            "rows": [dict(row) for row in page.table.rows],
            **(_all_runs(results) if page is pages[0] else {}),
            **(more or {}),
        }
        write_study(out, page.name, title, page.table, page.figure, record)
        sys.stdout.write(f"{title}\n{page.table.text()}\n")
    sys.stdout.write(f"wrote {out}\n")
