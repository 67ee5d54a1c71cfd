"""Sharing out words among the blocks of a texture, and among textures, by what they are worth."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from ntc.codec.quality import psnr_of_mse

Array = NDArray[np.float32]
BISECTIONS = 40
BALANCE = 1.0
"""How textures share words: 0 makes the mean squared error of all texels least, 1 the mean PSNR of the textures greatest."""
BALANCE_ROUNDS = 6
SIZING_BLOCKS = 4000
"""Blocks that sizes of codes are chosen for, about."""
ROUNDING_ERROR = 1.0 / 12.0
"""Mean square error of rounding to 8 bits, in steps squared, which rate curves leave out."""
LEAST_ERROR = (0.25 / 255.0) ** 2
"""Mean squared error below which a texture is as good as exact: it asks for no more words."""


@dataclass(frozen=True)
class Sharing:
    """By what textures share words."""

    balance: float = BALANCE
    """An error is worth more in a texture that has few of them, by this power."""
    worth: tuple[float, ...] | None = None
    """What an error is worth in each texture, positive, in proportion; None: the same in all."""


DEFAULT_SHARING = Sharing()


@dataclass(frozen=True, eq=False)
class RateCurve:
    """What the words of a texture's blocks are worth."""

    errors: Array
    """[sampled blocks, sizes] float32: mean squared error of a block's values by size of its code."""
    block_words: tuple[int, ...]
    """Words by size."""
    block_count: int
    """Blocks of the texture."""

    def at(self, price: float) -> tuple[float, float]:
        """(words a block, mean squared error) where a word must lower a block's error by at least `price`."""
        sizes = sizes_at_price(self.errors, self.block_words, price)
        words = np.array(self.block_words, np.float64)[sizes].mean()
        return float(words), float(np.take_along_axis(self.errors, sizes[:, None], axis=1).mean())

    def psnr_at(self, words: float) -> float:
        """Return the PSNR in dB that is expected of `words` words a block, rounding to 8 bits counted."""
        sizes = sizes_within(self.errors, self.block_words, words)
        error = float(np.take_along_axis(self.errors, sizes[:, None], axis=1).mean())
        return psnr_of_mse(255.0**2 * error + ROUNDING_ERROR)


def sizes_at_price(errors: Array, block_words: Sequence[int], price: float) -> NDArray[np.int64]:
    """[blocks] int64 size classes with the least error plus `price` x words."""
    found: NDArray[np.int64] = (errors + np.float32(price) * np.array(block_words, np.float32)).argmin(1)
    return found


def sizes_within(errors: Array, block_words: Sequence[int], words: float) -> NDArray[np.int64]:
    """[blocks] int64 size classes with about the least sum of `errors` [blocks, sizes] whose mean is at most `words`.

    The smallest size for all where even that is more.
    """
    lengths = np.array(block_words, np.int64)
    low, high = _prices(errors)
    for _ in range(BISECTIONS):
        middle = (low * high) ** 0.5
        enough = lengths[sizes_at_price(errors, block_words, middle)].mean() <= words
        low, high = (low, middle) if enough else (middle, high)
    found, larger = (sizes_at_price(errors, block_words, price) for price in (high, low))
    # Blocks that are alike all change size at one price: as many of them as there are words left take the larger one.
    blocks = np.flatnonzero(larger > found)
    more = lengths[larger[blocks]] - lengths[found[blocks]]
    affordable = np.cumsum(more) <= words * len(errors) - lengths[found].sum()
    found[blocks[affordable]] = larger[blocks[affordable]]
    return found


def _prices(errors: Array) -> tuple[float, float]:
    """Prices of a word at which every block takes its largest size, and its smallest."""
    most = 2.0 * float(errors.max(initial=0.0)) + 1e-20
    return most * 1e-14, most


def share_words(curves: Sequence[RateCurve], words: float, sharing: Sharing = DEFAULT_SHARING) -> tuple[float, ...]:
    """Words a block for each texture, which come to `words` words in all where the sizes of codes allow that."""
    worth, balance = sharing.worth, sharing.balance
    blocks = np.array([curve.block_count for curve in curves], np.float64)
    texels_worth = np.ones(len(curves)) if worth is None else np.array(worth, np.float64) / np.mean(worth)
    weights, balances = texels_worth, np.ones(len(curves))
    found: tuple[float, ...] = ()
    rounds = BALANCE_ROUNDS if balance else 1
    for number in range(rounds):
        low, high = 1e-16, 16.0
        for _ in range(BISECTIONS):
            middle = (low * high) ** 0.5
            given = [curve.at(middle / weight) for curve, weight in zip(curves, weights, strict=True)]
            enough = float(np.array([each for each, _ in given]) @ blocks) <= words
            low, high = (low, middle) if enough else (middle, high)
        given = [curve.at(high / weight) for curve, weight in zip(curves, weights, strict=True)]
        least = np.array([each for each, _ in given])
        if number < rounds - 1:
            errors = np.array([max(error, LEAST_ERROR) for _, error in given])
            # Half of the way, for weights and errors answer each other.
            balances = np.sqrt(balances * errors**-balance)
            weights = texels_worth * balances
            continue
        more = np.array([curve.at(low / weight)[0] for curve, weight in zip(curves, weights, strict=True)]) - least
        # Textures whose blocks are alike change at one price: what is left is shared out in proportion.
        share = (words - float(least @ blocks)) / max(float(more @ blocks), 1e-9)
        found = tuple((least + min(max(share, 0.0), 1.0) * more).tolist())
    return found


def price_at_error(curve: RateCurve, error: float) -> float:
    """The highest price of a word at which a texture's mean squared error is at most `error`; where even the largest codes have
    more, the price at which all blocks take them."""
    low, high = _prices(curve.errors)
    for _ in range(BISECTIONS):
        middle = (low * high) ** 0.5
        low, high = (middle, high) if curve.at(middle)[1] <= error else (low, middle)
    return low


def best_block_words(curves: Sequence[RateCurve], prices: Sequence[float], count: int) -> tuple[int, ...]:
    """The at most `count` sizes among those of `curves`, which have the same, that take the least words for what textures gain at
    their `prices` of a word."""
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
