"""Encoding, as every codec declares it: targets and choices, the work piece by piece, and what is known on the way. Needs no torch."""

import json
import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import msgspec

from ntc.codec.maps import BASE_ALONE, MapName, joint_maps
from ntc.codec.model import CodecSettings, Decoder, EncodedTexture, Grouping, Pack
from ntc.codec.textures import SourceTexture
from ntc.errors import InputError

PresetName = Literal["1bit", "2bit", "4bit", "8bit", "fast"]
HIGHEST_QUALITY_DB = 58.9
"""PSNR of errors spread evenly over an 8-bit step: beyond it, only exact values are nearer."""


@dataclass(frozen=True)
class BitsTarget:
    """A target bitrate in stored bits per texel of mip 0, mips and tables counted; the nearest possible one is taken."""

    bits: float
    block_side: Literal[4, 8] = 8
    multiply_adds: int | None = None
    """Largest number of multiply-adds to decode one texel; None: no limit."""
    preset: PresetName | None = None
    """The preset that stands for it."""

    def __post_init__(self) -> None:
        if not self.bits > 0.0:
            raise InputError(f"--bits {self.bits:g}: must be above 0")


@dataclass(frozen=True)
class SizeTarget:
    """A file of at most so many bytes."""

    megabytes: float
    """Largest size of the file in units of 10^6 bytes."""
    worth: tuple[float, ...] | None = None
    """Weight of an error in each texture, positive; only ratios matter. None: the same in all."""

    def __post_init__(self) -> None:
        if not (math.isfinite(self.megabytes) and self.megabytes > 0.0):
            raise InputError(f"--size {self.megabytes:g}: must be a number of megabytes above 0")


@dataclass(frozen=True)
class QualityTarget:
    """Each texture at least so near to its original, in as few words as possible."""

    psnr_db: float
    """Least PSNR of mip 0 in dB."""

    def __post_init__(self) -> None:
        if not 0.0 < self.psnr_db <= HIGHEST_QUALITY_DB:
            raise InputError(
                f"--quality {self.psnr_db:g}: set it above 0 and up to {HIGHEST_QUALITY_DB} dB, the most that 8 bits give"
            )


Target = BitsTarget | SizeTarget | QualityTarget


def given_target(target: Target | None) -> dict[str, str]:
    """Return the option that asks for `target`, and its value; empty for none."""
    if target is None:
        return {}
    if isinstance(target, BitsTarget):
        return {"preset": target.preset} if target.preset is not None else {"bits": f"{target.bits:g}"}
    return {"size": f"{target.megabytes:g}"} if isinstance(target, SizeTarget) else {"quality": f"{target.psnr_db:g}"}


PRESETS: Mapping[PresetName, BitsTarget] = {
    "1bit": BitsTarget(1.0, preset="1bit"),
    "2bit": BitsTarget(2.0, preset="2bit"),
    "4bit": BitsTarget(4.0, preset="4bit"),
    "8bit": BitsTarget(8.0, preset="8bit"),
    "fast": BitsTarget(2.0, 4, 100, preset="fast"),
}
"""`fast`: about 2 bits a texel in blocks of 4x4 texels, decoded in at most 100 multiply-adds a texel."""


CancelQuestion = Callable[[], bool]
Interruption = Callable[[], None]
"""Called many times while work goes on. It may wait, and the work continues when it returns; what it raises ends the work."""


def no_interruption() -> None:
    """Lets work continue."""


HEADER_BYTES, TEXTURE_HEADER_BYTES, DECODER_HEADER_BYTES = 3000, 800, 320
"""Upper bounds of the bytes of a file, of each texture and of each decoder, besides codes, tables, names and the grouping's
parameters."""
Sizes = Sequence[tuple[int, int]]


@dataclass(frozen=True)
class TextureSet:
    """The facts about a set of textures that decide about bits."""

    sizes: Sizes
    """(width, height) of mip 0 in texels."""
    groups: int
    """Decoders that are stored with them; 0: the one that ships with the program serves them."""
    channels: int
    """Channels of `maps` together."""
    levels: int | None = None
    """Encoded mips; None: all."""
    maps: tuple[MapName, ...] = BASE_ALONE
    """Maps that any of the textures has."""
    header_bytes: int = 0
    """Bytes of the file at most that are neither latents nor decoders (`file_header_bytes`)."""


def texture_set(
    textures: Sequence[SourceTexture], groups: int, levels: int | None = None, header_bytes: int = 0
) -> TextureSet:
    """Return what of `textures` in so many groups decides about bits; `levels` is the most encoded mips, None: all."""
    maps, channels = joint_maps((texture.maps, texture.channels) for texture in textures)
    return TextureSet([texture.size for texture in textures], groups, channels, levels, maps, header_bytes)


def file_header_bytes(textures: Sequence[SourceTexture], grouping: Grouping) -> int:
    """Return the bytes of a pack's file at most that are neither codes nor tables."""
    texts = [json.dumps([texture.name, texture.category]) for texture in textures]
    texts.append(json.dumps(dict(grouping.parameters)))
    sets = any(texture.maps != BASE_ALONE for texture in textures)
    # Of tables that ship for whole materials a file holds gains for each group.
    decoders = grouping.group_count if sets else grouping.stored_decoders
    fixed = HEADER_BYTES + TEXTURE_HEADER_BYTES * len(textures) + DECODER_HEADER_BYTES * decoders
    # Texts within a text: each quote and backslash may be written twice.
    return fixed + 2 * sum(map(len, texts))


def common_channels(channels: int) -> int:
    """Return the channels with which base colours of `channels` channels are encoded where many share settings: 3, or 4 with alpha."""
    return 3 if channels <= 3 else 4


