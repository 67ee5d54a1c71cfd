"""Bit allocation: words for the blocks of a texture, and for textures.

The classical problem of rate and distortion, solved by a Lagrange multiplier (Shoham and Gersho, IEEE Trans. ASSP 36(9), 1988): at a
price of a word, each block takes the size of code with the least error plus price times words. A bisection over the price meets the
budget. Among textures the same price counts, divided by each texture's weight. With a balance of 1 the weights are the inverse errors,
which maximises the mean PSNR; they are iterated, because weights and errors depend on each other.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from ntc.codec.quality import psnr_of_mse

Array = NDArray[np.float32]
BISECTIONS = 40
BALANCE = 1.0
"""Default balance: the mean PSNR of the textures is maximised."""
BALANCE_ROUNDS = 6
SIZING_BLOCKS = 4000
"""Approximate number of blocks by which sizes of codes are chosen."""
ROUNDING_ERROR = 1.0 / 12.0
"""Mean square error of rounding to 8 bits, in steps squared. Rate curves leave it out."""
LEAST_ERROR = (0.25 / 255.0) ** 2
"""Mean squared error at which a texture counts as exact and takes no more words."""


@dataclass(frozen=True)
class TextureWeights:
    """Weights of the bit allocation among textures."""

    balance: float = BALANCE
    """Power of the inverse error in a texture's weight: 0 minimises the mean squared error, 1 maximises the mean PSNR."""
    given: tuple[float, ...] | None = None
    """Weight of an error in each texture, positive; only ratios matter. None: the same in all."""


EQUAL_WEIGHTS = TextureWeights()


@dataclass(frozen=True, eq=False)
class RateCurve:
    """Errors of a texture by the words of its codes, from a sample of its blocks."""

    errors: Array
    """[sampled blocks, sizes] float32: mean squared error of a block's values by size of its code."""
    block_words: tuple[int, ...]
    """Words by size."""
    block_count: int
    """Blocks of the texture."""

    def at(self, price: float) -> tuple[float, float]:
        """Return (words per block, mean squared error) where a word must lower a block's error by at least `price`."""
        sizes = sizes_at_price(self.errors, self.block_words, price)
        words = np.array(self.block_words, np.float64)[sizes].mean()
        return float(words), float(np.take_along_axis(self.errors, sizes[:, None], axis=1).mean())

    def psnr_at(self, words: float) -> float:
        """Return the PSNR in dB that is expected of `words` words a block, rounding to 8 bits counted."""
        sizes = sizes_within(self.errors, self.block_words, words)
        error = float(np.take_along_axis(self.errors, sizes[:, None], axis=1).mean())
        return psnr_of_mse(255.0**2 * error + ROUNDING_ERROR)


def sizes_at_price(errors: Array, block_words: Sequence[int], price: float) -> NDArray[np.int64]:
    """Return [blocks] int64 size classes with the least error plus `price` x words."""
    sizes: NDArray[np.int64] = (errors + np.float32(price) * np.array(block_words, np.float32)).argmin(1)
    return sizes


def sizes_within(errors: Array, block_words: Sequence[int], words: float) -> NDArray[np.int64]:
    """Return [blocks] int64 size classes with about the least sum of `errors` [blocks, sizes] whose mean is at most `words`.

    The smallest size for all where even that is more.
    """
    lengths = np.array(block_words, np.int64)
    low, high = _prices(errors)
    for _ in range(BISECTIONS):
        middle = (low * high) ** 0.5
        enough = lengths[sizes_at_price(errors, block_words, middle)].mean() <= words
        low, high = (low, middle) if enough else (middle, high)
    sizes, larger = (sizes_at_price(errors, block_words, price) for price in (high, low))
    # Equal blocks change size at one price: as many of them take the larger size as there are words left.
    blocks = np.flatnonzero(larger > sizes)
    more = lengths[larger[blocks]] - lengths[sizes[blocks]]
    affordable = np.cumsum(more) <= words * len(errors) - lengths[sizes].sum()
    sizes[blocks[affordable]] = larger[blocks[affordable]]
    return sizes


def _prices(errors: Array) -> tuple[float, float]:
    """Return the prices of a word at which every block takes its largest size, and its smallest."""
    most = 2.0 * float(errors.max(initial=0.0)) + 1e-20
    return most * 1e-14, most


def allocate_words(
    curves: Sequence[RateCurve], words: float, weighting: TextureWeights = EQUAL_WEIGHTS
) -> tuple[float, ...]:
    """Return the words per block of each texture, `words` words in all where the sizes of codes allow that."""
    given, balance = weighting.given, weighting.balance
    blocks = np.array([curve.block_count for curve in curves], np.float64)
    given_weights = np.ones(len(curves)) if given is None else np.array(given, np.float64) / np.mean(given)
    weights, balances = given_weights, np.ones(len(curves))
    allocated: tuple[float, ...] = ()
    rounds = BALANCE_ROUNDS if balance else 1
    for number in range(rounds):
        low, high = 1e-16, 16.0
        for _ in range(BISECTIONS):
            middle = (low * high) ** 0.5
            points = [curve.at(middle / weight) for curve, weight in zip(curves, weights, strict=True)]
            enough = float(np.array([each for each, _ in points]) @ blocks) <= words
            low, high = (low, middle) if enough else (middle, high)
        points = [curve.at(high / weight) for curve, weight in zip(curves, weights, strict=True)]
        least = np.array([each for each, _ in points])
        if number < rounds - 1:
            errors = np.array([max(error, LEAST_ERROR) for _, error in points])
            # The geometric mean of old and new weights: weights and errors depend on each other.
            balances = np.sqrt(balances * errors**-balance)
            weights = given_weights * balances
            continue
        more = np.array([curve.at(low / weight)[0] for curve, weight in zip(curves, weights, strict=True)]) - least
        # Textures of equal blocks change at one price: the remaining words are shared in proportion.
        share = (words - float(least @ blocks)) / max(float(more @ blocks), 1e-9)
        allocated = tuple((least + min(max(share, 0.0), 1.0) * more).tolist())
    return allocated


def price_at_error(curve: RateCurve, error: float) -> float:
    """Return the highest price of a word at which a texture's mean squared error is at most `error`; where even the largest codes have
    more, the price at which all blocks take them."""
    low, high = _prices(curve.errors)
    for _ in range(BISECTIONS):
        middle = (low * high) ** 0.5
        low, high = (middle, high) if curve.at(middle)[1] <= error else (low, middle)
    return low


def best_block_words(curves: Sequence[RateCurve], prices: Sequence[float], count: int) -> tuple[int, ...]:
    """Return at most `count` of the sizes of `curves`, which all have the same ones: those of
    least cost, which is words plus errors over `prices` in all textures."""
    words = np.array(curves[0].block_words, np.float64)
    each = max(1, SIZING_BLOCKS // len(curves))
    parts = []
    for curve, price in zip(curves, prices, strict=True):
        step = -(-len(curve.errors) // each)
        costs = words + curve.errors[::step].astype(np.float64) / price
        parts.append(costs * (curve.block_count / len(costs)))
    costs = np.concatenate(parts)
    chosen = min(combinations(range(len(words)), count), key=lambda sizes: float(costs[:, sizes].min(1).sum()))
    return tuple(curves[0].block_words[size] for size in chosen)
