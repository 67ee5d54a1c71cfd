"""Encoding textures in codec `block`: in closed form, group by group, on the CPU."""

import platform
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Literal

import numpy as np
import torch

from ntc.codec.block.config import BlockConfig
from ntc.codec.block.encoding.blocks import sample_textures
from ntc.codec.block.encoding.encoder import encode_texture
from ntc.codec.block.encoding.quantizer import TrellisQuantizer
from ntc.codec.block.encoding.sharing import DEFAULT_SHARING, RateCurve, Sharing, share_words
from ntc.codec.block.encoding.tables import fit_decoder, rate_curve
from ntc.codec.block.model import BlockDecoder, BlockTexture
from ntc.codec.block.reference import decode_image
from ntc.codec.block.universal import universal_decoder
from ntc.codec.checks import check_textures
from ntc.codec.config import UNIVERSAL
from ntc.codec.interruption import CancelQuestion
from ntc.codec.map_quality import measured_texture
from ntc.codec.model import Grouping, Pack
from ntc.codec.psnr import PsnrSummary
from ntc.codec.textures import SourceTexture
from ntc.errors import TrainingCancelledError
from ntc.threads import PacedThreads


@dataclass(frozen=True, eq=False)
class BlockGroup:
    """A group as a pack stores it, at one moment of an encoding."""

    group: int
    members: tuple[int, ...]
    """Indices of its textures."""
    textures: tuple[BlockTexture, ...]
    """The members, with PSNR."""
    decoder: BlockDecoder
    final: bool
    """Whether no later stage changes it."""


@dataclass(frozen=True, eq=False)
class BlockStage:
    """Where an encoding stands. A pack of the groups so far is a valid one."""

    done: int
    """Textures encoded so far."""
    total: int
    """Textures to encode."""
    psnr_db: Mapping[int, float]
    """By texture: PSNR in dB of mip 0, of those encoded so far; infinity where it is exact."""
    changed: BlockGroup | None = None
    """A group all of whose textures have now been encoded, or that is better than it was before."""


BlockWork = Literal["encoding", "correcting"]


@dataclass(frozen=True)
class BlockProgress:
    """One report of an encoding under way: after each texture."""

    done: int
    """Textures encoded so far."""
    textures: int
    """Textures in all."""
    mean_psnr_db: float
    """PSNR in dB of the mean square error of those that are done; infinity where they are exact."""
    seconds_left: float
    work: BlockWork = "encoding"
    """What of textures is counted: correcting comes after all are encoded, where a quality was asked for."""


BlockProgressListener = Callable[[BlockProgress], None]


def encoding_stages(
    textures: Sequence[SourceTexture],
    grouping: Grouping,
    config: BlockConfig,
    seed: int,
    groups: Sequence[int],
) -> Iterator[BlockStage]:
    """Encode `groups` of `grouping`, one after the other; yields before the first texture and after each one.

    The textures of a group share its words among each other, so a group is the same whichever others are encoded. Whoever stops
    asking ends it.
    """
    total = sum(len(grouping.members(group)) for group in groups)
    yield BlockStage(0, total, {})
    plans = (_shared([fitted_group(textures, grouping, group, config, seed)], config)[0] for group in groups)
    yield from _encoding_stages(textures, plans, config, total)


@dataclass(frozen=True, eq=False)
class FittedGroup:
    """A group whose tables are known, and what words are worth to its textures."""

    group: int
    members: tuple[int, ...]
    """Indices of its textures."""
    decoder: BlockDecoder
    curves: tuple[RateCurve, ...]
    """Of the members."""


@dataclass(frozen=True, eq=False)
class _GroupPlan:
    fitted: FittedGroup
    words: tuple[float, ...]
    """By member: words a block."""


def fitted_group(
    textures: Sequence[SourceTexture], grouping: Grouping, group: int, config: BlockConfig, seed: int
) -> FittedGroup:
    """The tables of a group: fitted to samples of its textures, or those that ship. `seed` decides which blocks are sampled."""
    members = grouping.members(group)
    samples = sample_textures([textures[index] for index in members], config, seed)
    ships = grouping.name == UNIVERSAL
    decoder = universal_decoder(config.output_channels) if ships else fit_decoder(samples, config, seed)
    return FittedGroup(group, members, decoder, tuple(rate_curve(sample, decoder, config) for sample in samples))


def fitted_groups(
    textures: Sequence[SourceTexture],
    grouping: Grouping,
    config: BlockConfig,
    seed: int,
    cancelled: CancelQuestion | None = None,
) -> list[FittedGroup]:
    """All groups of `grouping`. Raises TrainingCancelledError when `cancelled` says so."""
    fitted = []
    for group in range(grouping.group_count):
        if cancelled is not None and cancelled():
            raise TrainingCancelledError
        fitted.append(fitted_group(textures, grouping, group, config, seed))
    return fitted


