"""Makes the request to the training worker from what the user asks for, or ahead of that. Takes seconds: runs in a thread."""

from concurrent.futures import CancelledError
from dataclasses import dataclass, replace
from pathlib import Path

from ntc.codec.config import UNIVERSAL, GroupingConfig
from ntc.codec.encoding import file_header_bytes, texture_set
from ntc.codec.maps import BASE_ALONE, MAP_CHANNELS
from ntc.codec.model import Pack
from ntc.codec.registry import codec_named, codec_of
from ntc.codec.textures import SourceTexture
from ntc.errors import InputError
from ntc.training.messages import TrainingRequest, moved_texture, unchanged_groups
from ntc.worker.client import TrainingWorker
from viewer.jobs.job import Job, JobReport
from viewer.scene.images import reduced_size
from viewer.scene.json_text import counted
from viewer.scene.model import Scene
from viewer.scene.source_textures import reduce_texture, source_textures, without_alpha
from viewer.training.grouping_process import GroupingAhead
from viewer.training.settings import DEFAULT_BUDGET, TrainingSettings, budget_text, target_text


@dataclass(frozen=True)
class EncodeScene:
    """Make a pack of a scene from nothing."""

    settings: TrainingSettings


@dataclass(frozen=True)
class RetrainGroups:
    """Go on training some groups of a pack."""

    settings: TrainingSettings
    groups: frozenset[int]


@dataclass(frozen=True)
class ReencodeTexture:
    """Encode one texture of a pack with other bits, under the decoder that it has; all others stay."""

    settings: TrainingSettings
    texture: int
    """Index of the texture in the pack."""
    bits: float
    """Bits per texel of its latents."""
    name: str = ""
    """Name of the texture, for the title."""


@dataclass(frozen=True)
class MoveTexture:
    """Put one texture of a pack into another group, and train both groups."""

    settings: TrainingSettings
    texture: int
    """Index of the texture in the pack."""
    group: int
    """A number from 0; the number of groups means a new group."""


@dataclass(frozen=True)
class Regroup:
    """Regroup the textures, and continue from the pack's latents."""

    settings: TrainingSettings


TrainingJob = EncodeScene | RetrainGroups | ReencodeTexture | MoveTexture | Regroup


def job_title(job: TrainingJob) -> str:
    """Return one line for progress and log: `retrain 2 groups (0, 3)`."""
    match job:
        case EncodeScene():
            return f"encode {job.settings.grouping_text}"
        case RetrainGroups():
            numbers = ", ".join(map(str, sorted(job.groups)[:6])) + (" ..." if len(job.groups) > 6 else "")
            return f"retrain {counted(len(job.groups), 'group')} ({numbers})"
        case ReencodeTexture():
            return f"{job.name or f'texture {job.texture}'} at {job.bits:.2g} bits"
        case MoveTexture():
            return f"move texture {job.texture} to group {job.group}"
        case Regroup():
            return f"regroup {job.settings.grouping_text}"


def settings_text(job: TrainingJob) -> str:
    """Return the settings that the title does not name: size, codec, recipe, budget."""
    settings, budget = job.settings, budget_text(job.settings.budget)
    if isinstance(job, ReencodeTexture):
        return f"{job.bits:.2f} bits per texel"
    if not isinstance(job, EncodeScene):
        return f"{settings.recipe}, {budget}"
    kind = settings.codec_kind
    if codec_named(kind).trains:
        return f"{_size_text(settings)}, {kind}, {settings.recipe}, {budget}"
    target = "" if settings.target is None else f", {target_text(settings.target, spaced=True)}"
    return f"{_size_text(settings)}, {kind}{target}"


def _size_text(settings: TrainingSettings) -> str:
    return "full size" if settings.texture_size is None else f"{settings.texture_size} texels"


