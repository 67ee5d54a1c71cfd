"""Encoding textures in codec `block`: in closed form, group by group, on the CPU."""

import platform
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

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
    began, quantizer = time.monotonic(), TrellisQuantizer()
    encoded: dict[int, EncodedTexture] = {}
    decoders: list[BlockDecoder] = []
    for group in range(grouping.group_count):
        members = group_members(grouping, group)
        _check_cancelled(cancelled)
        decoder = fit_decoder([textures[index] for index in members], config, seed)
        decoders.append(decoder)
        for index in members:
            _check_cancelled(cancelled)
            encoded[index] = _encoded(textures[index], group, decoder, config, quantizer)
            if report is not None:
                report(_progress(encoded, len(textures), time.monotonic() - began))
    record = {
        "codec": config.kind,
        "seed": seed,
        "device": "cpu",
        "torch": torch.__version__,
        "numpy": np.__version__,
        "python": platform.python_version(),
    }
    return Pack(config, grouping, tuple(encoded[index] for index in range(len(textures))), tuple(decoders), record)


def _check_cancelled(cancelled: CancelQuestion | None) -> None:
    if cancelled is not None and cancelled():
        raise TrainingCancelledError


def _encoded(
    source: SourceTexture, group: int, decoder: BlockDecoder, config: BlockCodecConfig, quantizer: TrellisQuantizer
) -> EncodedTexture:
    blocks = encode_texture(source, decoder, config, quantizer)
    found = encoded_block_texture(source, group, blocks)
    decoded = decode_image(blocks, decoder, config)[..., : found.channels]
    return replace(found, psnr_db=psnr_db(decoded, source.pixels))


def _progress(encoded: dict[int, EncodedTexture], textures: int, seconds: float) -> BlockProgress:
    summary = PsnrSummary.of([texture.psnr_db for texture in encoded.values() if texture.psnr_db is not None])
    left = seconds * (textures - len(encoded)) / len(encoded)
    return BlockProgress(len(encoded), textures, summary.of_mean_mse_db if summary else 0.0, left)
