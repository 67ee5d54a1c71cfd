"""The settings of codec `block` for a target: a bitrate, a file size, or a quality.

Bits count everything that is stored: codes, directories, means, axes and tables. Tables and directories depend on the settings, and
the settings on the words that they leave for codes. A bisection over the mean words per code settles this. Sizes of codes, and the
numbers of coefficients and modes, grow with the mean; tables shrink where textures are so few that they would take too large a share.
"""

import math
from dataclasses import replace
from typing import Literal

from ntc.codec.block.config import (
    FEWEST_MODES,
    LARGEST_SET_MODES,
    LARGEST_SET_WORDS,
    LARGEST_WORDS,
    BlockConfig,
)
from ntc.codec.block.storage import DIRECTORY_RUN
from ntc.codec.block.trellis import LARGEST_DEPTH
from ntc.codec.block.universal import BANDS, FINE_BLOCKS, MOST_SCALED_GROUPS, UNIVERSAL_CONFIG, set_config
from ntc.codec.encoding import BitsTarget, Sizes, SizeTarget, Target, TextureSet, common_channels
from ntc.codec.latents import latent_cell_count, latent_levels
from ntc.codec.maps import BASE_ALONE, is_material
from ntc.errors import InputError

SIZE_RATIOS = (0.5, 0.9, 1.35, 2.1)
"""Sizes of codes relative to the mean, as far apart as the needs of blocks are."""
WHOLE_WORDS = 0.1
"""Blocks of 4x4 texels take codes of one size where the mean is as near to a whole number of words: a directory costs 0.25 bits a
texel there."""
COEFFICIENTS, COEFFICIENTS_PER_WORD = 24, 36
"""Rows of the basis, and for each word of a code: more are hardly ever given a bit."""
MODES = 32
TABLE_SHARE = 0.25
"""Largest share of the codes' bits that tables take: they are made smaller where textures are few."""
FEWEST_COEFFICIENTS = 16
SETTLING_ROUNDS = 24
SAMPLED_BLOCKS = 24_000
"""Blocks that a group's tables are fitted to."""


def largest_words(textures: TextureSet) -> int:
    """Return the largest code of a block in words."""
    return LARGEST_WORDS if textures.maps == BASE_ALONE else LARGEST_SET_WORDS


