"""Training requests and their checks. Needs no torch."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import msgspec
import numpy as np

from ntc.codec.block.config import BlockCodecConfig
from ntc.codec.block.universal import UNIVERSAL
from ntc.codec.config import CodecConfig
from ntc.codec.maps import BASE_ALONE, channel_places, maps_fit
from ntc.codec.model import AnyCodec, Grouping, Pack
from ntc.codec.textures import SourceTexture
from ntc.errors import InputError
from ntc.pack.validate import check_grouping
from ntc.training.config import TrainingConfig
from ntc.training.snapshot import unchanged_groups


class StepBudget(msgspec.Struct, frozen=True, tag=True):
    """Train for a number of steps. Codec `block`: until so many textures have been encoded or refined, each once at least."""

    steps: int


class TimeBudget(msgspec.Struct, frozen=True, tag=True):
    """Train for a number of seconds, pauses not counted; the learning rates have fallen to 0 when they are over. Codec `block`
    ends earlier where nothing is left to do, and later where not all groups have been encoded."""

    seconds: float


class QualityBudget(msgspec.Struct, frozen=True, tag=True):
    """Train until samples of the trained textures together reach a PSNR in dB, then let the rates fall to the end; at most as
    long as the training's settings say."""

    psnr_db: float


Budget = StepBudget | TimeBudget | QualityBudget


@dataclass(frozen=True, eq=False)
class TrainingRequest:
    """What to train, for how long, and what to start from."""

    textures: tuple[SourceTexture, ...]
    grouping: Grouping
    codec: AnyCodec
    training: TrainingConfig
    """Of it codec `block` takes the seed alone."""
    budget: Budget | None = None
    """None: as many steps as `training` has."""
    start: Pack | None = None
    """A pack of the same textures in the same order and of the same codec, to continue from; None: from nothing."""
    dirty: frozenset[int] | None = None
    """Groups of `grouping` to train. None: those whose textures do not form a group of `start`, or all without it. Others
    must be groups of `start`."""
    seconds_between_snapshots: float = 2.0

    @property
    def grid_codec(self) -> CodecConfig:
        """`codec` of a training of codec `grid`. Raises InputError for another codec."""
        if isinstance(self.codec, CodecConfig):
            return self.codec
        raise InputError("training: codec block has no steps to train; it is encoded")

    @property
    def block_codec(self) -> BlockCodecConfig:
        """`codec` of an encoding in codec `block`. Raises InputError for another codec."""
        if isinstance(self.codec, BlockCodecConfig):
            return self.codec
        raise InputError("encoding: codec grid is not encoded in closed form; it is trained")


def check_textures(textures: Sequence[SourceTexture], grouping: Grouping, codec: AnyCodec) -> None:
    """Raises InputError for textures and groups that cannot be trained."""
    if not textures:
        raise InputError("there is no texture to train")
    try:
        check_grouping(grouping, len(textures))
    except ValueError as error:
        raise InputError(str(error)) from error
    if grouping.name == UNIVERSAL and isinstance(codec, CodecConfig):
        raise InputError(f"grouping {UNIVERSAL}: no decoder of codec grid ships with the program; use codec block")
    for texture in textures:
        if texture.pixels.dtype != np.uint8 or texture.pixels.ndim != 3 or texture.pixels.size == 0:
            raise InputError(
                f"{texture.name}: is {texture.pixels.dtype} {list(texture.pixels.shape)}; textures are 8-bit "
                "[height, width, channels], and at least one texel large"
            )
        if grouping.name == UNIVERSAL and texture.maps != BASE_ALONE:
            raise InputError(
                f"grouping {UNIVERSAL}: the decoder that ships with the program serves base colours alone; "
                "use another grouping, or --maps base"
            )
        _check_channels(texture, codec)


def _check_channels(texture: SourceTexture, codec: AnyCodec) -> None:
    """Raises InputError for channels that the codec has no room for."""
    try:
        channel_places(texture.maps, texture.channels, codec.maps, codec.output_channels)
    except ValueError as error:
        if not maps_fit(texture.maps, texture.channels):
            raise InputError(f"{texture.name}: {error}") from error
        raise InputError(
            f"{texture.name}: has {texture.channels} channels of {', '.join(texture.maps)}; set codec.output_channels to "
            f"at least that, not {codec.output_channels} of {', '.join(codec.maps)}"
        ) from error


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


def _check_start(textures: Sequence[SourceTexture], codec: AnyCodec, start: Pack) -> None:
    where = start.path or start.grouping.name
    if start.config != codec:
        raise InputError(f"{where}: was made with another codec; encode from nothing, or with the pack's own codec")
    known = [(t.pixel_hash, t.width, t.height, t.maps, t.channels, t.color_space, t.wrap) for t in start.textures]
    given = [(t.pixel_hash, *t.size, t.maps, t.channels, t.color_space, t.wrap) for t in textures]
    if known != given:
        raise InputError(f"{where}: does not hold these textures in this size and order; encode from nothing")
