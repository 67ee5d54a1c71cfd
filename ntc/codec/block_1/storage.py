"""How the codes of a texture lie one after the other.

Level after level: where blocks may take several sizes, a directory, then the codes of the level's blocks, row by row, without gaps.
The directory has two words for each run of DIRECTORY_RUN blocks: where the run's first code begins, in words from the level's first
word, and the size classes of its blocks, two bits each, the first block's lowest. So any block is found by one look at the directory.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ntc.codec.block_1.config import DIRECTORY_RUN, BlockConfig
from ntc.codec.gpu import StoredRows
from ntc.codec.latents import LatentLevel

Words = NDArray[np.uint32]


class BlockCodes(NamedTuple):
    """Codes of blocks, taken out of what is stored."""

    codes: Words
    """[blocks, words of the largest code] uint32; what lies beyond a block's size is not its own."""
    sizes: NDArray[np.int64]
    """[blocks] size class: which of `BlockConfig.block_words`."""


def directory_words(blocks: int, config: BlockConfig) -> int:
    """Words of the directory of a level of so many blocks."""
    return 2 * -(-blocks // DIRECTORY_RUN) if len(config.block_words) > 1 else 0


def _level_sizes(words: Words, blocks: int, config: BlockConfig) -> NDArray[np.int64]:
    """[blocks] size classes of a level whose stored words begin `words`. Raises ValueError where they end too early."""
    directory = directory_words(blocks, config)
    # Before anything of the size of the level is allocated.
    if len(words) < directory + blocks * config.block_words[0]:
        raise ValueError(f"latents: {len(words)} words are too few for a level of {blocks} blocks")
    if not directory:
        return np.zeros(blocks, np.int64)
    classes = words[1:directory:2, None] >> (2 * np.arange(DIRECTORY_RUN, dtype=np.uint32)) & np.uint32(3)
    return classes.reshape(-1)[:blocks].astype(np.int64)


def level_rows(words: Words, levels: Sequence[LatentLevel], config: BlockConfig) -> tuple[StoredRows, ...]:
    """Where each of `levels` lies in a texture's stored `words` [words] uint32.

    Raises ValueError for words that no encoder writes: wrong places in a directory, unknown classes, wrong length.
    """
    found, first = list[StoredRows](), 0
    lengths_of = np.array(config.block_words, np.int64)
    for level in levels:
        part = words[first:]
        sizes = _level_sizes(part, level.cells, config)
        if sizes.max(initial=0) >= len(config.block_words):
            raise ValueError("latents: a directory names a size of codes that the codec does not have")
        lengths, directory = lengths_of[sizes], directory_words(level.cells, config)
        begins = directory + np.cumsum(lengths) - lengths
        if directory and not np.array_equal(part[:directory:2], begins[::DIRECTORY_RUN]):
            raise ValueError("latents: a directory does not name the places where codes begin")
        found.append(StoredRows(first, directory + int(lengths.sum())))
        first += found[-1].rows
    if first != len(words):
        raise ValueError(f"latents: {len(words)} words, not the {first} that their directories tell of")
    return tuple(found)


def level_codes(words: Words, level: LatentLevel, config: BlockConfig) -> BlockCodes:
    """The codes of all blocks of a level; `words` begin with the level's directory."""
    sizes = _level_sizes(words, level.cells, config)
    lengths = np.array(config.block_words, np.int64)[sizes]
    begins = directory_words(level.cells, config) + np.cumsum(lengths) - lengths
    # Beyond the last code nothing is read that matters, but it must be there.
    padded = np.concatenate([words, np.zeros(config.block_words[-1], np.uint32)])
    return BlockCodes(padded[begins[:, None] + np.arange(config.block_words[-1])], sizes)
