"""The choice of mips per code for a texture.

A code of mip 0 also decodes to derived mips, as averages of its rows of the basis. Mips average colours in linear light, so textures
of strong contrast have derived mips that are worse than mip 0. Such a texture may be encoded again with half the mips per code, in
as many bytes: coarse mips then have codes, and mip 0 has fewer bits. The layout whose mips fall less short of mip 0 on average wins.
Whether a second encoding is worthwhile is first estimated from the error of averages alone (`is_doubtful`).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from ntc.codec.block.config import BlockConfig
from ntc.codec.block.encoding.blocks import PreparedTexture, compared_blocks
from ntc.codec.block.model import BlockDecoder, BlockTexture
from ntc.codec.block.reference import block_values, texture_codes
from ntc.codec.block.storage import BlockCodes
from ntc.codec.latents import latent_cell_count, texture_levels
from ntc.codec.quality import psnr_of_mse

CodeMips = Literal[1, 2]
SECOND_WORDS = 1.3
"""Words per block of mip 1 with separate codes, relative to the mean of all mips."""
LEAST_GAIN_DB = 0.1
"""Least gain in mean PSNR over mips that justifies fewer mips per code, which read more codes."""
LARGEST_LOSS_DB = 1.5
"""Largest loss in PSNR of mip 0 for fewer mips per code."""
MOST_DB = 50.0
"""PSNR at which a mip counts as exact."""
LEAST_SHORTFALL_DB = 0.5
"""Mean shortfall of mips 0 to 3 below mip 0, from which on fewer mips per code are tried: mip 0 loses about as much."""


@dataclass(frozen=True)
class MipQuality:
    """PSNR in dB of the first mips of an encoded texture."""

    psnr_db: tuple[float, ...]

    @classmethod
    def of(
        cls, texture: BlockTexture, prepared: PreparedTexture, decoder: BlockDecoder, config: BlockConfig
    ) -> "MipQuality":
        """Return the quality of samples of `texture`, the encoding of `prepared`. Alpha of a mask is left out."""
        places = texture.places(config)
        channels = [place for place in places if prepared.axes.cutoff is None or place != config.alpha]
        psnrs = []
        for number, truth in enumerate(prepared.compared):
            level, stored = texture_levels(texture, config)[number], texture_codes(texture, config, number)
            rows = compared_blocks(level.cells)
            part = BlockCodes(stored.codes[rows], stored.sizes[rows])
            values = block_values(texture, part, decoder, config, level.mip_of_cell)[..., channels]
            shown = np.rint(np.clip(values, 0.0, 1.0) * 255.0)
            psnrs.append(psnr_of_mse(float(np.square(shown - truth[..., channels]).mean())))
        return cls(tuple(psnrs))

    def fewer_mips(self, config: BlockConfig) -> CodeMips | None:
        """Return how many mips a code may have where derived ones are below mip 0: half as many; None where they are hardly."""
        if config.mips == 1 or _shortfall(self.psnr_db[0], self.psnr_db) < LEAST_SHORTFALL_DB:
            return None
        return 2 if config.mips == 4 else 1

    def is_better(self, other: "MipQuality") -> bool:
        """Return whether mips of this quality, in place of those of `other`, pay for fewer mips per code."""
        most = other.psnr_db[0]
        return _shortfall(most, other.psnr_db) - _shortfall(most, self.psnr_db) > LEAST_GAIN_DB


def loses_much(psnr_db: float, others_db: float) -> bool:
    """Return whether a mip 0 of `psnr_db` is too poor beside one of `others_db`."""
    return psnr_db <= min(others_db, MOST_DB) - LARGEST_LOSS_DB


def _shortfall(psnr_db: float, mips_db: Sequence[float]) -> float:
    """Return by how many dB mips are below `psnr_db` on average, those that are not counting 0, and none more than MOST_DB."""
    most = min(psnr_db, MOST_DB)
    return most - float(np.mean(np.minimum(mips_db, most)))


def is_doubtful(psnr_db: float, derived_errors: Sequence[float]) -> bool:
    """Return whether fewer mips per code may pay for a texture with a mip 0 of `psnr_db`, by what averages miss. Codes of
    two colours come nearer than these."""
    derived_db = [psnr_of_mse(error) for error in derived_errors]
    return _shortfall(psnr_db, [psnr_db, *derived_db]) > 0.5 * LEAST_SHORTFALL_DB


def coarse_words(words: float, least: float, config: BlockConfig) -> tuple[float, ...]:
    """Return the words a block at least of mip 1, and of coarser mips, in a texture with fewer mips per code: coarse mips have more
    detail in a texel, and few blocks."""
    return max(least, SECOND_WORDS * words), float(config.block_words[-1])


def equal_words(words: float, size: tuple[int, int], code_mips: int | None, config: BlockConfig) -> float:
    """Return the words a block that take as many bytes with `code_mips` mips per code as `words` with those of `config`."""
    return words * latent_cell_count(*size, config) / latent_cell_count(*size, config, code_mips)
