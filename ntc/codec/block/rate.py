"""The settings of codec `block` whose packs come nearest to a number of bits a texel."""

from collections.abc import Sequence
from dataclasses import replace

from ntc.codec.block.config import LARGEST_DEPTH, BlockCodecConfig
from ntc.codec.latents import latent_levels
from ntc.errors import InputError

LARGEST_WORDS = 16
COEFFICIENTS_PER_WORD = 24
"""Rows of the basis for each word of a code: more are hardly ever given a bit."""
TABLE_SHARE = 0.15
"""Of all bits: tables are made smaller where textures are so few that they would take more."""
FEWEST_COEFFICIENTS, FEWEST_MODES = 16, 4

Sizes = Sequence[tuple[int, int]]


def bits_per_texel(sizes: Sizes, groups: int, config: BlockCodecConfig) -> float:
    """Stored bits (codes of all mips, means, axes, tables of `groups` decoders) per texel of all encoded mips of textures of these
    (width, height)."""
    channels, bits, texels = config.output_channels, groups * _table_bits(config), 0
    for width, height in sizes:
        levels = latent_levels(width, height, config)
        bits += 8 * config.cell_bytes * sum(level.cells for level in levels) + 32 * channels * (channels + 1)
        texels += sum(level.texel_width * level.texel_height for level in levels)
    return bits / max(1, texels)


def _table_bits(config: BlockCodecConfig) -> int:
    basis = config.coefficients * (8 * config.block_values + 32)
    return basis + 16 * config.modes * config.coefficients


def _with_words(words: int, sizes: Sizes, groups: int, config: BlockCodecConfig) -> BlockCodecConfig:
    """Codes of so many words, and tables that are in proportion."""
    most = min(config.block_values, COEFFICIENTS_PER_WORD * words)
    found = replace(config, block_words=words, coefficients=most)
    texels = sum(width * height for width, height in sizes)
    largest = TABLE_SHARE * found.bits_per_texel * texels / max(1, groups)
    while _table_bits(found) > largest:
        # Of each kind in turns, as long as a code's bits find coefficients that take them.
        enough = max(FEWEST_COEFFICIENTS, -(-found.coefficient_bits // LARGEST_DEPTH) * 2)
        if found.coefficients * 3 // 4 >= enough:
            found = replace(found, coefficients=found.coefficients * 3 // 4)
        elif found.modes > FEWEST_MODES:
            found = replace(found, modes=found.modes // 2)
        else:
            break
    return found


def config_for_bits(bits: float, sizes: Sizes, groups: int, channels: int, levels: int | None) -> BlockCodecConfig:
    """The settings with blocks of 8x8 texels whose `bits_per_texel` comes nearest to `bits`.

    Raises InputError for bits that are not above 0, or beyond what the largest codes take.
    """
    plain = BlockCodecConfig(output_channels=channels, levels=levels, coefficients=1)
    plain = replace(plain, coefficients=min(96, plain.block_values))
    found = [_with_words(words, sizes, groups, plain) for words in range(1, LARGEST_WORDS + 1)]
    reached = [bits_per_texel(sizes, groups, config) for config in found]
    if not 0.0 < bits <= max(reached):
        raise InputError(
            f"--bits {bits:g}: set it above 0 and up to {max(reached):.2f}, what the largest codes take here"
        )
    return min(zip(found, reached, strict=True), key=lambda pair: abs(pair[1] - bits))[0]
