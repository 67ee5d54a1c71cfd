"""Grouping in a process of its own: features keep Python's lock, and covisible needs OpenGL; a window must not wait.

The process ends with its one answer, and with the program that started it."""

from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ntc.codec.config import GroupingConfig
from ntc.codec.model import Grouping
from ntc.codec.textures import SourceTexture
from ntc.errors import InputError
from ntc.features import FeatureOptions
from ntc.grouping import GroupingInputs, make_grouping
from ntc.worker.process import FunctionProcess
from viewer.jobs.job import JobReport
from viewer.locations import cache_folder

NICENESS = 10
WITHOUT_FEATURES = ("baseline", "single", "category")
"""Groupings that are found at once, without another process."""


@dataclass(frozen=True, eq=False)
class GroupingJob:
    """Textures to be grouped, and how."""

    config: GroupingConfig
    textures: tuple[SourceTexture, ...]
    """The textures, with their pixels."""
    scene: Path | None
    """File of the scene whose views `covisible` draws."""


def grouping_inputs(job: GroupingJob) -> GroupingInputs:
    """Return what the grouping needs besides the textures. Raises InputError."""
    features = FeatureOptions(cache=cache_folder("features"))
    if job.config.name != "covisible":
        return GroupingInputs(features=features)
    if job.scene is None:
        raise InputError("covisible: needs a scene that was read from a file; choose another grouping")
    from viewer.scene.load import load_scene
    from viewer.viewpoints.scene_views import ViewSource, scene_views

    scene = load_scene(job.scene)
    hashes = {own for texture in scene.textures for own in (texture.pixel_hash, texture.set_hash)}
    if not hashes >= {texture.pixel_hash for texture in job.textures}:
        # Views of one scene cannot group the textures of another.
        raise InputError(f"{job.scene}: has changed since it was opened; open it again")
    views = scene_views(scene, ViewSource(seed=job.config.seed))
    # Textures without a base colour, which have the last ids, may be left out.
    seen = tuple(np.where(view < len(job.textures), view, -1) for view in views.all_then_release())
    return GroupingInputs(seen, {}, features)


def group_textures(job: GroupingJob) -> Grouping:
    """Return the grouping of a job, in the grouping process. Raises InputError."""
    return make_grouping(job.config, job.textures, grouping_inputs(job))


class GroupingProcess:
    """A process that starts while the textures to group are still being made. Use in a `with` block."""

    def __init__(self, config: GroupingConfig) -> None:
        self._config = config
        self._process = FunctionProcess(group_textures, "grouping", NICENESS)

    def __enter__(self) -> "GroupingProcess":
        if self._config.name not in WITHOUT_FEATURES:
            # `find` reports why it cannot be started.
            with suppress(OSError):
                self._process.started()
        return self

    def __exit__(self, *_exception: object) -> None:
        self._process.close()

    def find(self, textures: tuple[SourceTexture, ...], scene: Path | None, report: JobReport) -> Grouping:
        """Return the grouping of `textures` of the scene in that file, as `make_grouping` finds it.

        Raises InputError, and CancelledError as soon as the job of `report` is cancelled.
        """
        if self._config.name in WITHOUT_FEATURES:
            return make_grouping(self._config, textures)
        return self._process.call(GroupingJob(self._config, textures, scene), report.check)
