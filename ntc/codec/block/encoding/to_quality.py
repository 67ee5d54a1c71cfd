"""Encoding in codec `block` to a quality: each texture takes the words that it needs.

The rate curve of a texture estimates the words for a PSNR, and a first encoding shows by how much it errs. Then the secant method
corrects the PSNR that the curve is asked for, until the texture is within TOLERANCE_DB above the target or CORRECTIONS are used up.
Sizes of codes are chosen before: tables are fitted with the largest settings, and the four sizes of a ladder that cost the fewest
words at the target are taken.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ntc.codec.block.config import LARGEST_SET_WORDS, LARGEST_SIZES, LARGEST_WORDS, BlockConfig
from ntc.codec.block.encoding.bit_allocation import ROUNDING_ERROR, RateCurve, best_block_words, price_at_error
from ntc.codec.block.encoding.blocks import sample_textures
from ntc.codec.block.encoding.groups import FittedGroup, encode_member, fitted_groups
from ntc.codec.block.encoding.rate import FEWEST_COEFFICIENTS, config_for_words, largest_words, texture_work
from ntc.codec.block.encoding.tables import coefficient_energies, rate_curve
from ntc.codec.block.model import BlockTexture
from ntc.codec.checks import check_textures
from ntc.codec.encoding import EncodingTask, texture_set
from ntc.codec.quality import mse_of_psnr
from ntc.codec.textures import SourceTexture

TOLERANCE_DB = 0.1
"""PSNR above the target up to which a texture is accepted."""
CORRECTIONS = 4
"""Most corrections of a texture."""
SLOPES = (0.4, 2.5)
"""Limits of the secant's slope: dB gained for each dB that the rate curve is asked for."""
EXACT_DB = 99.0
"""PSNR assumed of an exact texture."""
LEAST_ERROR = 1e-3
"""Mean square error in 8-bit steps squared: rate curves are not asked for less."""
SIZE_LADDER = ((1, 2, 3, 4), (5, 6, 8, 10), (12, 14, LARGEST_WORDS))
"""Sizes of codes of single textures from which four are chosen."""
SET_SIZE_LADDER = ((1, 2, 4, 6), (8, 10, 12, 16), (20, 26, LARGEST_SET_WORDS))
"""Sizes of codes of material sets."""
LOST_SHARE = 0.5
"""Largest share of the allowed error that comes from coefficients left out of the tables; most of them would get no bits."""
NEARLY = 0.9
"""Share of the largest chosen size: where a texture needs more on average, the largest possible size is added."""
LEAST_PRICE = 0.02
"""Least price of a word as a share of the allowed error, for textures that no size makes good enough."""


@dataclass(frozen=True, eq=False)
class Try:
    """One encoding of a texture."""

    asked_db: float
    """PSNR that the rate curve was asked for."""
    texture: BlockTexture

    @property
    def psnr_db(self) -> float:
        """PSNR in dB of mip 0, at most EXACT_DB."""
        return min(self.texture.psnr_db or 0.0, EXACT_DB)


@dataclass(frozen=True, eq=False)
class Member:
    """A texture that is encoded again until it reaches the target."""

    source: SourceTexture
    fitted: FittedGroup
    curve: RateCurve
    config: BlockConfig
    target_db: float
    worked: Callable[[float], None]
    """Callback for finished work, as of `encode_member`."""
    threads: int = 1

    def encode(self, asked_db: float) -> Try:
        """Encode in the words at which the rate curve promises `asked_db`."""
        words = self.curve.at(price_at_error(self.curve, _curve_error(asked_db)))[0]
        # The target is the quality of mip 0, and its words are searched: the mips per code stay.
        encoded = encode_member(
            self.source, words, self.fitted, self.config, self.worked, self.threads, may_split_mips=False
        )
        return Try(asked_db, encoded)

    def correct(self, first: Try) -> Try:
        """Return the encoding of the fewest words that reaches the target; where none does, the best. `worked` gets the work of
        CORRECTIONS encodings."""
        tries, best, left = [first], first, CORRECTIONS
        while left and not self.suits(tries[-1]):
            left -= 1
            encoded = self.encode(_next_asked(tries, self.target_db + 0.5 * TOLERANCE_DB))
            if len(encoded.texture.words) == len(tries[-1].texture.words):
                # Codes have no size between, or none beyond.
                break
            tries.append(encoded)
            best = _better(best, encoded, self.target_db)
        self.worked(left * texture_work(self.source.size, self.config))
        return best

    def suits(self, encoded: Try) -> bool:
        """Return whether an encoding reaches the target and exceeds it by at most TOLERANCE_DB."""
        return self.target_db <= encoded.psnr_db <= self.target_db + TOLERANCE_DB


