"""Encoding textures in codec `block`: in closed form, group by group, on the CPU."""

import platform
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import torch

from ntc.codec.block.config import BlockCodecConfig
from ntc.codec.block.encoder import encode_texture, fit_decoder
from ntc.codec.block.model import BlockDecoder
from ntc.codec.block.quantizer import TrellisQuantizer
from ntc.codec.block.reference import decode_image
from ntc.codec.block_pack import encoded_block_texture
from ntc.codec.model import EncodedTexture, Grouping, Pack
from ntc.codec.textures import SourceTexture
from ntc.errors import TrainingCancelledError
from ntc.metrics.metrics import PsnrSummary, psnr_db
from ntc.training.progress import CancelQuestion
from ntc.training.request import check_textures
from ntc.training.snapshot import group_members


@dataclass(frozen=True, eq=False)
class BlockGroup:
    """A group as a pack stores it, at one moment of an encoding."""

    group: int
    members: tuple[int, ...]
    """Indices of its textures."""
    textures: tuple[EncodedTexture, ...]
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


BlockProgressListener = Callable[[BlockProgress], None]


def encoding_stages(
    textures: Sequence[SourceTexture],
    grouping: Grouping,
    config: BlockCodecConfig,
    seed: int,
    groups: Sequence[int],
) -> Iterator[BlockStage]:
    """Encode `groups` of `grouping`, one after the other; yields before the first texture and after each one.

    The same seed gives the same groups, whichever others are encoded. Whoever stops asking ends it.
    """
    quantizer, psnr_db_of = TrellisQuantizer(), dict[int, float]()
    total = sum(len(group_members(grouping, group)) for group in groups)
    yield BlockStage(0, total, {})
    for group in groups:
        members = group_members(grouping, group)
        decoder = fit_decoder([textures[index] for index in members], config, seed)
        encoded: list[EncodedTexture] = []
        for index in members:
            encoded.append(_encoded(textures[index], group, decoder, config, quantizer))
            psnr_db_of[index] = encoded[-1].psnr_db or 0.0
            whole = len(encoded) == len(members)
            changed = BlockGroup(group, members, tuple(encoded), decoder, final=True) if whole else None
            yield BlockStage(len(psnr_db_of), total, dict(psnr_db_of), changed)


def encoding_record(config: BlockCodecConfig, seed: int) -> dict[str, Any]:
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
    config: BlockCodecConfig,
    seed: int = 0,
    report: BlockProgressListener | None = None,
    cancelled: CancelQuestion | None = None,
) -> Pack:
    """A pack of codec `block` of `textures` in the groups of `grouping`. The same seed gives the same pack.

    Raises InputError for textures and groups that cannot be encoded, TrainingCancelledError when `cancelled` says so.
    """
    check_textures(textures, grouping, config)
    began = time.monotonic()
    encoded: dict[int, EncodedTexture] = {}
    decoders: dict[int, BlockDecoder] = {}
    for stage in encoding_stages(textures, grouping, config, seed, range(grouping.group_count)):
        if stage.changed is not None:
            decoders[stage.changed.group] = stage.changed.decoder
            encoded.update(zip(stage.changed.members, stage.changed.textures, strict=True))
        if report is not None and stage.done:
            report(_progress(stage, time.monotonic() - began))
        if cancelled is not None and cancelled() and stage.done < stage.total:
            raise TrainingCancelledError
    return Pack(
        config,
        grouping,
        tuple(encoded[index] for index in range(len(textures))),
        tuple(decoders[group] for group in range(grouping.group_count)),
        encoding_record(config, seed),
    )


def _encoded(
    source: SourceTexture, group: int, decoder: BlockDecoder, config: BlockCodecConfig, quantizer: TrellisQuantizer
) -> EncodedTexture:
    blocks = encode_texture(source, decoder, config, quantizer)
    found = encoded_block_texture(source, group, blocks)
    decoded = decode_image(blocks, decoder, config)[..., : found.channels]
    return replace(found, psnr_db=psnr_db(decoded, source.pixels))


def _progress(stage: BlockStage, seconds: float) -> BlockProgress:
    summary = PsnrSummary.of(list(stage.psnr_db.values()))
    left = seconds * (stage.total - stage.done) / stage.done
    return BlockProgress(stage.done, stage.total, summary.of_mean_mse_db if summary else 0.0, left)
