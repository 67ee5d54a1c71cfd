"""Studies of the paper's Tables 2, 3 and 4 (`ntc-viewer study paper-textures`, `paper-scenes`)."""

import sys
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

from matplotlib.figure import Figure

from lab.commands.options import PaperScenesOptions, PaperStudyOptions
from lab.commands.rendered_packs import RenderedPack, rendered_figure, rendered_table
from lab.runner import Report, Step, StudyOutput, do_steps
from lab.studies.paper_tables import BEST, PAPER, gap_table, paper_runs
from lab.studies.quality_table import quality_figure, quality_table
from lab.studies.runs import Run, RunResult, block_compressed, finished_run
from lab.studies.settings import StudySettings
from ntc.codec.config import GroupingConfig, GroupingName
from ntc.codec.model import Grouping
from ntc.codec.textures import SourceTexture
from ntc.errors import InputError
from ntc.features import FeatureOptions
from ntc.grouping import GroupingInputs, make_grouping
from viewer.cli.encode import Source, read_source
from viewer.locations import cache_folder
from viewer.scene.json_text import counted
from viewer.scene.scene_files import PACK_SUFFIX
from viewer.scene.text_table import Table

TEXTURE_GROUPINGS: tuple[GroupingName, ...] = ("baseline", "clustered", "random", "category", "single")
SCENE_GROUPINGS: tuple[GroupingName, ...] = ("baseline", "clustered", "random", "covisible", "single")


@dataclass(frozen=True)
class _Page:
    """Page of a study: a table and its plot."""

    name: str
    """Name of the page's files."""
    table: Table
    figure: Figure


def _training_steps(
    runs: Sequence[Run],
    textures: Sequence[SourceTexture],
    folder: Path,
    pack_file: Callable[[Run], Path | None] = lambda _run: None,
) -> list[tuple[str, Step[RunResult]]]:
    """Return (name, step) of each run of a study whose files lie in `folder`."""

    def step(run: Run) -> Step[RunResult]:
        return lambda report: finished_run(run, textures, folder / "runs", report, pack_file(run))

    return [(f"{run.name}, {run.grouping.name}, seed {run.training.seed}", step(run)) for run in runs]


def _title(source: Path, textures: Sequence[SourceTexture], settings: StudySettings, what: str) -> str:
    """Return a line that describes the trainings."""
    side = max(max(texture.size) for texture in textures)
    length = (
        "350 epochs" if settings.scale == "paper" else f"{settings.steps} steps of {settings.texels_per_texture} texels"
    )
    mips = "mip 0 alone" if settings.levels == 1 else "all mips"
    seeds = counted(len(settings.seeds), "seed")
    return f"{source.stem}: {len(textures)} textures of at most {side} texels, {what}, {length}, {mips}, {seeds}"


def _write_pages(
    output: StudyOutput,
    title: str,
    settings: StudySettings,
    pages: Sequence[_Page],
    results: Sequence[RunResult],
) -> None:
    """Write the files of every page. All records have the settings; that of the first page also has every run."""
    for page in pages:
        runs = {"runs": [asdict(result) for result in results]} if page is pages[0] else {}
        output.write(page.name, title, page.table, page.figure, {"settings": asdict(settings), **runs})
    output.end()


def _seconds(result: RunResult) -> str:
    return f"{result.seconds:.0f} s"


def _groupings(
    names: Sequence[GroupingName], clusters: int | None, textures: Sequence[SourceTexture], inputs: GroupingInputs
) -> list[Grouping]:
    return [make_grouping(GroupingConfig(name, clusters), textures, inputs) for name in names]


def _blocks(textures: Sequence[SourceTexture], folder: Path) -> list[tuple[str, Step[RunResult]]]:
    def bc1(report: Report) -> RunResult:
        return block_compressed("bc1", textures, folder / "runs", report)

    def bc7(report: Report) -> RunResult:
        return block_compressed("bc7", textures, folder / "runs", report)

    return [("BC1", bc1), ("BC7", bc7)]


