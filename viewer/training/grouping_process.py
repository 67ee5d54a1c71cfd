"""Grouping in a process of its own: scikit-learn takes a second to import, and covisible needs OpenGL; a window must not wait.

The process ends with its one answer, and with the program that started it."""

from dataclasses import dataclass
from pathlib import Path

from ntc.codec.config import GroupingConfig
from ntc.codec.model import Grouping
from ntc.codec.textures import SourceTexture
from ntc.errors import InputError
from ntc.features import FeatureOptions
from ntc.grouping import GroupingInputs, make_grouping
from ntc.worker.shared_arrays import SharedBlock, without_arrays
from viewer.jobs.function_process import FunctionProcess
from viewer.jobs.job import JobReport
from viewer.locations import features_cache

NICENESS = 10
SECONDS_BETWEEN_CHECKS = 0.05
WITHOUT_FEATURES = ("baseline", "single", "category")
"""Groupings that are found at once, without another process."""


@dataclass(frozen=True, eq=False)
class GroupingJob:
    """Textures to be grouped, and how."""

    config: GroupingConfig
    textures: tuple[SourceTexture, ...]
    """With their pixels."""
    scene: Path | None
    """File of the scene whose views `covisible` draws."""


def grouping_inputs(job: GroupingJob) -> GroupingInputs:
    """What the grouping needs besides the textures. Raises InputError."""
    features = FeatureOptions(cache=features_cache())
    if job.config.name != "covisible":
        return GroupingInputs(features=features)
    if job.scene is None:
        raise InputError("covisible: the scene comes from no file that could be drawn; choose another grouping")
    from viewer.scene.load import load_scene
    from viewer.viewpoints.scene_views import ViewSource, scene_views

    scene = load_scene(job.scene)
    hashes = {texture.pixel_hash for texture in scene.textures}
    if not hashes >= {texture.pixel_hash for texture in job.textures}:
        # Views of one scene cannot group the textures of another.
        raise InputError(f"{job.scene}: has changed since it was opened; open it again")
    views = scene_views(scene, ViewSource(seed=job.config.seed))
    return GroupingInputs(views.all_then_release(), {}, features)


def group_textures(request: tuple[GroupingJob, str]) -> Grouping:
    """In the grouping process: the grouping of a job whose pixels lie in the shared block of that name. Raises InputError."""
    places, block_name = request
    block = SharedBlock.open(block_name)
    job = block.read(places)
    block.close()
    return make_grouping(job.config, job.textures, grouping_inputs(job))


def find_grouping(job: GroupingJob, report: JobReport) -> Grouping:
    """What `make_grouping` finds. Raises InputError, and CancelledError as soon as the job of `report` is cancelled."""
    if job.config.name in WITHOUT_FEATURES:
        return make_grouping(job.config, job.textures)
    # Pixels go through shared memory: pickled, they would hold up the window's thread.
    block = SharedBlock.create(without_arrays(job)[2])
    process = FunctionProcess(group_textures, "grouping", NICENESS)
    try:
        call = process.call((block.write(job), block.name))
        while not call.done:
            report.check()
            call.join(SECONDS_BETWEEN_CHECKS)
        return call.result()
    finally:
        process.close()
        block.close()
