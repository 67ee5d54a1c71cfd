"""Makes the request to the training worker from what the user asks for. Takes seconds: runs in a thread beside the window."""

from dataclasses import dataclass, replace

from ntc.codec.config import UNIVERSAL, GroupingConfig
from ntc.codec.encoding import texture_set
from ntc.codec.maps import BASE_ALONE
from ntc.codec.model import Pack
from ntc.codec.registry import codec_named, codec_of
from ntc.codec.textures import SourceTexture
from ntc.errors import InputError
from ntc.training.request import TrainingRequest
from ntc.training.snapshot import moved_texture, unchanged_groups
from viewer.jobs.job import JobReport
from viewer.scene.model import Scene
from viewer.scene.source_textures import MapChoice, reduce_texture, source_textures
from viewer.training.grouping_process import GroupingProcess
from viewer.training.settings import TrainingSettings, budget_text


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
class MoveTexture:
    """Put one texture of a pack into another group, and train both groups."""

    settings: TrainingSettings
    texture: int
    """Its index in the pack."""
    group: int
    """A number from 0; the number of groups means a new group."""


@dataclass(frozen=True)
class Regroup:
    """Group the textures anew, and go on from the pack's latents."""

    settings: TrainingSettings


TrainingJob = EncodeScene | RetrainGroups | MoveTexture | Regroup


def job_title(job: TrainingJob) -> str:
    """One line for progress and log: `retrain groups 0, 3`."""
    match job:
        case EncodeScene():
            return f"encode {job.settings.grouping_text}"
        case RetrainGroups():
            numbers = ", ".join(map(str, sorted(job.groups)[:6])) + (" ..." if len(job.groups) > 6 else "")
            return f"retrain group{'s' if len(job.groups) > 1 else ''} {numbers}"
        case MoveTexture():
            return f"move texture {job.texture} to group {job.group}"
        case Regroup():
            return f"regroup {job.settings.grouping_text}"


def settings_text(job: TrainingJob) -> str:
    """The settings that the title does not name: size, codec, recipe, budget."""
    settings, budget = job.settings, budget_text(job.settings.budget)
    if not isinstance(job, EncodeScene):
        return f"{settings.recipe}, {budget}"
    kind = settings.codec_kind
    codec, how = codec_named(kind), ""
    if codec.trains:
        how = f"{settings.recipe}, "
    elif codec.default_target is not None:
        how = f"{settings.bits:g} bits per texel, "
    return f"{settings.texture_size} texels, {kind}, {how}{budget}"


def prepare(job: TrainingJob, scene: Scene, base: Pack | None, report: JobReport) -> TrainingRequest:
    """The request for a job. `base` is the pack to go on from; EncodeScene does not use it.

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
        with GroupingProcess(_grouping_config(job.settings)) as process:
            textures = _textures_of(base, scene, report)
            _check_clusters(job.settings, textures)
            grouping = process.find(textures, scene.path, report)
        if len(unchanged_groups(base.grouping, grouping)) == grouping.group_count:
            raise InputError(f"{job.settings.grouping_text}: gives the present groups again; there is nothing to train")
    else:
        textures = _textures_of(base, scene, report)
    dirty = job.groups if isinstance(job, RetrainGroups) else None
    options = codec_of(base.config).live_options_for(job.settings.choices)
    return TrainingRequest(textures, grouping, base.config, options, job.settings.budget, base, dirty)


def _encode(settings: TrainingSettings, scene: Scene, report: JobReport) -> TrainingRequest:
    codec = codec_named(settings.codec_kind)
    # The decoder that ships serves base colours alone.
    maps: MapChoice = codec.default_maps if settings.strategy != UNIVERSAL else "base"
    with GroupingProcess(_grouping_config(settings)) as process:
        textures = tuple(
            _reduced(texture, settings.texture_size, report) for texture in source_textures(scene, None, maps)
        )
        if not textures:
            raise InputError(
                f"{scene.name}: holds no texture to encode (constant images are factors and need no encoding)"
            )
        _check_clusters(settings, textures)
        grouping = process.find(textures, scene.path, report)
    config = codec.settings_for(texture_set(textures, grouping.stored_decoders), settings.choices)
    options = codec.live_options_for(settings.choices)
    return TrainingRequest(textures, grouping, config, options, settings.budget)


def _reduced(texture: SourceTexture, size: int, report: JobReport) -> SourceTexture:
    """Textures are reduced one after the other: the second core belongs to the window."""
    report.check()
    return reduce_texture(texture, size)


def _grouping_config(settings: TrainingSettings) -> GroupingConfig:
    return GroupingConfig(settings.strategy, settings.clusters)


def _check_clusters(settings: TrainingSettings, textures: tuple[SourceTexture, ...]) -> None:
    if settings.clusters is not None and settings.clusters > len(textures):
        raise InputError(
            f"k {settings.clusters}: there are only {len(textures)} textures; choose at most as many groups"
        )


def _textures_of(pack: Pack, scene: Scene, report: JobReport) -> tuple[SourceTexture, ...]:
    """The scene's textures as `pack` was made from them, in its order."""
    by_hash = {texture.pixel_hash: texture for texture in source_textures(scene, None)}
    if pack.config.maps != BASE_ALONE:
        by_hash |= {texture.pixel_hash: texture for texture in source_textures(scene, None, "all")}
    found = []
    for encoded in pack.textures:
        source = by_hash.get(encoded.pixel_hash)
        if source is None:
            raise InputError(
                f"{encoded.name}: is in the pack but not in {scene.name}, so the pack cannot be trained here; encode the scene"
            )
        small = _reduced(source, max(encoded.width, encoded.height), report)
        found.append(replace(small, name=encoded.name, wrap=encoded.wrap, category=encoded.category))
    return tuple(found)
