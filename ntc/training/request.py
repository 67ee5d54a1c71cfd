"""Training requests and their checks. Needs no torch."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import msgspec
import numpy as np

from ntc.codec.checks import check_textures
from ntc.codec.encoding import Budget, EncodingOptions
from ntc.codec.model import CodecSettings, Grouping, Pack
from ntc.codec.textures import SourceTexture
from ntc.errors import InputError
from ntc.training.snapshot import unchanged_groups


@dataclass(frozen=True, eq=False)
class TrainingRequest:
    """What to train, for how long, and what to start from."""

    textures: tuple[SourceTexture, ...]
    grouping: Grouping
    codec: CodecSettings
    training: EncodingOptions
    """How the codec encodes: its own kind of options."""
    budget: Budget | None = None
    """None: as many steps as `training` has."""
    start: Pack | None = None
    """A pack of the same textures in the same order and of the same codec, to continue from; None: from nothing."""
    dirty: frozenset[int] | None = None
    """Groups of `grouping` to train. None: those whose textures do not form a group of `start`, or all without it. Others
    must be groups of `start`."""
    seconds_between_snapshots: float = 2.0


def checked_request(request: TrainingRequest) -> TrainingRequest:
    """`request` with its dirty groups named. Raises InputError for what cannot be trained."""
    grouping, start, budget = request.grouping, request.start, request.budget
    check_textures(request.textures, grouping, request.codec)
    if budget is not None:
        (value,) = msgspec.structs.astuple(budget)
        if not (np.isfinite(value) and value > 0):
            name = {"psnr_db": "PSNR"}.get(budget.__struct_fields__[0], budget.__struct_fields__[0])
            raise InputError(f"budget: {name} is {value}; set it above 0")
    if start is not None:
        _check_start(request.textures, request.codec, start)
    everything = frozenset(range(grouping.group_count))
    clean = frozenset() if start is None else frozenset(unchanged_groups(start.grouping, grouping))
    dirty = everything - clean if request.dirty is None else request.dirty
    if not dirty:
        raise InputError("there is no group to train: all are unchanged; name those that are to be trained again")
    if not dirty <= everything:
        raise InputError(f"group {max(dirty - everything)}: there are groups 0 to {grouping.group_count - 1} only")
    missing = everything - clean - dirty
    if missing:
        raise InputError(f"group {min(missing)}: has other textures than before, or none; it must be trained too")
    return replace(request, dirty=dirty)


def _check_start(textures: Sequence[SourceTexture], codec: CodecSettings, start: Pack) -> None:
    where = start.path or start.grouping.name
    if start.config != codec:
        raise InputError(f"{where}: was made with another codec; encode from nothing, or with the pack's own codec")
    known = [(t.pixel_hash, t.width, t.height, t.maps, t.channels, t.color_space, t.wrap) for t in start.textures]
    given = [(t.pixel_hash, *t.size, t.maps, t.channels, t.color_space, t.wrap) for t in textures]
    if known != given:
        raise InputError(f"{where}: does not hold these textures in this size and order; encode from nothing")
