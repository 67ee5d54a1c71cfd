"""Encoding in codec `block` to a quality: each texture takes the words that it needs."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ntc.codec.block.config import LARGEST_SET_WORDS, LARGEST_SIZES, LARGEST_WORDS, BlockConfig
from ntc.codec.block.encoding.blocks import sample_textures
from ntc.codec.block.encoding.groups import FittedGroup, encode_member, fitted_groups
from ntc.codec.block.encoding.rate import FEWEST_COEFFICIENTS, config_for_words, largest_words, texture_work
from ntc.codec.block.encoding.sharing import ROUNDING_ERROR, RateCurve, best_block_words, price_at_error
from ntc.codec.block.encoding.tables import coefficient_energies, rate_curve
from ntc.codec.block.model import BlockTexture
from ntc.codec.checks import check_textures
from ntc.codec.encoding import EncodingTask, texture_set
from ntc.codec.quality import mse_of_psnr
from ntc.codec.textures import SourceTexture

TOLERANCE_DB = 0.1
"""A texture may be better than asked for by as much; its words are then left as they are."""
CORRECTIONS = 4
"""Encodings of a texture again, at most, until it is as good as asked for and hardly better."""
SLOPES = (0.4, 2.5)
"""dB that come for each dB that the rate curve is asked for, at least and at most."""
EXACT_DB = 99.0
"""Stands for the PSNR of a texture that is exact."""
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
class Try:
    """A texture encoded once."""

    asked_db: float
    """What its rate curve was asked for."""
    texture: BlockTexture

    @property
    def psnr_db(self) -> float:
        """PSNR in dB of mip 0, at most EXACT_DB."""
        return min(self.texture.psnr_db or 0.0, EXACT_DB)


@dataclass(frozen=True, eq=False)
class Member:
    """A texture that is encoded until it is good enough."""

    source: SourceTexture
    fitted: FittedGroup
    curve: RateCurve
    config: BlockConfig
    target_db: float
    worked: Callable[[float], None]
    """As `encode_member` takes it."""
    threads: int = 1

    def encode(self, asked_db: float) -> Try:
        """Encode in the words at which the rate curve promises `asked_db`."""
        words = self.curve.at(price_at_error(self.curve, _curve_error(asked_db)))[0]
        # The quality of mip 0 is asked for, and the words that it takes are searched: the layout stays.
        found = encode_member(
            self.source, words, self.fitted, self.config, self.worked, self.threads, has_own_codes=False
        )
        return Try(asked_db, found)

    def correct(self, first: Try) -> Try:
        """The encoding of the fewest words that is at least as good as asked for; where there is none, the best. `worked` is told the
        work of CORRECTIONS encodings."""
        tries, best, left = [first], first, CORRECTIONS
        while left and not self.suits(tries[-1]):
            left -= 1
            found = self.encode(_next_asked(tries, self.target_db + 0.5 * TOLERANCE_DB))
            if len(found.texture.words) == len(tries[-1].texture.words):
                # Codes have no size between, or none beyond.
                break
            tries.append(found)
            best = _better(best, found, self.target_db)
        self.worked(left * texture_work(self.source.size, self.config))
        return best

    def suits(self, found: Try) -> bool:
        """Whether `found` is as good as asked for, and hardly better."""
        return self.target_db <= found.psnr_db <= self.target_db + TOLERANCE_DB


def _better(one: Try, other: Try, target_db: float) -> Try:
    if min(one.psnr_db, other.psnr_db) < target_db:
        return max(one, other, key=lambda each: each.psnr_db)
    return min(one, other, key=lambda each: len(each.texture.words))


def _next_asked(tries: Sequence[Try], goal_db: float) -> float:
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


def config_for_quality(task: EncodingTask, target_db: float, seed: int) -> BlockConfig:
    """Settings whose sizes of codes take the least words where each texture of the task is to reach `target_db`."""
    textures, grouping = task.textures, task.grouping
    known = texture_set(textures, grouping.stored_decoders, task.settings.levels)
    first = config_for_words(largest_words(known), known)
    if known.groups:
        first = replace(first, coefficients=first.block_values)
    check_textures(textures, grouping, first)
    fitted = fitted_groups(textures, grouping, task.groups, first, seed, task.interruption)
    prospects, error = _prospects(textures, fitted, first, seed), _curve_error(target_db)
    curves = [each.curve for each in prospects]
    prices = [price_at_error(curve, error) for curve in curves]
    needed = [curve.at(price)[0] for curve, price in zip(curves, prices, strict=True)]
    sizes = best_block_words(curves, [max(price, LEAST_PRICE * error) for price in prices], LARGEST_SIZES)
    # The largest, for textures that come near to it.
    if max(needed) > NEARLY * sizes[-1]:
        sizes = (*sizes[:-1], largest_words(known))
    found = replace(config_for_words(max(needed), known), block_words=sizes)
    blocks = sum(curve.block_count for curve in curves)
    words = sum(need * curve.block_count for need, curve in zip(needed, curves, strict=True)) / blocks
    if known.groups:
        coefficients = max(each.coefficients(error) for each in prospects)
        found = replace(found, coefficients=min(max(coefficients, FEWEST_COEFFICIENTS), first.coefficients))
    return replace(found, mean_words=words)


def with_mean_words(
    config: BlockConfig, fitted: Sequence[FittedGroup], textures: Sequence[BlockTexture]
) -> BlockConfig:
    """`config` with the words a block that `textures` took on average."""
    blocks = sum(curve.block_count for each in fitted for curve in each.curves)
    words = sum(len(texture.words) for texture in textures) / blocks
    return replace(config, mean_words=min(max(words, config.block_words[0]), config.block_words[-1]))