def side_bits(textures: TextureSet, config: BlockConfig) -> int:
    """Return the stored bits besides codes: means, axes, directories and tables."""
    decoder = config.coefficients * config.row_bytes + config.modes * (config.coefficients + len(config.planes))
    bits = 8 * textures.groups * decoder
    if config.tables is not None:
        bits = 8 * _gains(textures, config)
    for size in textures.sizes:
        bits += 32 * (config.mips * config.output_channels + config.axis_numbers)
        if len(config.block_words) > 1:
            coded_levels = [level for level in latent_levels(*size, config) if level.has_own_cells]
            bits += sum(64 * -(-level.cells // DIRECTORY_RUN) for level in coded_levels)
    return bits


def _gains(textures: TextureSet, config: BlockConfig) -> int:
    """Most gains that the groups of textures have together."""
    blocks = sorted((latent_cell_count(*size, config) for size in textures.sizes), reverse=True)[:MOST_SCALED_GROUPS]
    return sum(config.coefficients if count >= FINE_BLOCKS else config.output_channels * BANDS for count in blocks)


def texel_count(sizes: Sizes, config: BlockConfig) -> int:
    """Texels of all textures' mip 0."""
    del config
    return sum(width * height for width, height in sizes)


def block_count(sizes: Sizes, config: BlockConfig) -> int:
    """Blocks of all encoded mips."""
    return sum(latent_cell_count(*size, config) for size in sizes)


JUDGED_BLOCKS = 1024
"""Most blocks of a texture by which kinds of edge parts are judged."""
TEXTURE_PASSES = 3.0
"""Passes over the blocks of a texture: choices, codes, and the measure of the quality."""
PREVIEW_TIMES = 48
"""Texels of a group, as a multiple of those of its preview, from which on it has one."""
FEW_TEXTURES = 8
"""Most textures that are encoded one after the other, each by all threads."""


def texture_work(size: tuple[int, int], config: BlockConfig) -> float:
    """Work of encoding a texture of `size`: its blocks, counted once for each pass."""
    return TEXTURE_PASSES * block_count([size], config)


def fitting_work(sizes: Sizes, config: BlockConfig) -> float:
    """Work of fitting tables to textures of these sizes: sampled blocks count as those of a texture that is encoded."""
    return TEXTURE_PASSES * min(SAMPLED_BLOCKS, block_count(sizes, config))


def has_preview(sizes: Sizes, small: Sizes) -> bool:
    """Return whether a group of textures of these sizes is shown first as textures of `small` sizes."""
    texels, few = (sum(width * height for width, height in each) for each in (sizes, small))
    return texels >= PREVIEW_TIMES * few


def words_of_bits(bits: float, size: tuple[int, int], config: BlockConfig) -> float:
    """Words a block in which the codes of a texture of `size` take `bits` bits per texel of mip 0."""
    return bits * size[0] * size[1] / (32.0 * block_count([size], config))


def bits_of_words(words: float, size: tuple[int, int], config: BlockConfig) -> float:
    """Bits per texel of mip 0 of the codes of a texture of `size` with `words` words a block."""
    return 32.0 * words * block_count([size], config) / (size[0] * size[1])


def code_mips(textures: TextureSet, side: Literal[4, 8] = 8) -> Literal[2, 4]:
    """Mips that a code holds. Four of single textures: that is nearer at each of mips 0 to 3. Two of material sets: they are large, so
    that fine mips are left out where memory is short, and averages of normals and of strong contrasts lose with each mip."""
    return 4 if side == 8 and not is_material(textures.maps) else 2


def _code_sizes(words: float, side: int, largest: int) -> tuple[int, ...]:
    """`BlockConfig.block_words` for codes of `words` words on average."""
    if side == 4:
        near = abs(words - round(words)) < WHOLE_WORDS and round(words) >= 1
        lengths = {round(words)} if near else {int(words), int(words) + 1}
        return tuple(sorted({min(max(size, 1), largest) for size in lengths}))
    sizes: list[int] = []
    for ratio in SIZE_RATIOS:
        sizes.append(max(round(ratio * words), sizes[-1] + 1 if sizes else 1))
    return tuple(sorted({min(size, largest) for size in sizes}))


def _shipped_config(textures: TextureSet) -> BlockConfig:
    """Settings of the tables that ship."""
    if textures.maps != BASE_ALONE:
        return set_config(textures.maps, textures.channels)
    return replace(UNIVERSAL_CONFIG, output_channels=common_channels(textures.channels))


def config_for_words(
    words: float, textures: TextureSet, side: Literal[4, 8] = 8, multiply_adds: int | None = None
) -> BlockConfig:
    """Codes of about so many words, and tables that are in proportion, of at most so many `multiply_adds` a texel."""
    block_words = _code_sizes(words, side if textures.groups else UNIVERSAL_CONFIG.block_side, largest_words(textures))
    if not textures.groups:
        mips = code_mips(textures, UNIVERSAL_CONFIG.block_side)
        config = replace(_shipped_config(textures), mips=mips, block_words=block_words, levels=textures.levels)
        if multiply_adds is not None and config.multiply_adds > multiply_adds:
            raise InputError(
                f"the decoder that ships with the program takes {config.multiply_adds} multiply-adds a texel, not {multiply_adds} "
                "at most; choose another grouping"
            )
        return config
    plain = BlockConfig(
        mips=code_mips(textures, side),
        block_side=side,
        block_words=block_words,
        coefficients=1,
        # The maps of a set need different bits, so more allocations are useful.
        modes=LARGEST_SET_MODES if is_material(textures.maps) else MODES,
        output_channels=textures.channels,
        maps=textures.maps,
        levels=textures.levels,
    )
    most = min(plain.block_values, COEFFICIENTS + round(COEFFICIENTS_PER_WORD * words))
    if multiply_adds is not None:
        most = max(1, min(most, multiply_adds - plain.axis_numbers))
    config = replace(plain, coefficients=most)
    codes = 32.0 * words * block_count(textures.sizes, config)
    # With fewer ones a code's bits find no coefficient that takes them.
    enough = max(FEWEST_COEFFICIENTS, round(1.5 * 32.0 * words / LARGEST_DEPTH))
    while textures.groups and side_bits(replace(textures, sizes=()), config) > TABLE_SHARE * codes:
        # Modes first: fewer modes cost less quality than fewer coefficients.
        if config.modes > FEWEST_MODES:
            config = replace(config, modes=config.modes // 2)
        elif config.coefficients * 9 // 10 >= enough:
            config = replace(config, coefficients=config.coefficients * 9 // 10)
        else:
            break
    return config


def _stored_bits(words: float, textures: TextureSet, config: BlockConfig) -> float:
    """Return the total of stored bits for codes of `words` words on average."""
    return 32.0 * words * block_count(textures.sizes, config) + side_bits(textures, config)


def _words_left(stored_bits: float, blocks: int, textures: TextureSet, config: BlockConfig) -> float:
    """Words a block that side information leaves of `stored_bits`."""
    return max((stored_bits - side_bits(textures, config)) / (32.0 * blocks), 0.0)


def _settled_config(
    stored_bits: float, textures: TextureSet, side: Literal[4, 8] = 8, multiply_adds: int | None = None
) -> BlockConfig:
    """Settings for so many bits in all; the least or the most that is possible where that is nearest."""
    blocks = max(1, block_count(textures.sizes, config_for_words(0.0, textures, side)))
    low, high = 0.0, max(stored_bits, 0.0) / (32.0 * blocks)
    for _ in range(SETTLING_ROUNDS):
        # Side information depends on the settings, and they on the words that it leaves.
        words = 0.5 * (low + high)
        left = _words_left(stored_bits, blocks, textures, config_for_words(words, textures, side, multiply_adds))
        low, high = (words, high) if left >= words else (low, words)
    config = config_for_words(low, textures, side, multiply_adds)
    left = _words_left(stored_bits, blocks, textures, config)
    return replace(config, mean_words=float(min(max(left, config.block_words[0]), config.block_words[-1])))


def config_for_bits(
    bits: float, textures: TextureSet, side: Literal[4, 8] = 8, multiply_adds: int | None = None
) -> BlockConfig:
    """Return settings with blocks of `side` texels, of at most `multiply_adds` per texel, for `bits` stored bits per texel of mip 0.

    The least that is possible where textures are so small or so few that this is more. Raises InputError for bits that are not above
    0, or beyond what the largest codes take.
    """
    if math.isnan(bits):
        raise InputError(f"--bits {bits}: is not a number")
    texels = max(1, texel_count(textures.sizes, BlockConfig(block_side=side, coefficients=1, levels=textures.levels)))
    # No more words are left than the largest codes have, whatever is asked for.
    config = _settled_config(min(bits, 64.0) * texels, textures, side, multiply_adds)
    most = _stored_bits(largest_words(textures), textures, config) / texels
    if not 0.0 < bits <= most:
        raise InputError(f"--bits {bits:g}: set it above 0 and up to {most:.2f}, what the largest codes take here")
    return config


def config_for_bytes(stored_bytes: float, textures: TextureSet) -> BlockConfig:
    """Return settings for at most `stored_bytes` in all; the largest codes where even they take less.

    Raises InputError for less than what the smallest codes take.
    """
    smallest = config_for_words(0.0, textures)
    least = _stored_bits(smallest.block_words[0], textures, smallest) / 8.0
    if not stored_bytes >= least:
        raise InputError(f"at least {least / 1e6:.3f} MB are needed for codes and tables of these textures")
    config = _settled_config(8.0 * stored_bytes, textures)
    fits = _stored_bits(config.mean_words, textures, config) <= 8.0 * stored_bytes
    return config if fits else replace(smallest, mean_words=float(smallest.block_words[0]))


def settings_for_target(known: TextureSet, target: Target) -> BlockConfig:
    """Return the settings for textures at `target`. For a quality these are the largest: the encoder chooses smaller ones.

    Raises InputError for bits or a size out of reach.
    """
    if isinstance(target, BitsTarget):
        return config_for_bits(target.bits, known, target.block_side, target.multiply_adds)
    if not isinstance(target, SizeTarget):
        largest = config_for_words(largest_words(known), known)
        return replace(largest, coefficients=largest.block_values) if known.groups else largest
    header = known.header_bytes
    try:
        return config_for_bytes(1e6 * target.megabytes - header, known)
    except InputError as error:
        raise InputError(f"--size {target.megabytes:g}: {error}, and {header / 1e6:.3f} MB for names") from None