def _shared(fitted: Sequence[FittedGroup], config: BlockConfig, sharing: Sharing = DEFAULT_SHARING) -> list[_GroupPlan]:
    """What each texture of these groups may take, where they share the words of all their blocks."""
    curves = [curve for each in fitted for curve in each.curves]
    if sharing.worth is not None:
        sharing = replace(sharing, worth=tuple(sharing.worth[index] for each in fitted for index in each.members))
    given = share_words(curves, config.mean_words * sum(curve.block_count for curve in curves), sharing)
    words = iter(given)
    return [_GroupPlan(each, tuple(next(words) for _ in each.members)) for each in fitted]


def _encoding_stages(
    textures: Sequence[SourceTexture],
    plans: Iterable[_GroupPlan],
    config: BlockConfig,
    total: int,
    threads: int | None = None,
) -> Iterator[BlockStage]:
    quantizer, psnr_db_of = TrellisQuantizer(), dict[int, float]()
    with PacedThreads(threads) as paced:
        for plan in plans:
            group, members, decoder = plan.fitted.group, plan.fitted.members, plan.fitted.decoder
            encode = partial(encode_member, group=group, decoder=decoder, config=config, quantizer=quantizer)
            parts = [(textures[index], words) for index, words in zip(members, plan.words, strict=True)]
            sizes = [source.pixels.size for source, _ in parts]
            encoded: list[BlockTexture] = []
            for index, found in zip(members, paced.map(encode, parts, sizes), strict=True):
                encoded.append(found)
                psnr_db_of[index] = found.psnr_db or 0.0
                whole = len(encoded) == len(members)
                changed = BlockGroup(group, members, tuple(encoded), decoder, final=True) if whole else None
                yield BlockStage(len(psnr_db_of), total, dict(psnr_db_of), changed)


def encoding_record(config: BlockConfig, seed: int) -> dict[str, Any]:
    """What a pack records of its encoding."""
    return {
        "codec": config.kind,
        "seed": seed,
        "device": "cpu",
        "torch": torch.__version__,
        "numpy": np.__version__,
        "python": platform.python_version(),
    }


def encode_blocks(
    textures: Sequence[SourceTexture],
    grouping: Grouping,
    config: BlockConfig,
    seed: int = 0,
    report: BlockProgressListener | None = None,
    cancelled: CancelQuestion | None = None,
    threads: int | None = None,
    sharing: Sharing = DEFAULT_SHARING,
) -> Pack:
    """A pack of codec `block` of `textures` in the groups of `grouping`, which all share its words. The same seed gives the same
    pack, with any number of threads; `threads` is the most, None as many as pay. `sharing` is by texture of `textures`.

    Raises InputError for textures and groups that cannot be encoded, TrainingCancelledError when `cancelled` says so.
    """
    check_textures(textures, grouping, config)
    began = time.monotonic()
    fitted = fitted_groups(textures, grouping, config, seed, cancelled)
    stages = _encoding_stages(textures, _shared(fitted, config, sharing), config, len(textures), threads)

    def reported() -> Iterator[BlockStage]:
        for stage in stages:
            if report is not None:
                report(_progress(stage, time.monotonic() - began))
            if cancelled is not None and cancelled() and stage.done < stage.total:
                raise TrainingCancelledError
            yield stage

    return encoded_pack(reported(), grouping, config, seed)


def encode_fitted(
    textures: Sequence[SourceTexture],
    fitted: Sequence[FittedGroup],
    grouping: Grouping,
    config: BlockConfig,
    seed: int = 0,
    threads: int | None = None,
) -> Pack:
    """A pack of `textures`, whose groups have the tables `fitted`; they all share its words."""
    return encoded_pack(
        _encoding_stages(textures, _shared(fitted, config), config, len(textures), threads), grouping, config, seed
    )


def encoded_pack(stages: Iterable[BlockStage], grouping: Grouping, config: BlockConfig, seed: int) -> Pack:
    """The pack that `stages` of all groups end with."""
    encoded: dict[int, BlockTexture] = {}
    decoders: dict[int, BlockDecoder] = {}
    for stage in stages:
        if stage.changed is not None:
            decoders[stage.changed.group] = stage.changed.decoder
            encoded.update(zip(stage.changed.members, stage.changed.textures, strict=True))
    return Pack(
        config,
        grouping,
        tuple(encoded[index] for index in range(len(grouping.groups))),
        tuple(decoders[group] for group in range(grouping.group_count)),
        encoding_record(config, seed),
    )


def encode_member(
    part: tuple[SourceTexture, float],
    group: int,
    decoder: BlockDecoder,
    config: BlockConfig,
    quantizer: TrellisQuantizer,
) -> BlockTexture:
    """A texture of a group as a pack stores it, with its PSNR. `part`: the texture, and its words a block on average at most."""
    source, words = part
    found = encode_texture(source, decoder, config, quantizer, words, group)
    decoded = decode_image(found, decoder, config)[..., found.places(config)]
    return measured_texture(found, decoded, source.pixels)


def _progress(stage: BlockStage, seconds: float) -> BlockProgress:
    summary = PsnrSummary.of(list(stage.psnr_db.values()))
    left = seconds * (stage.total - stage.done) / stage.done
    return BlockProgress(stage.done, stage.total, summary.of_mean_mse_db if summary else 0.0, left)
