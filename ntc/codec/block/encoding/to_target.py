"""Encoding in codec `block` to what is asked for: bits, a size, or a quality, for which each texture takes the words that it needs."""

import json
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import get_args

import numpy as np
from numpy.typing import NDArray

from ntc.codec.block.config import LARGEST_SET_WORDS, LARGEST_SIZES, LARGEST_WORDS, BlockConfig
from ntc.codec.block.encoding.blocks import sample_textures
from ntc.codec.block.encoding.quantizer import TrellisQuantizer
from ntc.codec.block.encoding.rate import (
    FEWEST_COEFFICIENTS,
    config_for_bits,
    config_for_bytes,
    config_for_words,
    texture_set,
)
from ntc.codec.block.encoding.sharing import RateCurve, Sharing, best_block_words, price_at_error
from ntc.codec.block.encoding.stages import (
    BlockProgress,
    BlockProgressListener,
    BlockWork,
    FittedGroup,
    encode_blocks,
    encode_member,
    encoding_record,
    fitted_groups,
)
from ntc.codec.block.encoding.tables import coefficient_energies, rate_curve
from ntc.codec.block.model import BlockTexture
from ntc.codec.checks import check_textures
from ntc.codec.interruption import CancelQuestion
from ntc.codec.model import Grouping, Pack
from ntc.codec.psnr import PsnrSummary, mse_of_psnr
from ntc.codec.targets import BitsTarget, QualityTarget, Target
from ntc.codec.textures import SourceTexture
from ntc.errors import InputError, TrainingCancelledError
from ntc.threads import PacedThreads

HEADER_BYTES, TEXTURE_HEADER_BYTES, DECODER_HEADER_BYTES = 3000, 800, 320
"""Of a file, at most, besides codes, tables, names and the grouping's parameters."""
TOLERANCE_DB = 0.1
"""A texture may be better than asked for by as much; its words are then left as they are."""
CORRECTIONS = 4
"""Encodings of a texture again, at most, until it is as good as asked for and hardly better."""
SLOPES = (0.4, 2.5)
"""dB that come for each dB that the rate curve is asked for, at least and at most."""
EXACT_DB = 99.0
"""Stands for the PSNR of a texture that is exact."""
ROUNDING_ERROR = 1.0 / 12.0
"""Mean square error of rounding to 8 bits, in steps squared, which rate curves leave out."""
LEAST_ERROR = 1e-3
"""Mean square error in 8-bit steps squared: rate curves are not asked for less."""
SIZE_LADDER = ((1, 2, 3, 4), (5, 6, 8, 10), (12, 14, LARGEST_WORDS))
"""Sizes of codes that are compared before four are chosen."""
SET_SIZE_LADDER = ((1, 2, 4, 6), (8, 10, 12, 16), (20, 26, LARGEST_SET_WORDS))
"""Those of material sets."""
LOST_SHARE = 0.5
"""Of the error asked for, at most: what coefficients stand for that the tables leave out. Most of it would get no bits."""
NEARLY = 0.9
"""Of the largest size that was chosen: where a texture needs more on average, that becomes the largest of all."""
LEAST_PRICE = 0.02
"""Of a word, as a share of the error asked for: textures that no size makes good enough count no more."""


@dataclass(frozen=True, eq=False)
class _Try:
    """A texture encoded once."""

    asked_db: float
    """What its rate curve was asked for."""
    texture: BlockTexture

    @property
    def psnr_db(self) -> float:
        return min(self.texture.psnr_db or 0.0, EXACT_DB)


@dataclass(frozen=True, eq=False)
class _Member:
    """A texture that is encoded until it is good enough."""

    source: SourceTexture
    fitted: FittedGroup
    curve: RateCurve
    config: BlockConfig

    def encode(self, asked_db: float, quantizer: TrellisQuantizer) -> _Try:
        """Encode in the words at which the rate curve promises `asked_db`."""
        words = self.curve.at(price_at_error(self.curve, _curve_error(asked_db)))[0]
        fitted, part = self.fitted, (self.source, words)
        return _Try(asked_db, encode_member(part, fitted.group, fitted.decoder, self.config, quantizer))

    def correct(self, first: _Try, target_db: float, quantizer: TrellisQuantizer) -> _Try:
        """The encoding of the fewest words that is at least as good as asked for; where there is none, the best."""
        tries, best = [first], first
        for _ in range(CORRECTIONS):
            if good_enough(tries[-1].psnr_db, target_db):
                break
            found = self.encode(_next_asked(tries, target_db + 0.5 * TOLERANCE_DB), quantizer)
            if len(found.texture.words) == len(tries[-1].texture.words):
                # Codes have no size between, or none beyond.
                break
            tries.append(found)
            best = _better(best, found, target_db)
        return best