def prepare(job: TrainingJob, scene: Scene, base: Pack | None, report: JobReport) -> TrainingRequest:
    """Return the request for a job. `base` is the pack to go on from; EncodeScene does not use it.

    Raises InputError for what cannot be trained, and CancelledError where `report` is cancelled.
    """
    if isinstance(job, EncodeScene):
        return _encode(job.settings, scene, report)
    if base is None:
        raise InputError("no pack is shown; encode the scene first")
    if isinstance(job, Regroup) and job.settings.strategy == UNIVERSAL:
        raise InputError(
            f"regroup {UNIVERSAL}: the shipped decoder has a different size; encode the scene in grouping {UNIVERSAL} instead"
        )
    grouping = base.grouping
    if isinstance(job, MoveTexture):
        grouping = moved_texture(base.grouping, job.texture, job.group)
        if grouping.groups == base.grouping.groups:
            raise InputError(f"texture {job.texture} is in group {job.group} already")
    if isinstance(job, Regroup):
        ahead = GroupingAhead(_grouping_config(job.settings))
        textures = _textures_of(base, scene, report)
        _check_clusters(job.settings, textures)
        grouping = ahead.find(textures, scene.path, report)
        if len(unchanged_groups(base.grouping, grouping)) == grouping.group_count:
            raise InputError(
                f"{job.settings.grouping_text}: finds the groups that the pack has already; there is nothing to train"
            )
    else:
        textures = _textures_of(base, scene, report)
    if isinstance(job, ReencodeTexture):
        reencoding = codec_of(base.config).reencoding_options(base, job.texture, job.bits)
        group = base.textures[job.texture].group
        return TrainingRequest(textures, grouping, base.config, reencoding, None, base, frozenset({group}))
    dirty = job.groups if isinstance(job, RetrainGroups) else None
    options = codec_of(base.config).live_options_for(job.settings.choices)
    return TrainingRequest(textures, grouping, base.config, options, job.settings.budget, base, dirty)


def _encode(settings: TrainingSettings, scene: Scene, report: JobReport) -> TrainingRequest:
    codec = codec_named(settings.codec_kind)
    maps, size = settings.chosen_maps, settings.texture_size
    ahead = GroupingAhead(_grouping_config(settings))
    textures = tuple(
        texture if size is None else _reduced(texture, size, report)
        for texture in source_textures(scene, None, maps, settings.only)
    )
    if not textures:
        raise InputError(f"{scene.name}: holds no texture to encode (constant images are factors and need no encoding)")
    _check_clusters(settings, textures)
    grouping = ahead.find(textures, scene.path, report)
    header = file_header_bytes(textures, grouping)
    known = texture_set(textures, grouping.stored_decoders, header_bytes=header)
    config = codec.settings_for(known, settings.choices)
    options = codec.live_options_for(settings.choices)
    return TrainingRequest(textures, grouping, config, options, settings.budget)


def _reduced(texture: SourceTexture, size: int, report: JobReport) -> SourceTexture:
    """Reduce one texture. They are reduced one after the other: the second core belongs to the window."""
    report.check()
    return reduce_texture(texture, size)


def _grouping_config(settings: TrainingSettings) -> GroupingConfig:
    return GroupingConfig(settings.strategy, settings.clusters)


def _check_clusters(settings: TrainingSettings, textures: tuple[SourceTexture, ...]) -> None:
    if settings.clusters is not None and settings.clusters > len(textures):
        raise InputError(
            f"groups {settings.clusters}: the scene has {counted(len(textures), 'texture')}; choose at most as many groups"
        )


def _textures_of(pack: Pack, scene: Scene, report: JobReport) -> tuple[SourceTexture, ...]:
    """Return the scene's textures as `pack` was made from them, in its order."""
    by_hash = {texture.pixel_hash: texture for texture in source_textures(scene, None)}
    if pack.config.maps != BASE_ALONE:
        by_hash |= {texture.pixel_hash: texture for texture in source_textures(scene, None, "all")}
    encoded_textures = []
    for encoded in pack.textures:
        source = by_hash.get(encoded.pixel_hash)
        if source is None:
            raise InputError(
                f"{encoded.name}: is in the pack but not in {scene.name}, so the pack cannot be trained here; encode the scene"
            )
        known = source if "alpha" in encoded.maps else without_alpha(source)
        small = _reduced(known, max(encoded.width, encoded.height), report)
        encoded_textures.append(replace(small, name=encoded.name, wrap=encoded.wrap, category=encoded.category))
    return tuple(encoded_textures)


