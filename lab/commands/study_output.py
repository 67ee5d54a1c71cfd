"""What studies have in common: the trainings they run, and the files they write."""

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from lab.runner import Step, StudyOutput, do_steps
from lab.studies.runs import Run, RunResult, finished_run
from lab.studies.settings import StudySettings
from ntc.codec.textures import SourceTexture
from viewer.cli.table import Table
from viewer.scene.json_text import counted


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
) -> list[tuple[str, Step[RunResult]]]:
    """(name, step) of each run of a study whose files lie in `folder`."""

    def step(run: Run) -> Step[RunResult]:
        return lambda report: finished_run(run, textures, folder / "runs", report, pack_file(run))

    return [(f"{run.name}, {run.grouping.name}, seed {run.training.seed}", step(run)) for run in runs]


def describe(source: Path, textures: Sequence[SourceTexture], settings: StudySettings, what: str) -> str:
    """One line that describes the trainings."""
    side = max(max(texture.size) for texture in textures)
    length = (
        "350 epochs" if settings.scale == "paper" else f"{settings.steps} steps of {settings.texels_per_texture} texels"
    )
    mips = "mip 0 alone" if settings.levels == 1 else "all mips"
    seeds = counted(len(settings.seeds), "seed")
    return f"{source.stem}: {len(textures)} textures of at most {side} texels, {what}, {length}, {mips}, {seeds}"


def _all_runs(results: Sequence[RunResult]) -> dict[str, Any]:
    return {"runs": [{key: value for key, value in asdict(result).items() if key != "curve"} for result in results]}


def do_runs(steps: Sequence[tuple[str, Step[RunResult]]]) -> list[RunResult]:
    """Run all steps, with progress and ETA on standard error."""
    return do_steps(steps, lambda result: f"{result.seconds:.0f} s")


def write_pages(
    output: StudyOutput,
    title: str,
    settings: StudySettings,
    pages: Sequence[StudyPage],
    results: Sequence[RunResult],
) -> None:
    """Write the files of every page. Records hold the settings, that of the first page also every run."""
    for page in pages:
        runs = _all_runs(results) if page is pages[0] else {}
        output.write(page.name, title, page.table, page.figure, {"settings": asdict(settings), **runs})
    output.end()