def _encoded_once_more(part: tuple[_Member, _Try | None], target_db: float, quantizer: TrellisQuantizer) -> _Try:
    """A texture encoded for the first time, or corrected."""
    member, before = part
    return member.encode(target_db, quantizer) if before is None else member.correct(before, target_db, quantizer)


def good_enough(psnr_db: float, target_db: float) -> bool:
    """Whether a texture is as good as asked for, and hardly better."""
    return target_db <= psnr_db <= target_db + TOLERANCE_DB


class _Progress:
    """Reports after each of so many textures."""

    def __init__(self, report: BlockProgressListener | None, textures: int) -> None:
        self._report, self._textures, self._began = report, textures, time.monotonic()

    def tell(self, number: int, done: Mapping[int, _Try], work: BlockWork) -> None:
        """`number` textures are through this `work`; `done` are all that are encoded."""
        if self._report is None:
            return
        summary = PsnrSummary.of([each.texture.psnr_db or 0.0 for each in done.values()])
        left = (time.monotonic() - self._began) * (self._textures - number) / number
        self._report(BlockProgress(number, self._textures, summary.of_mean_mse_db if summary else 0.0, left, work))


def _better(one: _Try, other: _Try, target_db: float) -> _Try:
    if min(one.psnr_db, other.psnr_db) < target_db:
        return max(one, other, key=lambda each: each.psnr_db)
    return min(one, other, key=lambda each: len(each.texture.words))


def _next_asked(tries: Sequence[_Try], goal_db: float) -> float:
    """What to ask the rate curve for next, by the secant through the last two encodings."""
    last, slope = tries[-1], 1.0
    if len(tries) > 1 and last.asked_db != tries[-2].asked_db:
        slope = (last.psnr_db - tries[-2].psnr_db) / (last.asked_db - tries[-2].asked_db)
    return last.asked_db + (goal_db - last.psnr_db) / min(max(slope, SLOPES[0]), SLOPES[1])


def _curve_error(psnr_db: float) -> float:
    """Mean squared error in units of values in [0, 1], before rounding to 8 bits, of a PSNR."""
    return max(mse_of_psnr(psnr_db) - ROUNDING_ERROR, LEAST_ERROR) / 255.0**2


@dataclass(frozen=True, eq=False)
class _Prospect:
    """What a texture takes under tables of all coefficients."""

    curve: RateCurve
    """Of all sizes on the ladder."""
    energies: NDArray[np.float32]
    """[coefficients]: what each stands for, as RateCurve's errors."""

    def coefficients(self, error: float) -> int:
        """Coefficients without which the error would be noticeably more than `error`."""
        tails = np.cumsum(self.energies[::-1])[::-1]
        return int((tails > LOST_SHARE * error).sum())


def _prospects(
    textures: Sequence[SourceTexture], fitted: Sequence[FittedGroup], config: BlockConfig, seed: int
) -> list[_Prospect]:
    """Those of all textures, group by group."""
    ladder = SET_SIZE_LADDER if config.has_sets else SIZE_LADDER
    steps = [replace(config, block_words=step) for step in ladder]
    sizes, found = tuple(size for step in ladder for size in step), []
    for each in fitted:
        for sample in sample_textures([textures[index] for index in each.members], config, seed):
            errors = np.concatenate([rate_curve(sample, each.decoder, step).errors for step in steps], axis=1)
            curve = RateCurve(errors, sizes, sample.block_count)
            found.append(_Prospect(curve, coefficient_energies(sample, each.decoder, config)))
    return found


def config_for_quality(
    textures: Sequence[SourceTexture],
    grouping: Grouping,
    target_db: float,
    levels: int | None,
    seed: int,
    cancelled: CancelQuestion | None = None,
) -> BlockConfig:
    """Settings whose sizes of codes take the least words where each texture is to reach `target_db`."""
    known = texture_set(textures, grouping.stored_decoders, levels)
    first = config_for_words(known.largest_words, known)
    if known.groups:
        first = replace(first, coefficients=first.block_values)
    check_textures(textures, grouping, first)
    fitted = fitted_groups(textures, grouping, first, seed, cancelled)
    prospects, error = _prospects(textures, fitted, first, seed), _curve_error(target_db)
    curves = [each.curve for each in prospects]
    prices = [price_at_error(curve, error) for curve in curves]
    needed = [curve.at(price)[0] for curve, price in zip(curves, prices, strict=True)]
    sizes = best_block_words(curves, [max(price, LEAST_PRICE * error) for price in prices], LARGEST_SIZES)
    # The largest, for textures that come near to it.
    if max(needed) > NEARLY * sizes[-1]:
        sizes = (*sizes[:-1], known.largest_words)
    found = replace(config_for_words(max(needed), known), block_words=sizes)
    blocks = sum(curve.block_count for curve in curves)
    words = sum(need * curve.block_count for need, curve in zip(needed, curves, strict=True)) / blocks
    if known.groups:
        coefficients = max(each.coefficients(error) for each in prospects)
        found = replace(found, coefficients=min(max(coefficients, FEWEST_COEFFICIENTS), first.coefficients))
    return replace(found, mean_words=words)


