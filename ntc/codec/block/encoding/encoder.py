"""Encoding a texture under a group's tables: sizes of codes, modes, trellis-coded indices.

Three passes over the blocks. The first estimates the errors of all modes at all sizes of codes, and keeps the two best (`choices`).
Sizes are then allocated level by level: each level gets the same words per block, because a coarse mip is seen as often as a fine one;
within a level, words go to the blocks whose errors fall most (`bit_allocation`). The last pass searches the trellis for both modes of
each block at its size, and keeps the code of less error.
"""

from collections.abc import Callable, Sequence
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ntc.codec.block.codes import EdgePart, bits_before_branches
from ntc.codec.block.config import BlockConfig
from ntc.codec.block.encoding.bit_allocation import sizes_within
from ntc.codec.block.encoding.blocks import Array, Axes, PreparedTexture, prepare_texture, sample_textures
from ntc.codec.block.encoding.choices import Choices, block_choices, left_out, paying_kinds
from ntc.codec.block.encoding.compiled_trellis import coded
from ntc.codec.block.encoding.edges import derived_costs, edge_kinds, fitted_edges
from ntc.codec.block.encoding.masks import keep_coverage, mask_words, side_costs
from ntc.codec.block.encoding.mips_per_code import coarse_words, equal_words
from ntc.codec.block.encoding.tables import fit_decoder
from ntc.codec.block.encoding.transform import Tables, one_thread
from ntc.codec.block.model import BlockDecoder, BlockTexture
from ntc.codec.block.storage import BlockCodes, stored_words
from ntc.codec.codec import texture_fields
from ntc.codec.latents import LatentLevel, latent_levels
from ntc.codec.textures import SourceTexture
from ntc.threads import mapped

BLOCKS_AT_ONCE = 1 << 13


def encode_texture(
    source: SourceTexture,
    decoder: BlockDecoder,
    config: BlockConfig,
    words: float,
    group: int = 0,
    worked: Callable[[float], None] = lambda _: None,
    threads: int = 1,
    prepared: PreparedTexture | None = None,
    code_mips: Literal[1, 2] | None = None,
    choices: Choices | None = None,
) -> BlockTexture:
    """Return a texture in `group` under its tables, with at most `words` words per block on average where the sizes of codes allow
    that. `code_mips` replaces the mips per code of `config`; the texture takes as many bytes.

    `prepared` is `source` in blocks, and `choices` are those of these, where that is known. `threads` change no byte. `worked` is
    called often, with the blocks that a pass was over since; what it raises ends the encoding.
    """
    texture = prepared or prepare_texture(source, config, code_mips)
    words = equal_words(words, source.size, code_mips, config)
    choices = choices or texture_choices(texture, decoder, config, worked, threads)
    with one_thread():
        levels = latent_levels(*source.size, config, code_mips)
        least = 0.0 if texture.axes.cutoff is None else float(mask_words(config))
        sizes = _sizes(
            choices.errors, levels, config, words, [least] if code_mips is None else coarse_words(words, least, config)
        )
        candidates = np.take_along_axis(choices.modes, sizes[:, None, None], axis=1)[:, 0]
        codes = _codes(texture, sizes, candidates, Tables.of(decoder, config), decoder, config, worked, threads)
    stored = stored_words(BlockCodes(codes, sizes), levels, config)
    axes = texture.axes
    encoded = BlockTexture(
        **texture_fields(source, group), words=stored, mean=axes.mean.copy(), axes=axes.axes, code_mips=code_mips
    )
    if axes.cutoff is not None:
        share = float((source.pixels[..., -1] >= 255.0 * axes.cutoff).mean())
        keep_coverage(encoded, decoder, config, axes.cutoff, share)
    return encoded


def texture_choices(
    texture: PreparedTexture,
    decoder: BlockDecoder,
    config: BlockConfig,
    worked: Callable[[float], None] = lambda _: None,
    threads: int = 1,
    first: Choices | None = None,
) -> Choices:
    """Return the choices for all blocks of `texture`; `first` are those of its first blocks, where known. `threads` and `worked` are
    those of `encode_texture`."""
    with one_thread():
        tables = Tables.of(decoder, config)
        kinds = paying_kinds(texture, tables, decoder, config)
        known = 0 if first is None else len(first.errors)
        starts = range(known, len(texture.texels), BLOCKS_AT_ONCE)

        def choices_of(start: int) -> Choices:
            worked(0.0)
            blocks = texture.normalised(slice(start, start + BLOCKS_AT_ONCE))
            parts = block_choices(blocks, texture.axes, tables, decoder, config, kinds)
            worked(len(blocks))
            return parts

        parts = mapped(choices_of, starts, threads)
    return Choices.joined([*([] if first is None else [first]), *parts])


