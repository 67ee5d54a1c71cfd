"""Grouping in a helper process: features keep Python's lock, and covisible needs OpenGL; a window must not wait."""

from dataclasses import dataclass
from pathlib import Path

from ntc.codec.config import GroupingConfig
from ntc.codec.model import Grouping
from ntc.codec.textures import SourceTexture
from ntc.errors import InputError
from ntc.features import FeatureOptions
from ntc.grouping import GroupingInputs, make_grouping
from ntc.worker.helpers import HELPERS, SECONDS_BETWEEN_CHECKS
from viewer.jobs.job import Job, JobReport
from viewer.locations import cache_folder

WITHOUT_FEATURES = ("baseline", "single", "category")
"""Groupings that are computed at once, without another process."""
COVISIBLE = "covisible"
"""Grouping that draws views with OpenGL."""


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
    if job.config.name != COVISIBLE:
        return GroupingInputs(features=features)
    if job.scene is None:
        raise InputError("covisible: needs a scene that was read from a file; choose another grouping")
    from viewer.scene.load import load_scene
    from viewer.viewpoints.scene_views import ViewSource, scene_views

    scene = load_scene(job.scene)
    hashes = {digest for texture in scene.textures for digest in (texture.pixel_hash, texture.set_hash)}
    if not hashes >= {texture.pixel_hash for texture in job.textures}:
        # Views of one scene cannot group the textures of another.
        raise InputError(f"{job.scene}: has changed since it was opened; open it again")
    views = scene_views(scene, ViewSource(seed=job.config.seed))
    return GroupingInputs(views.all_then_release(len(job.textures)), {}, features)


def group_textures(job: GroupingJob) -> Grouping:
    """Return the grouping of a job, in a helper. Raises InputError."""
    return make_grouping(job.config, job.textures, grouping_inputs(job))


def _start(_argument: None) -> None:
    """Do nothing: a helper that is asked for this imports the module."""


class GroupingAhead:
    """A grouping whose helper starts while the textures to group are still being made."""

    def __init__(self, config: GroupingConfig) -> None:
        """Start the helper, where the grouping needs one; `find` reports why it cannot be started."""
        self._config = config
        self._starting: Job[None] | None = None
        if config.name not in (*WITHOUT_FEATURES, COVISIBLE):
            self._starting = Job(lambda _report: HELPERS.call("grouping", _start, None)).start("grouping")

    def find(self, textures: tuple[SourceTexture, ...], scene: Path | None, report: JobReport) -> Grouping:
        """Return the grouping of `textures` of the scene in that file, as `make_grouping` finds it.

        Raises InputError, and CancelledError as soon as the job of `report` is cancelled.
        """
        if self._config.name in WITHOUT_FEATURES:
            return make_grouping(self._config, textures)
        while self._starting is not None and not self._starting.done:
            self._starting.join(SECONDS_BETWEEN_CHECKS)
            report.check()
        job = GroupingJob(self._config, textures, scene)
        return HELPERS.call("grouping", group_textures, job, report.check, alone=self._config.name == COVISIBLE)