def encode_to_quality(
    textures: Sequence[SourceTexture],
    grouping: Grouping,
    target_db: float,
    levels: int | None = None,
    seed: int = 0,
    report: BlockProgressListener | None = None,
    cancelled: CancelQuestion | None = None,
) -> Pack:
    """A pack of codec `block` in which each texture has at least `target_db` PSNR at mip 0 in as few words as possible; as much as the
    largest codes give where that is less.

    Raises InputError for textures and groups that cannot be encoded, TrainingCancelledError when `cancelled` says so before all
    are encoded. While they are corrected afterwards, the pack is returned as it stands.
    """
    config = config_for_quality(textures, grouping, target_db, levels, seed, cancelled)
    fitted, quantizer = fitted_groups(textures, grouping, config, seed, cancelled), TrellisQuantizer()
    members = {
        index: _Member(textures[index], each, curve, config)
        for each in fitted
        for index, curve in zip(each.members, each.curves, strict=True)
    }
    done, stopped = dict[int, _Try](), False
    encode = partial(_encoded_once_more, target_db=target_db, quantizer=quantizer)
    with PacedThreads() as paced:
        for work in get_args(BlockWork):
            due = [index for index in members if index not in done or not good_enough(done[index].psnr_db, target_db)]
            progress, sizes = _Progress(report, len(due)), [textures[index].pixels.size for index in due]
            found = () if stopped else paced.map(encode, [(members[index], done.get(index)) for index in due], sizes)
            for number, (index, each) in enumerate(zip(due, found, strict=not stopped), 1):
                done[index] = each
                progress.tell(number, done, work)
                stopped = cancelled is not None and cancelled()
                if stopped:
                    break
            if len(done) < len(textures):
                raise TrainingCancelledError
    encoded = tuple(done[index].texture for index in range(len(textures)))
    blocks = sum(member.curve.block_count for member in members.values())
    words = sum(len(texture.words) for texture in encoded) / blocks
    mean = min(max(words, config.block_words[0]), config.block_words[-1])
    record = encoding_record(config, seed)
    return Pack(replace(config, mean_words=mean), grouping, encoded, tuple(each.decoder for each in fitted), record)


def file_header_bytes(textures: Sequence[SourceTexture], grouping: Grouping) -> int:
    """Bytes of a pack's file at most that are neither codes nor tables."""
    texts = [json.dumps([texture.name, texture.category]) for texture in textures]
    texts.append(json.dumps(dict(grouping.parameters)))
    fixed = HEADER_BYTES + TEXTURE_HEADER_BYTES * len(textures) + DECODER_HEADER_BYTES * grouping.stored_decoders
    # Texts within a text: each quote and backslash may be written twice.
    return fixed + 2 * sum(map(len, texts))


def encode_to_target(
    textures: Sequence[SourceTexture],
    grouping: Grouping,
    target: Target,
    levels: int | None = None,
    seed: int = 0,
    report: BlockProgressListener | None = None,
    cancelled: CancelQuestion | None = None,
) -> Pack:
    """A pack of codec `block` of `textures`; `levels` as in BlockConfig. The same seed gives the same pack.

    Raises InputError for a target that is out of reach (but of a quality, what the largest codes give is encoded), for textures and
    groups that cannot be encoded; TrainingCancelledError when `cancelled` says so before all textures are encoded. Afterwards, while
    textures are corrected for a quality, the pack is returned as it stands.
    """
    if isinstance(target, QualityTarget):
        return encode_to_quality(textures, grouping, target.psnr_db, levels, seed, report, cancelled)
    known = texture_set(textures, grouping.stored_decoders, levels)
    if isinstance(target, BitsTarget):
        config = config_for_bits(target.bits, known, target.block_side, target.multiply_adds)
        return encode_blocks(textures, grouping, config, seed, report, cancelled)
    header = file_header_bytes(textures, grouping)
    try:
        config = config_for_bytes(1e6 * target.megabytes - header, known)
    except InputError as error:
        raise InputError(f"--size {target.megabytes:g}: {error}, and {header / 1e6:.3f} MB for names") from None
    return encode_blocks(textures, grouping, config, seed, report, cancelled, sharing=Sharing(worth=target.worth))