LEAST_MEMORY = 2_000_000_000
"""Bytes that must be free: the process takes about 250 MB before it trains, and the prepared textures a share of the scene's."""
MEMORY_FILE = Path("/proc/meminfo")
SECONDS_BETWEEN_CHECKS = 0.02
SECONDS_TO_END = 3.0


COPIES = 2
"""Copies of the prepared textures: here, and in the process that encodes."""


def _pixel_bytes(settings: TrainingSettings, scene: Scene) -> int:
    """Return the bytes of the prepared textures of an encoding."""
    sizes = [
        texture.size if settings.texture_size is None else reduced_size(*texture.size, settings.texture_size)
        for texture in scene.textures
    ]
    channels = [sum(MAP_CHANNELS[name] for name in texture.maps) + texture.has_alpha for texture in scene.textures]
    return sum(width * height * count for (width, height), count in zip(sizes, channels, strict=True))


def free_memory() -> int | None:
    """Return the bytes that programs can still have; None where the system does not say."""
    try:
        for line in MEMORY_FILE.read_text().splitlines():
            name, _, amount = line.partition(":")
            if name == "MemAvailable":
                return int(amount.split()[0]) * 1024
    except (OSError, ValueError, IndexError):
        return None
    return None


class AheadPreparation:
    """The encoding of one scene, prepared before it is asked for."""

    def __init__(self) -> None:
        self._job: EncodeScene | None = None
        self._scene: Scene | None = None
        self._preparation: Job[TrainingRequest] | None = None

    def begin(self, job: EncodeScene, scene: Scene, worker: TrainingWorker) -> None:
        """Start the process of `worker` and prepare `job`, in a thread. No effect where that was begun for the scene, and where memory
        is short.

        No other code uses the worker until `take` has returned in the thread of another preparation, or `end` has.
        """
        if self._scene is scene:
            return
        before = self._preparation
        self.forget()
        self._job, self._scene = job, scene
        memory = free_memory()
        if memory is not None and memory < LEAST_MEMORY + COPIES * _pixel_bytes(job.settings, scene):
            return

        def begin(report: JobReport) -> TrainingRequest:
            if before is not None:
                before.join(SECONDS_TO_END)
            worker.warm_up()
            return prepare(job, scene, None, report)

        self._preparation = Job(begin).start("prepare ahead")

    def take(self, job: TrainingJob, scene: Scene, report: JobReport) -> TrainingRequest | None:
        """Return the request for `job`, as soon as it is prepared; None where nothing like it was. To be called in a thread.

        Raises what preparing raised, and CancelledError where `report` is cancelled.
        """
        preparation, self._preparation = self._preparation, None
        if preparation is None:
            return None
        wanted = self._scene is scene and self._job is not None and _prepared_as(job) == _prepared_as(self._job)
        if not wanted:
            preparation.cancel()
        while not preparation.done:
            try:
                report.check()
            except CancelledError:
                preparation.cancel()
                preparation.join(SECONDS_TO_END)
                raise
            preparation.join(SECONDS_BETWEEN_CHECKS)
        return replace(preparation.result(), budget=job.settings.budget) if wanted else None

    def forget_other(self, scene: Scene) -> None:
        """Drop what belongs to another scene than `scene`."""
        if self._scene is not None and self._scene is not scene:
            self.forget()

    def forget(self) -> None:
        """Drop what there is, without waiting."""
        if self._preparation is not None:
            self._preparation.cancel()
        self._job = self._scene = None

    def end(self) -> None:
        """End what is under way; waits for its thread."""
        self.forget()
        if self._preparation is not None:
            self._preparation.join(SECONDS_TO_END)
            self._preparation = None


def _prepared_as(job: TrainingJob) -> TrainingJob:
    """Return `job` with fixed values for settings that do not affect its preparation."""
    settings = replace(job.settings, codec=job.settings.codec_kind, budget=DEFAULT_BUDGET)
    return replace(job, settings=settings)
