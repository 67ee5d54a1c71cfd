"""`ntc-viewer study freezing|mlp-size|ablation`: contributions of the parts of recipe and codec."""

from functools import partial

from lab.commands.options import (
    AblationStudyOptions,
    FreezingStudyOptions,
    MlpSizeStudyOptions,
    RecipeStudyOptions,
)
from lab.commands.study_output import StudyPage, describe, do_runs, training_steps, write_pages
from lab.runner import StudyOutput
from lab.studies.ablation import BEST, ablation_runs, ablation_table
from lab.studies.block_ablation import block_variants, measured_variant
from lab.studies.freezing import freezing_figure, freezing_runs
from lab.studies.mlp_size import mlp_size_figure, mlp_size_runs
from lab.studies.quality_table import quality_figure, quality_table
from lab.studies.runs import Run, RunResult
from lab.studies.settings import StudySettings
from ntc.codec.config import GroupingConfig
from ntc.codec.model import Grouping
from ntc.codec.textures import SourceTexture
from ntc.features import FeatureOptions
from ntc.grouping import GroupingInputs, make_grouping
from viewer.cli.encode import read_source
from viewer.locations import features_cache


def _runs(
    options: RecipeStudyOptions,
    channels: int,
    clustered: Grouping,
    baseline: Grouping,
    settings: StudySettings,
) -> tuple[Run, ...]:
    match options:
        case AblationStudyOptions():
            return ablation_runs(clustered, channels, settings)
        case FreezingStudyOptions():
            return freezing_runs(clustered, channels, settings)
        case MlpSizeStudyOptions():
            return mlp_size_runs((baseline, clustered), channels, settings)


def _page(options: RecipeStudyOptions, results: list[RunResult], title: str) -> StudyPage:
    match options:
        case AblationStudyOptions():
            table = ablation_table(results)
            return StudyPage("ablation", table, quality_figure(table, title))
        case FreezingStudyOptions():
            return StudyPage("freezing", quality_table(results), freezing_figure(results, title))
        case MlpSizeStudyOptions():
            return StudyPage("mlp-size", quality_table(results), mlp_size_figure(results, title))


def _study_block(
    options: AblationStudyOptions, textures: tuple[SourceTexture, ...], grouping: Grouping, output: StudyOutput
) -> int:
    """The ablation of codec `block`."""
    variants = block_variants(textures, grouping, options.bits, options.levels, BEST)
    steps = [
        (name, partial(measured_variant, name, variant, textures, grouping, seed))
        for seed in options.seeds
        for name, variant in variants.items()
    ]
    results = do_runs(steps)
    table = ablation_table(results)
    mips = "mip 0 alone" if options.levels == 1 else "all mips"
    title = (
        f"{options.source.stem}: {len(textures)} textures of at most {options.side()} texels, {grouping.group_count} clusters, "
        f"codec block at {options.bits:g} bits a texel, {mips}"
    )
    page = StudyPage("ablation-block", table, quality_figure(table, title))
    write_pages(output, title, options.settings(), [page], results)
    return 0


def study_recipe(options: RecipeStudyOptions) -> int:
    """Run one of these studies. Raises InputError for bad input."""
    settings = options.settings()
    output = StudyOutput(options.out)
    textures = read_source(options.source, options.side()).textures
    inputs = GroupingInputs(features=FeatureOptions(cache=features_cache()))
    clustered = make_grouping(GroupingConfig("clustered", options.clusters), textures, inputs)
    baseline = make_grouping(GroupingConfig("baseline"), textures, inputs)
    if isinstance(options, AblationStudyOptions) and options.codec == "block":
        return _study_block(options, textures, clustered, output)
    channels = max(texture.pixels.shape[2] for texture in textures)
    results = do_runs(training_steps(_runs(options, channels, clustered, baseline, settings), textures, options.out))
    title = describe(options.source, textures, settings, f"{clustered.group_count} clusters")
    write_pages(output, title, settings, [_page(options, results, title)], results)
    return 0
