"""The points of the rate study: one after the other in this process, or as jobs in many."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

from lab.commands.options import RateStudyOptions
from lab.studies.rate import RateStudy
from lab.studies.rate_table import RatePoint
from ntc.codec.config import GroupingConfig
from ntc.codec.textures import SourceTexture
from ntc.errors import InputError
from ntc.features import FeatureOptions
from ntc.grouping import GroupingInputs, make_grouping
from viewer.cli.encode import read_source
from viewer.jobs.executor import Executor, LocalExecutor, RayExecutor, run_jobs
from viewer.locations import blocks_cache, features_cache

Found = RatePoint | str
"""A point, or one line: why it cannot be had."""


def read_textures(source: Path, side: int, most: int) -> tuple[SourceTexture, ...]:
    """At most `most` RGB textures of a scene or folder, evenly among all of them, at most `side` texels large. Raises InputError."""
    textures = [texture for texture in read_source(source, side).textures if texture.pixels.shape[2] == 3]
    if not textures:
        raise InputError(f"{source}: holds no texture of three channels")
    if len(textures) > most:
        textures = [textures[index * len(textures) // most] for index in range(most)]
    return tuple(textures)


@lru_cache(maxsize=1)
def rate_study(options: RateStudyOptions) -> RateStudy:
    """The study that `options` describe, with its textures. Raises InputError."""
    textures = read_textures(options.source, options.texture_size, options.most)
    inputs = GroupingInputs(features=FeatureOptions(cache=features_cache()))
    clusters = min(options.clusters, len(textures))
    groupings = [make_grouping(GroupingConfig(name, clusters), textures, inputs) for name in options.groupings]
    return RateStudy(
        textures,
        groupings,
        options.sides,
        options.bits,
        options.formats,
        options.grid_steps,
        options.disk_formats,
        options.jpeg_xl,
        options.flip_every,
        options.out / "runs",
        blocks_cache(),
    )


@dataclass(frozen=True)
class PointJob:
    """One point of a study; whoever measures it reads the textures itself."""

    options: RateStudyOptions
    number: int
    """Of `RateStudy.steps`."""


def measured_point(job: PointJob) -> Found:
    """The point, measured in one thread."""
    import torch

    torch.set_num_threads(1)
    _, step = rate_study(job.options).steps()[job.number]
    try:
        return step(lambda _done, _of: None)
    except InputError as error:
        return str(error)


def points_by_jobs(options: RateStudyOptions, tell: Callable[[int, Found], None]) -> list[RatePoint]:
    """All points that can be had, in the order of the steps; `tell` gets the number of each and what came of it, as they come.

    Raises InputError for a cluster that does not answer.
    """
    executor: Executor[PointJob, Found]
    if options.ray is not None:
        executor = RayExecutor(measured_point, options.ray)
    else:
        executor = LocalExecutor(measured_point, options.workers or 1)
    found: dict[int, RatePoint] = {}

    def take(job: PointJob, point: Found, _attempt: int) -> None:
        if isinstance(point, RatePoint):
            found[job.number] = point
        tell(job.number, point)

    try:
        jobs = (PointJob(options, number) for number in range(len(rate_study(options).steps())))
        for failure in run_jobs(executor, jobs, take):
            tell(failure.argument.number, failure.problem)
    finally:
        executor.close()
    return [found[number] for number in sorted(found)]