def _better(one: Try, other: Try, target_db: float) -> Try:
    if min(one.psnr_db, other.psnr_db) < target_db:
        return max(one, other, key=lambda each: each.psnr_db)
    return min(one, other, key=lambda each: len(each.texture.words))


def _next_asked(tries: Sequence[Try], goal_db: float) -> float:
    """Return the PSNR to ask the rate curve for next, by the secant through the last two encodings."""
    last, slope = tries[-1], 1.0
    if len(tries) > 1 and last.asked_db != tries[-2].asked_db:
        slope = (last.psnr_db - tries[-2].psnr_db) / (last.asked_db - tries[-2].asked_db)
    return last.asked_db + (goal_db - last.psnr_db) / min(max(slope, SLOPES[0]), SLOPES[1])


def _curve_error(psnr_db: float) -> float:
    """Mean squared error in units of values in [0, 1], before rounding to 8 bits, of a PSNR."""
    return max(mse_of_psnr(psnr_db) - ROUNDING_ERROR, LEAST_ERROR) / 255.0**2


@dataclass(frozen=True, eq=False)
class _Prospect:
    """Estimates for a texture under tables of all coefficients."""

    curve: RateCurve
    """Rate curve over all sizes of the ladder."""
    energies: NDArray[np.float32]
    """[coefficients]: mean squared error without each coefficient, in the units of RateCurve."""

    def coefficients(self, error: float) -> int:
        """Return the number of coefficients that an encoding with error `error` needs."""
        tails = np.cumsum(self.energies[::-1])[::-1]
        return int((tails > LOST_SHARE * error).sum())


def _prospects(
    textures: Sequence[SourceTexture], fitted: Sequence[FittedGroup], config: BlockConfig, seed: int
) -> list[_Prospect]:
    """Return the estimates of all textures, group by group."""
    ladder = SET_SIZE_LADDER if config.has_sets else SIZE_LADDER
    steps = [replace(config, block_words=step) for step in ladder]
    sizes, prospects = tuple(size for step in ladder for size in step), []
    for each in fitted:
        for sample in sample_textures([textures[index] for index in each.members], config, seed):
            errors = np.concatenate([rate_curve(sample, each.decoder, step).errors for step in steps], axis=1)
            curve = RateCurve(errors, sizes, sample.block_count)
            prospects.append(_Prospect(curve, coefficient_energies(sample, each.decoder, config)))
    return prospects


def config_for_quality(task: EncodingTask, target_db: float, seed: int) -> BlockConfig:
    """Return the settings whose sizes of codes take the fewest words for each texture of the task to reach `target_db`."""
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
    settings = replace(config_for_words(max(needed), known), block_words=sizes)
    blocks = sum(curve.block_count for curve in curves)
    words = sum(need * curve.block_count for need, curve in zip(needed, curves, strict=True)) / blocks
    if known.groups:
        coefficients = max(each.coefficients(error) for each in prospects)
        settings = replace(settings, coefficients=min(max(coefficients, FEWEST_COEFFICIENTS), first.coefficients))
    return replace(settings, mean_words=words)


def with_mean_words(
    config: BlockConfig, fitted: Sequence[FittedGroup], textures: Sequence[BlockTexture]
) -> BlockConfig:
    """`config` with the words a block that `textures` took on average."""
    blocks = sum(curve.block_count for each in fitted for curve in each.curves)
    words = sum(len(texture.words) for texture in textures) / blocks
    return replace(config, mean_words=min(max(words, config.block_words[0]), config.block_words[-1]))
