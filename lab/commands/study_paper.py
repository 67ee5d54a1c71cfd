"""`ntc-viewer study paper-textures` and `paper-scenes`: the paper's Tables 2, 3 and 4 again."""

import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from lab.commands.options import PaperScenesOptions, PaperStudyOptions
from lab.commands.rendered_packs import RenderedPack, rendered_figure, rendered_table
from lab.commands.study_output import StudyPage, describe, do_runs, training_steps, write_pages
from lab.runner import Report, Step, StudyOutput
from lab.studies.paper_tables import BEST, PAPER, gap_table, paper_runs
from lab.studies.quality_table import quality_figure, quality_table
from lab.studies.runs import Run, RunResult, block_compressed
from ntc.codec.config import GroupingConfig, GroupingName
from ntc.codec.model import Grouping
from ntc.codec.textures import SourceTexture
from ntc.errors import InputError
from ntc.features import FeatureOptions
from ntc.grouping import GroupingInputs, make_grouping
from viewer.cli.encode import Source, read_source
from viewer.locations import features_cache
from viewer.scene.scene_files import PACK_SUFFIX

TEXTURE_GROUPINGS: tuple[GroupingName, ...] = ("baseline", "clustered", "random", "category", "single")
SCENE_GROUPINGS: tuple[GroupingName, ...] = ("baseline", "clustered", "random", "covisible", "single")


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
    inputs = GroupingInputs(features=FeatureOptions(cache=features_cache()))
    groupings = _groupings(options.groupings or TEXTURE_GROUPINGS, options.clusters, textures, inputs)
    runs = paper_runs(groupings, _channels(textures), settings)
    steps = [*training_steps(runs, textures, options.out), *(_blocks(textures, options.out) if options.blocks else [])]
    results = do_runs(steps)
    title = describe(options.source, textures, settings, _decoders(groupings))
    write_pages(output, title, settings, _pages("paper-textures", results, title), results)
    return 0


def _decoders(groupings: Sequence[Grouping]) -> str:
    counts = sorted({grouping.group_count for grouping in groupings if grouping.name in ("clustered", "random")})
    return f"{' and '.join(str(count) for count in counts) or 'other'} clusters"


def _pages(name: str, results: Sequence[RunResult], title: str) -> list[StudyPage]:
    table, gaps = quality_table(results), gap_table(results)
    return [
        StudyPage(name, table, quality_figure(table, title)),
        StudyPage(f"{name}-gaps", gaps, quality_figure(gaps, title)),
    ]


def _covisible_inputs(source: Source, options: PaperScenesOptions) -> GroupingInputs:
    from viewer.viewpoints.scene_views import ViewSource, scene_views

    if source.scene is None:
        raise InputError(f"{options.source}: is no scene; use study paper-textures for a folder of images")
    views = scene_views(source.scene, ViewSource(options.views, options.sampled_views, 0))
    if views.note:
        sys.stderr.write(f"note: {views.note}\n")
    return GroupingInputs(views.all_then_release(), {}, FeatureOptions(cache=features_cache()))


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

    steps = training_steps(runs, textures, options.out, pack_file)
    results = do_runs([*steps, *(_blocks(textures, options.out) if options.blocks else [])])
    title = describe(options.source, textures, settings, _decoders(groupings))
    pages = _pages("paper-scenes", results, title)
    packs = [
        RenderedPack(name, grouping.name, options.out / "packs" / f"{name}.{grouping.name}{PACK_SUFFIX}")
        for name in (PAPER, BEST)
        for grouping in groupings
    ]
    if source.scene is not None:
        table = rendered_table(source.scene, options.views, packs, options.size)
        pages.append(StudyPage("paper-scenes-rendered", table, rendered_figure(table, title)))
    write_pages(output, title, settings, pages, results)
    return 0
