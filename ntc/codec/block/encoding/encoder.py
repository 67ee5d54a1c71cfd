"""Encoding a texture under a group's tables: sizes of codes, modes, trellis-coded indices. Torch on the CPU, float32."""

from collections.abc import Callable, Sequence
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ntc.codec.block.codes import EdgePart, bits_before_branches
from ntc.codec.block.config import BlockConfig
from ntc.codec.block.encoding.blocks import Array, Axes, PreparedTexture, prepare_texture, sample_textures
from ntc.codec.block.encoding.choices import Choices, block_choices, left_out, paying_kinds
from ntc.codec.block.encoding.compiled import coded
from ntc.codec.block.encoding.edges import derived_costs, edge_kinds, fitted_edges
from ntc.codec.block.encoding.masks import keep_coverage, mask_words, side_costs
from ntc.codec.block.encoding.own_codes import equal_words, own_words
from ntc.codec.block.encoding.sharing import sizes_within
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
    """A texture in `group` under its tables, of `words` words a block on average at most, where its sizes allow that. With `code_mips`
    mips per code in place of as many as `config` says, it takes as many bytes.

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
            choices.errors, levels, config, words, [least] if code_mips is None else own_words(words, least, config)
        )
        own = np.take_along_axis(choices.modes, sizes[:, None, None], axis=1)[:, 0]
        codes = _codes(texture, sizes, own, Tables.of(decoder, config), decoder, config, worked, threads)
    stored = stored_words(BlockCodes(codes, sizes), levels, config)
    axes = texture.axes
    found = BlockTexture(
        **texture_fields(source, group), words=stored, mean=axes.mean.copy(), axes=axes.axes, code_mips=code_mips
    )
    if axes.cutoff is not None:
        share = float((source.pixels[..., -1] >= 255.0 * axes.cutoff).mean())
        keep_coverage(found, decoder, config, axes.cutoff, share)
    return found


def texture_choices(
    texture: PreparedTexture,
    decoder: BlockDecoder,
    config: BlockConfig,
    worked: Callable[[float], None] = lambda _: None,
    threads: int = 1,
    first: Choices | None = None,
) -> Choices:
    """Choices for all blocks of `texture`; the `first` of them may be known. `threads` and `worked` as `encode_texture` has them."""
    with one_thread():
        tables = Tables.of(decoder, config)
        kinds = paying_kinds(texture, tables, decoder, config)
        known = 0 if first is None else len(first.errors)
        starts = range(known, len(texture.texels), BLOCKS_AT_ONCE)

        def choices_of(start: int) -> Choices:
            worked(0.0)
            blocks = texture.normalised(slice(start, start + BLOCKS_AT_ONCE))
            found = block_choices(blocks, texture.axes, tables, decoder, config, kinds)
            worked(len(blocks))
            return found

        found = mapped(choices_of, starts, threads)
    return Choices.joined([*([] if first is None else [first]), *found])


def _sizes(
    expected: NDArray[np.float32],
    levels: Sequence[LatentLevel],
    config: BlockConfig,
    words: float,
    least: Sequence[float],
) -> NDArray[np.int64]:
    """[blocks] size classes; every level takes `words` words a block, for a coarse mip is looked at as often as a fine one. Mips from
    mip 1 on take `least` words at least, the last of which counts for all that follow: they have few blocks."""
    lengths, left = np.array(config.block_words), 0.0
    found: list[NDArray[np.int64]] = []
    for number, level in reversed([each for each in enumerate(levels) if each[1].has_own_cells]):
        own = expected[level.first_cell : level.first_cell + level.cells]
        # What a level cannot share out goes to the next finer one, which pays for what it took.
        wanted = words + left / level.cells
        if number:
            wanted = max(wanted, least[min(number, len(least)) - 1])
        found.append(sizes_within(own, config.block_words, wanted))
        left += words * level.cells - float(lengths[found[-1]].sum())
    return np.concatenate(found[::-1])


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
    found = np.zeros((len(sizes), config.block_words[-1]), np.uint32)
    runs = []
    for size in range(len(config.block_words)):
        own = np.nonzero(sizes == size)[0]
        runs += [(size, own[start : start + BLOCKS_AT_ONCE]) for start in range(0, len(own), BLOCKS_AT_ONCE)]

    def write(run: tuple[int, NDArray[np.int64]]) -> None:
        size, rows = run
        blocks, candidates = texture.normalised(rows), modes[rows].astype(np.int64)
        found[rows] = _best_codes(blocks, candidates, size, texture.axes, tables, decoder, config)
        worked(len(rows))

    mapped(write, runs, threads)
    return found


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
    found = np.zeros((len(blocks), config.block_words[-1]), np.uint32)
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
            own = np.nonzero(suits[rows, candidate])[0]
            every = len(own) == len(rows)
            parts = fit.parts if every else tuple(_parts_of(part, own) for part in fit.parts)
            chosen = modes[rows[own], candidate]
            bits = bits_before_branches(chosen, np.full(len(own), size), parts, decoder, config)
            given = values if every else values[own]
            words, errors = coded(given, chosen, size, bits, decoder, config)
            errors = errors + lost[own]
            better = errors < least[rows[own]]
            taken = rows[own[better]]
            least[taken] = errors[better]
            found[taken] = words[better]
    return found


def _parts_of(part: EdgePart, blocks: NDArray[np.int64]) -> EdgePart:
    """Those of `blocks`, where all blocks have a part or none has; numbered anew."""
    if not len(part.blocks):
        return part
    return EdgePart(np.arange(len(blocks)), part.bits[blocks], part.colours[blocks], part.indices[blocks])


def encode_group(
    sources: Sequence[SourceTexture], config: BlockConfig, seed: int = 0
) -> tuple[BlockDecoder, tuple[BlockTexture, ...]]:
    """Tables and codes of textures that share a decoder. `seed` decides which blocks are sampled, and so every byte."""
    decoder = fit_decoder(sample_textures(sources, config, seed), config, seed)
    return decoder, tuple(encode_texture(source, decoder, config, config.mean_words) for source in sources)