RecipeName = Literal["paper", "best"]
DeviceName = Literal["auto", "cpu", "cuda"]
DEFAULT_SET_BITS = 4.0
"""Bits per texel of whole materials where no target is asked for."""
DEFAULT_BITS = 2.0
"""Bits per texel where no target is asked for."""


class StepBudget(msgspec.Struct, frozen=True, tag=True):
    """Train for a number of steps. A codec that is encoded in closed form ends when all textures are encoded, whatever the budget."""

    steps: int


class TimeBudget(msgspec.Struct, frozen=True, tag=True):
    """Train for a number of seconds, pauses not counted; the learning rates have fallen to 0 when they are over."""

    seconds: float


class QualityBudget(msgspec.Struct, frozen=True, tag=True):
    """Train until samples of the trained textures together reach a PSNR in dB, then let the rates fall to the end; at most as
    long as the training's settings say."""

    psnr_db: float


Budget = StepBudget | TimeBudget | QualityBudget


@dataclass(frozen=True)
class EncodingChoices:
    """The user's choices for an encoding. Where a field is None or has its default, the codec decides."""

    recipe: RecipeName = "best"
    steps: int | None = None
    epochs: float | None = None
    """Length in epochs: as many samples as mip 0 has texels, for each epoch."""
    device: DeviceName = "auto"
    state: Path | None = None
    """File that keeps the state of the training."""
    target: Target | None = None
    levels: int | None = None
    """Encoded mips at most; None: all."""
    seed: int = 0


class EncodingOptions:
    """Options of an encoding: the base of each codec's own frozen dataclass."""

    seed: int
    """The same seed gives the same pack on one machine."""


@dataclass(frozen=True, eq=False)
class EncodingTask:
    """Groups of textures to encode."""

    textures: tuple[SourceTexture, ...]
    grouping: Grouping
    settings: CodecSettings
    options: EncodingOptions
    groups: tuple[int, ...]
    """Numbers of the groups to encode, ascending."""
    budget: Budget | None = None
    start: Pack | None = None
    """A pack of the same textures to continue from; None: from nothing."""
    seconds: Callable[[], float] = lambda: 0.0
    """A clock that stands still in pauses."""
    interruption: Interruption = no_interruption
    """Function to call many times within a piece of work, from any thread: it waits in pauses, and raises to end the encoding."""


@dataclass(frozen=True)
class Piece:
    """The changes that one piece of work has made."""

    groups: tuple[int, ...] = ()
    """Groups under way whose intermediate state may be shown."""
    is_first: bool = False
    """True if the groups are worth a first snapshot."""
    ended: tuple[int, ...] = ()
    """Groups that are finished with this piece."""
    note: str = ""
    """A line for a log, or nothing."""


@dataclass(frozen=True)
class EncodingProgress:
    """Progress figures of an encoding."""

    share: float
    """Progress of the encoding in [0, 1]; a single large texture moves it."""
    passes: float
    """Planned work as a number of texels, each counted once for each pass over it. Measuring the quality of a texture is one pass."""
    step: int
    steps: int
    """Steps of training or textures: the one under way and all that are planned now. A step of training counts when it is done."""
    texels: int
    """Texels encoded or sampled since the beginning."""
    losses: Mapping[int, float]
    """Mean square error by group, values in [0, 1]. Groups not yet begun are missing."""
    psnr_db: Mapping[int, float]
    """PSNR in dB by texture, of those begun (`Codec.psnr_title` says of what)."""
    work: str = "training step"
    """Phase of the work and unit of `step`: `encoding texture` 5 of 13."""
    freezing_scale: float = 1.0
    """Scale of the decoder's updates: 1 free, 0 frozen."""


@dataclass(frozen=True, eq=False)
class EncodedGroup:
    """A group as a pack stores it."""

    group: int
    members: tuple[int, ...]
    """Indices of its textures."""
    textures: tuple[EncodedTexture, ...]
    decoder: Decoder


class Encoder(ABC):
    """One encoding under way."""

    settings: CodecSettings
    """Settings of the resulting pack; final when `pieces` has ended."""

    @property
    def replaces(self) -> bool:
        """True where results replace the groups of `EncodingTask.start` although their error is larger: fewer bits were asked for."""
        return False

    @abstractmethod
    def pieces(self) -> Generator[Piece]:
        """Do the work, stage after stage; gives a piece after each step or texture. Whoever stops asking ends it."""

    @abstractmethod
    def figures(self) -> EncodingProgress:
        """Return the progress of the work; called from any thread."""

    @abstractmethod
    def encoded(self, groups: Sequence[int]) -> Iterator[EncodedGroup]:
        """Yield groups as they are now; textures have a PSNR where it is known already."""

    @abstractmethod
    def measured(
        self, textures: Sequence[EncodedTexture], decoder: Decoder, members: Sequence[int]
    ) -> tuple[EncodedTexture, ...]:
        """Return `textures` under `decoder`, with the quality of their mip 0 against the originals, which are the task's `members`."""

    @abstractmethod
    def record(self) -> dict[str, Any]:
        """Return what a pack records of its encoding: JSON values."""

    # Keeping an encoding that was stopped; only codecs that train for long do that.

    def state(self) -> dict[str, Any]:
        """Everything that the next piece depends on: tensors of torch by name. Raises InputError where the codec keeps none."""
        raise InputError(f"codec {self.settings.kind}: cannot save the state of an encoding; leave --state out")

    def load(self, state: Mapping[str, Any]) -> None:
        """Continue from `state`. Raises KeyError, ValueError, TypeError or RuntimeError for one of another encoding."""
        del state
        raise InputError(f"codec {self.settings.kind}: cannot save the state of an encoding; leave --state out")
