"""The settings of codec `block` that come to a target: bits a texel, a size, or a quality. Needs no torch."""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Literal

from ntc.codec.block.config import (
    FEWEST_MODES,
    LARGEST_SET_MODES,
    LARGEST_SET_WORDS,
    LARGEST_WORDS,
    BlockConfig,
    BlockOptions,
)
from ntc.codec.block.encoding.blocks import SAMPLED_BLOCKS, reduction
from ntc.codec.block.storage import DIRECTORY_RUN
from ntc.codec.block.trellis import LARGEST_DEPTH
from ntc.codec.block.universal import BANDS, FINE_BLOCKS, MOST_SCALED_GROUPS, UNIVERSAL_CONFIG, set_config
from ntc.codec.encoding import BitsTarget, Sizes, SizeTarget, Target, TextureSet, common_channels
from ntc.codec.latents import latent_cell_count, latent_levels
from ntc.codec.maps import BASE_ALONE, is_material
from ntc.errors import InputError

SIZE_RATIOS = (0.5, 0.9, 1.35, 2.1)
"""Sizes of codes over their mean: textures and their blocks are so far apart."""
WHOLE_WORDS = 0.1
"""Blocks of 4x4 texels take codes of one size where the mean is as near to a whole number of words: a directory costs 0.25 bits a
texel there."""
COEFFICIENTS, COEFFICIENTS_PER_WORD = 24, 36
"""Rows of the basis, and for each word of a code: more are hardly ever given a bit."""
MODES = 32
TABLE_SHARE = 0.25
"""Of all bits: tables are made smaller where textures are so few that they would take more."""
FEWEST_COEFFICIENTS = 16
SETTLING_ROUNDS = 24


def largest_words(textures: TextureSet) -> int:
    """Words of a block's code at most."""
    return LARGEST_WORDS if textures.maps == BASE_ALONE else LARGEST_SET_WORDS