def _sizes(
    expected: NDArray[np.float32],
    levels: Sequence[LatentLevel],
    config: BlockConfig,
    words: float,
    least: Sequence[float],
) -> NDArray[np.int64]:
    """Return [blocks] size classes. Every level takes `words` words per block; mips from mip 1 on take at least `least` words, whose
    last entry counts for all further mips."""
    lengths, left = np.array(config.block_words), 0.0
    classes: list[NDArray[np.int64]] = []
    for number, level in reversed([each for each in enumerate(levels) if each[1].has_own_cells]):
        errors = expected[level.first_cell : level.first_cell + level.cells]
        # A level passes words that it cannot use, or has overdrawn, on to the next finer one.
        wanted = words + left / level.cells
        if number:
            wanted = max(wanted, least[min(number, len(least)) - 1])
        classes.append(sizes_within(errors, config.block_words, wanted))
        left += words * level.cells - float(lengths[classes[-1]].sum())
    return np.concatenate(classes[::-1])


def _codes(
    texture: PreparedTexture,
    sizes: NDArray[np.int64],
    modes: NDArray[np.uint8],
    tables: Tables,
    decoder: BlockDecoder,
    config: BlockConfig,
    worked: Callable[[float], None],
    threads: int,
) -> NDArray[np.uint32]:
    """[blocks, words of the largest code] uint32 for size classes `sizes` and candidates `modes` [blocks, CANDIDATES]: of the
    candidates, each block takes the one of least error."""
    codes = np.zeros((len(sizes), config.block_words[-1]), np.uint32)
    runs = []
    for size in range(len(config.block_words)):
        members = np.nonzero(sizes == size)[0]
        runs += [(size, members[start : start + BLOCKS_AT_ONCE]) for start in range(0, len(members), BLOCKS_AT_ONCE)]

    def write(run: tuple[int, NDArray[np.int64]]) -> None:
        size, rows = run
        blocks, candidates = texture.normalised(rows), modes[rows].astype(np.int64)
        codes[rows] = _best_codes(blocks, candidates, size, texture.axes, tables, decoder, config)
        worked(len(rows))

    mapped(write, runs, threads)
    return codes


def _best_codes(
    blocks: Array,
    modes: NDArray[np.int64],
    size: int,
    axes: Axes,
    tables: Tables,
    decoder: BlockDecoder,
    config: BlockConfig,
) -> NDArray[np.uint32]:
    """[blocks, words of the largest code] uint32: codes of size class `size` for normalised `blocks`.

    Each takes the one of its candidates `modes` [blocks, CANDIDATES] that has the least error."""
    codes = np.zeros((len(blocks), config.block_words[-1]), np.uint32)
    least = np.full(len(blocks), np.inf)
    kinds = [kind for kind in edge_kinds(decoder) if np.isin(modes, kind.modes).any()]
    for kind in kinds:
        suits = np.isin(modes, kind.modes)
        rows = np.nonzero(suits.any(1))[0]
        fit = fitted_edges(blocks[rows], axes, kind.bits, config)
        values = tables.project(fit.rest)
        lost = left_out(fit.rest, values) + side_costs(blocks[rows], kind.bits, axes, config)
        if len(kinds) > 1:
            lost = lost + derived_costs(blocks[rows], fit, axes, config)
        for candidate in range(modes.shape[1]):
            # Where all of them have edge parts of this kind, as is usual, nothing is copied.
            members = np.nonzero(suits[rows, candidate])[0]
            every = len(members) == len(rows)
            parts = fit.parts if every else tuple(_parts_of(part, members) for part in fit.parts)
            chosen = modes[rows[members], candidate]
            bits = bits_before_branches(chosen, np.full(len(members), size), parts, decoder, config)
            given = values if every else values[members]
            words, errors = coded(given, chosen, size, bits, decoder, config)
            errors = errors + lost[members]
            better = errors < least[rows[members]]
            taken = rows[members[better]]
            least[taken] = errors[better]
            codes[taken] = words[better]
    return codes


def _parts_of(part: EdgePart, blocks: NDArray[np.int64]) -> EdgePart:
    """Return the parts of `blocks`, renumbered from 0, where all blocks have a part or none has."""
    if not len(part.blocks):
        return part
    return EdgePart(np.arange(len(blocks)), part.bits[blocks], part.colours[blocks], part.indices[blocks])


def encode_group(
    sources: Sequence[SourceTexture], config: BlockConfig, seed: int = 0
) -> tuple[BlockDecoder, tuple[BlockTexture, ...]]:
    """Return the tables and codes of textures that share a decoder. `seed` decides which blocks are sampled, and so every byte."""
    decoder = fit_decoder(sample_textures(sources, config, seed), config, seed)
    return decoder, tuple(encode_texture(source, decoder, config, config.mean_words) for source in sources)
