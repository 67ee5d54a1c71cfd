"""What can be trained, and what can be trained again. Needs no torch."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ntc.codec.config import CodecConfig
from ntc.codec.textures import SourceTexture
from ntc.errors import InputError
from ntc.pack.model import Grouping, Pack
from ntc.pack.validate import check_grouping
from ntc.training.snapshot import unchanged_groups
from ntc.worker.protocol import QualityBudget, StepBudget, TimeBudget, TrainingRequest


def check_textures(textures: Sequence[SourceTexture], grouping: Grouping, codec: CodecConfig) -> None:
    """Raises InputError for textures and groups that cannot be trained."""
    if not textures:
        raise InputError("there is no texture to train")
    try:
        check_grouping(grouping, len(textures))
    except ValueError as error:
        raise InputError(str(error)) from error
    for texture in textures:
        if texture.pixels.dtype != np.uint8 or texture.pixels.ndim != 3 or texture.pixels.size == 0:
            raise InputError(
                f"{texture.name}: is {texture.pixels.dtype} {list(texture.pixels.shape)}; textures are 8-bit "
                "[height, width, channels], and at least one texel large"
            )
        channels = texture.pixels.shape[2]
        if channels > codec.output_channels:
            raise InputError(
                f"{texture.name}: has {channels} channels; set codec.output_channels to at least that, "
                f"not {codec.output_channels}"
            )


def checked_request(request: TrainingRequest) -> TrainingRequest:
    """`request` with its dirty groups named. Raises InputError for what cannot be trained."""
    grouping, start = request.grouping, request.start
    check_textures(request.textures, grouping, request.codec)
    budget = request.budget
    for name, value in (
        ("steps", budget.steps if isinstance(budget, StepBudget) else None),
        ("seconds", budget.seconds if isinstance(budget, TimeBudget) else None),
        ("PSNR", budget.psnr_db if isinstance(budget, QualityBudget) else None),
    ):
        if value is not None and not (np.isfinite(value) and value > 0):
            raise InputError(f"budget: {name} is {value}; set it above 0")
    if start is not None:
        _check_start(request.textures, request.codec, start)
    everything = frozenset(range(grouping.group_count))
    clean = frozenset() if start is None else frozenset(unchanged_groups(start.grouping, grouping))
    dirty = everything - clean if request.dirty is None else request.dirty
    if not dirty:
        raise InputError("there is no group to train: all are as they were; name those that are to be trained again")
    if not dirty <= everything:
        raise InputError(f"group {max(dirty - everything)}: there are groups 0 to {grouping.group_count - 1} only")
    missing = everything - clean - dirty
    if missing:
        raise InputError(f"group {min(missing)}: has other textures than before, or none; it must be trained too")
    return replace(request, dirty=dirty)


def _check_start(textures: Sequence[SourceTexture], codec: CodecConfig, start: Pack) -> None:
    where = start.path or start.grouping.name
    if start.config != codec:
        raise InputError(f"{where}: was made with another codec; encode from nothing, or with the pack's own codec")
    known = [(t.pixel_hash, t.width, t.height, t.channels, t.color_space, t.wrap) for t in start.textures]
    given = [(t.pixel_hash, *t.size, t.pixels.shape[2], t.color_space, t.wrap) for t in textures]
    if known != given:
        raise InputError(f"{where}: does not hold these textures in this size and order; encode from nothing")