def _channels(textures: Sequence[SourceTexture]) -> int:
    return max(int(texture.pixels.shape[2]) for texture in textures)


def study_paper_textures(options: PaperStudyOptions) -> int:
    """Run `ntc-viewer study paper-textures`. Raises InputError for bad input."""
    settings = options.settings()
    output = StudyOutput(options.out)
    textures = read_source(options.source, options.side()).textures
    inputs = GroupingInputs(features=FeatureOptions(cache=cache_folder("features")))
    groupings = _groupings(options.groupings or TEXTURE_GROUPINGS, options.clusters, textures, inputs)
    runs = paper_runs(groupings, _channels(textures), settings)
    steps = [*_training_steps(runs, textures, options.out), *(_blocks(textures, options.out) if options.blocks else [])]
    results = do_steps(steps, _seconds)
    title = _title(options.source, textures, settings, _decoders(groupings))
    _write_pages(output, title, settings, _pages("paper-textures", results, title), results)
    return 0


def _decoders(groupings: Sequence[Grouping]) -> str:
    counts = sorted({grouping.group_count for grouping in groupings if grouping.name in ("clustered", "random")})
    return f"{' and '.join(str(count) for count in counts) or 'other'} clusters"


def _pages(name: str, results: Sequence[RunResult], title: str) -> list[_Page]:
    table, gaps = quality_table(results), gap_table(results)
    return [
        _Page(name, table, quality_figure(table, title)),
        _Page(f"{name}-gaps", gaps, quality_figure(gaps, title)),
    ]


def _covisible_inputs(source: Source, options: PaperScenesOptions) -> GroupingInputs:
    from viewer.viewpoints.scene_views import ViewSource, scene_views

    if source.scene is None:
        raise InputError(f"{options.source}: is not a scene; use study paper-textures for a folder of images")
    views = scene_views(source.scene, ViewSource(options.views, options.sampled_views, 0))
    if views.note:
        sys.stderr.write(f"note: {views.note}\n")
    return GroupingInputs(
        views.all_then_release(len(source.textures)), {}, FeatureOptions(cache=cache_folder("features"))
    )


def study_paper_scenes(options: PaperScenesOptions) -> int:
    """Run `ntc-viewer study paper-scenes`. Raises InputError for bad input."""
    settings = options.settings()
    output = StudyOutput(options.out)
    source = read_source(options.source, options.side())
    textures = source.textures
    inputs = _covisible_inputs(source, options)
    groupings = _groupings(options.groupings or SCENE_GROUPINGS, options.clusters, textures, inputs)
    runs = paper_runs(groupings, _channels(textures), settings)
    first = replace(settings, seeds=settings.seeds[:1])
    for clusters in options.more_clusters:
        more = _groupings(("clustered", "covisible"), clusters, textures, inputs)
        runs += paper_runs(more, _channels(textures), first, (BEST,))

    def pack_file(run: Run) -> Path | None:
        if run.training.seed != settings.seeds[0] or run.name not in (PAPER, BEST):
            return None
        if run.grouping not in groupings:
            return None
        return options.out / "packs" / f"{run.name}.{run.grouping.name}{PACK_SUFFIX}"

    steps = _training_steps(runs, textures, options.out, pack_file)
    steps += _blocks(textures, options.out) if options.blocks else []
    results = do_steps(steps, _seconds)
    title = _title(options.source, textures, settings, _decoders(groupings))
    pages = _pages("paper-scenes", results, title)
    packs = [
        RenderedPack(name, grouping.name, options.out / "packs" / f"{name}.{grouping.name}{PACK_SUFFIX}")
        for name in (PAPER, BEST)
        for grouping in groupings
    ]
    if source.scene is not None:
        table = rendered_table(source.scene, options.views, packs, options.size)
        pages.append(_Page("paper-scenes-rendered", table, rendered_figure(table, title)))
    _write_pages(output, title, settings, pages, results)
    return 0