def side_bits(textures: TextureSet, config: BlockConfig) -> int:
    """Stored bits besides codes: means, axes, directories and tables."""
    decoder = config.coefficients * config.row_bytes + config.modes * (config.coefficients + len(config.planes))
    bits = 8 * textures.groups * decoder
    if config.tables is not None:
        bits = 8 * _gains(textures, config)
    for size in textures.sizes:
        bits += 32 * (config.mips * config.output_channels + config.axis_numbers)
        if len(config.block_words) > 1:
            own = [level for level in latent_levels(*size, config) if level.has_own_cells]
            bits += sum(64 * -(-level.cells // DIRECTORY_RUN) for level in own)
    return bits


def _gains(textures: TextureSet, config: BlockConfig) -> int:
    """Most gains that the groups of textures have together."""
    blocks = sorted((latent_cell_count(*size, config) for size in textures.sizes), reverse=True)[:MOST_SCALED_GROUPS]
    return sum(config.coefficients if own >= FINE_BLOCKS else config.output_channels * BANDS for own in blocks)


def texel_count(sizes: Sizes, config: BlockConfig) -> int:
    """Texels of all textures' mip 0."""
    del config
    return sum(width * height for width, height in sizes)


def block_count(sizes: Sizes, config: BlockConfig) -> int:
    """Blocks of all encoded mips."""
    return sum(latent_cell_count(*size, config) for size in sizes)


# `python -m lab.benchmarks.encoding_work` measures the parts of encodings and fits these constants to them, but for those of gains,
# of corrections, of previews and of threads.
FIT_WORK, SAMPLING_WORK = 1.15, 0.12
"""Time to fit tables to a sampled block, and to make a block ready for sampling, as multiples of the time to encode one."""
EDGE_BLOCKS = 156
"""Sampled blocks, per channel and per CHANNEL_COEFFICIENTS coefficients, that take as much time as edge parts, whose time does not
depend on the number of blocks."""
GAINS_WORK = 0.05
"""Time to fit the gains of tables that ship to a sampled block, likewise."""
TYPICAL_KINDS = 2
"""Kinds of edge parts, modes without them counted as one, among which modes of a texture are chosen where that is not known yet."""
CHOICES_WORK, CODES_WORK, MEASURE_WORK = 0.17, 0.32, 0.34
"""Shares of the time to encode a block: choices for each of TYPICAL_KINDS, codes, and the measure of the quality."""
JUDGED_BLOCKS = 1024
"""Most blocks of a texture by which kinds of edge parts are judged, and by which words are shared out."""
JUDGING_WORK, SHARING_WORK = 1.15, 0.8
"""Time for each of these blocks to judge kinds, and to share words out, as multiples of the time to encode a block."""
REDONE_WORK = 1.15
"""Time to encode a texture again with fewer mips per code, as a multiple of the time to encode its blocks once."""
REDONE_SHARE, DOUBTFUL_SHARE = 0.15, 0.66
"""Share of all textures that are encoded so, and of those whose tables and averages let one expect it."""
CORRECTIONS_WORK = 1.2
"""Time to encode textures again until they have a quality, as a multiple of the time to encode them once."""
PREVIEW_TIMES = 48
"""Texels of a group, as a multiple of those of its preview, from which on it has one."""
CHANNEL_COEFFICIENTS = 26.0
"""Coefficients that take as much time as a channel."""
THREAD_GAIN = 0.5
"""What each thread besides the first adds to the speed of encoding, on two cores that no other program uses: 0.65 where each encodes a
texture, 0.36 where they share one."""
FEW_TEXTURES = 8
"""Up to so many textures are encoded one after the other, each by all threads."""


def channel_work(config: BlockConfig) -> float:
    """Time to encode a block, as a multiple of that of a channel."""
    return config.output_channels + config.coefficients / CHANNEL_COEFFICIENTS


def edge_blocks(config: BlockConfig) -> float:
    """Sampled blocks that take as much time as the edge parts of a group."""
    return EDGE_BLOCKS * channel_work(config)


def fitting_work(sizes: Sizes, config: BlockConfig, ships: bool) -> float:
    """Time to fit a group of textures of these sizes, in units of the time to encode a block. `ships`: gains alone are fitted."""
    blocks = block_count(sizes, config)
    fitting = (GAINS_WORK if ships else FIT_WORK) * (edge_blocks(config) + min(SAMPLED_BLOCKS, blocks))
    return fitting + SAMPLING_WORK * blocks + sharing_work(sizes, config)


def sharing_work(sizes: Sizes, config: BlockConfig) -> float:
    """Time to share words out among textures of these sizes, in units of the time to encode a block."""
    return SHARING_WORK * sum(min(JUDGED_BLOCKS, block_count([size], config)) for size in sizes)


def judging_work(blocks: float) -> float:
    """Time to find the kinds of edge parts of a texture of so many blocks, in units of the time to encode a block."""
    return JUDGING_WORK * min(JUDGED_BLOCKS, blocks)


def redone_work(size: tuple[int, int], config: BlockConfig) -> float:
    """Time to encode a texture of `size` again with fewer mips per code, in units of the time to encode a block."""
    return REDONE_WORK * block_count([size], config)


def texture_work(size: tuple[int, int], config: BlockConfig) -> float:
    """Time to encode a texture of `size`, in units of the time to encode a block."""
    blocks = block_count([size], config)
    return blocks + judging_work(blocks)


def thread_speed(threads: int) -> float:
    """Speed of so many threads, as a multiple of that of one."""
    return 1.0 + THREAD_GAIN * (threads - 1)


def encoding_speed(threads: int, of: int, textures: int) -> float:
    """Speed of so many threads at `of` textures that are encoded at once, as a multiple of that of one thread. `textures`: all that
    are to be encoded; where they are many, each takes a thread."""
    return thread_speed(threads if textures <= FEW_TEXTURES else min(threads, of))


def _previews(groups: Sequence[Sizes], side: int) -> list[Sizes]:
    """Sizes of the reduced textures of the groups that have a preview."""
    found: list[Sizes] = []
    for sizes in groups:
        factors = [reduction(size, side) for size in sizes]
        small = [(width // each, height // each) for (width, height), each in zip(sizes, factors, strict=True)]
        if has_preview(sizes, small):
            found.append(small)
    return found


def has_preview(sizes: Sizes, small: Sizes) -> bool:
    """Return whether a group of textures of these sizes is shown first as textures of `small` sizes."""
    texels, few = (sum(width * height for width, height in each) for each in (sizes, small))
    return texels >= PREVIEW_TIMES * few


def encoding_work(
    groups: Sequence[Sizes], config: BlockConfig, options: BlockOptions, ships: bool, threads: int
) -> float:
    """Time to encode groups of textures of these sizes by so many threads, in units of the time in which one thread encodes a block,
    per channel and per CHANNEL_COEFFICIENTS coefficients.

    Where a quality is asked for, tables are fitted twice, and some textures are encoded again. `ships`: no tables are fitted.
    """
    to_quality = options.quality_db is not None
    runs = [groups]
    if options.preview_side is not None and not to_quality:
        runs.append(_previews(groups, options.preview_side))
    work = 0.0
    for each in runs:
        at_once = 1 if options.groups_apart and not to_quality else min(threads, len(each))
        fits = sum(fitting_work(sizes, config, ships) for sizes in each)
        work += (2.0 if to_quality else 1.0) * fits / thread_speed(at_once)
        count = sum(map(len, each))
        for sizes in each:
            textures = sum(texture_work(size, config) for size in sizes)
            redone = REDONE_SHARE * sum(redone_work(size, config) for size in sizes)
            again = CORRECTIONS_WORK * textures if to_quality else redone
            work += (textures + again) / encoding_speed(threads, count if to_quality else len(sizes), count)
    return channel_work(config) * work


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
        found = {round(words)} if near else {int(words), int(words) + 1}
        return tuple(sorted({min(max(size, 1), largest) for size in found}))
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
        found = replace(_shipped_config(textures), mips=mips, block_words=block_words, levels=textures.levels)
        if multiply_adds is not None and found.multiply_adds > multiply_adds:
            raise InputError(
                f"the decoder that ships with the program takes {found.multiply_adds} multiply-adds a texel, not {multiply_adds} "
                "at most; choose another grouping"
            )
        return found
    plain = BlockConfig(
        mips=code_mips(textures, side),
        block_side=side,
        block_words=block_words,
        coefficients=1,
        # Each map of a set wants other bits: many ways of sharing them pay.
        modes=LARGEST_SET_MODES if is_material(textures.maps) else MODES,
        output_channels=textures.channels,
        maps=textures.maps,
        levels=textures.levels,
    )
    most = min(plain.block_values, COEFFICIENTS + round(COEFFICIENTS_PER_WORD * words))
    if multiply_adds is not None:
        most = max(1, min(most, multiply_adds - plain.axis_numbers))
    found = replace(plain, coefficients=most)
    codes = 32.0 * words * block_count(textures.sizes, found)
    # With fewer ones a code's bits find no coefficient that takes them.
    enough = max(FEWEST_COEFFICIENTS, round(1.5 * 32.0 * words / LARGEST_DEPTH))
    while textures.groups and side_bits(replace(textures, sizes=()), found) > TABLE_SHARE * codes:
        # Modes first: they are worth less than coefficients.
        if found.modes > FEWEST_MODES:
            found = replace(found, modes=found.modes // 2)
        elif found.coefficients * 9 // 10 >= enough:
            found = replace(found, coefficients=found.coefficients * 9 // 10)
        else:
            break
    return found


def _stored_bits(words: float, textures: TextureSet, config: BlockConfig) -> float:
    """All bits that are stored for codes of `words` words on average."""
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
    """Settings with blocks of `side` texels, of at most `multiply_adds` a texel, that come to `bits` stored bits a texel of all
    encoded mips.

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
    """Settings that come to at most `stored_bytes` in all; the largest codes where even they take less.

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
    """The settings under which textures come to `target`; those of a quality are found while encoding, here are the largest.

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
