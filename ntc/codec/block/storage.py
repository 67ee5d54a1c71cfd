"""Layout of textures of codec `block` in files: codes in words, and tensors (docs/reference/pack-format.md).

Level after level: where blocks may take several sizes, a directory, then the codes of the level's blocks, row by row, without gaps.
The directory has two words for each run of DIRECTORY_RUN blocks: where the run's first code begins, in words from the level's first
word, and the size classes of its blocks, two bits each, the first block's lowest. So one read of the directory locates any block.
"{}" in the name of a tensor is the number of a texture or decoder.
"""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ntc.codec.block.config import BlockConfig
from ntc.codec.block.model import BlockTexture
from ntc.codec.codec import Tensors, TensorShape
from ntc.codec.gpu import StoredRows
from ntc.codec.latents import LatentLevel, texture_levels
from ntc.codec.maps import BASE_ALONE, plane_channels

Words = NDArray[np.uint32]
DIRECTORY_RUN = 16
"""Blocks whose size classes one word of a level's directory holds."""
WORD = np.dtype("<u4")
LARGEST_NUMBER = 16.0
"""Largest magnitude of means and axes. Those of an encoder are below 2; with this limit no code decodes beyond fp32."""


class BlockCodes(NamedTuple):
    """Codes of blocks, read from stored words."""

    codes: Words
    """[blocks, words of the largest code] uint32; words beyond a block's size are undefined."""
    sizes: NDArray[np.int64]
    """[blocks] size class: which of `BlockConfig.block_words`."""


def directory_words(blocks: int, config: BlockConfig) -> int:
    """Words of the directory of a level of so many blocks."""
    return 2 * -(-blocks // DIRECTORY_RUN) if len(config.block_words) > 1 else 0


def stored_words(codes: BlockCodes, levels: Sequence[LatentLevel], config: BlockConfig) -> Words:
    """[words] uint32: the codes of all blocks of all `levels` as they are stored."""
    lengths = np.array(config.block_words, np.int64)[codes.sizes]
    parts: list[Words] = []
    for level in levels:
        if not level.has_own_cells:
            continue
        cells = slice(level.first_cell, level.first_cell + level.cells)
        directory = directory_words(level.cells, config)
        if directory:
            begins = directory + np.cumsum(lengths[cells]) - lengths[cells]
            classes = np.zeros(directory // 2 * DIRECTORY_RUN, np.uint32)
            classes[: level.cells] = codes.sizes[cells]
            shifted = classes.reshape(-1, DIRECTORY_RUN) << (2 * np.arange(DIRECTORY_RUN, dtype=np.uint32))
            runs = np.stack([begins[::DIRECTORY_RUN].astype(np.uint32), shifted.sum(1, dtype=np.uint32)], axis=1)
            parts.append(runs.reshape(-1))
        inside = np.arange(codes.codes.shape[1]) < lengths[cells, None]
        parts.append(codes.codes[cells][inside])
    return np.concatenate(parts).astype(np.uint32)


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
    """Return the rows of each of `levels` in a texture's stored `words` [words] uint32.

    A mip of 0 rows is decoded from those of the next coarser one.

    Raises ValueError for words that are not what `stored_words` gives: wrong places in a directory, unknown classes, wrong length.
    """
    rows_of_levels, first = list[StoredRows](), 0
    lengths_of = np.array(config.block_words, np.int64)
    for level, following in zip(levels, [*levels[1:], None], strict=True):
        part = words[first:]
        sizes = _level_sizes(part, level.cells, config)
        if sizes.max(initial=0) >= len(config.block_words):
            raise ValueError("latents: a directory names a size of codes that the codec does not have")
        lengths, directory = lengths_of[sizes], directory_words(level.cells, config)
        begins = directory + np.cumsum(lengths) - lengths
        if directory and not np.array_equal(part[:directory:2], begins[::DIRECTORY_RUN]):
            raise ValueError("latents: a directory does not name the places where codes begin")
        rows = directory + int(lengths.sum())
        # Codes of several mips belong to the coarsest of them: finer mips are never loaded without it.
        shared = following is not None and not following.has_own_cells
        rows_of_levels.append(StoredRows(first, 0 if shared else rows))
        first += rows_of_levels[-1].rows
    if first != len(words):
        raise ValueError(f"latents: {len(words)} words, not the {first} that their directories tell of")
    return tuple(rows_of_levels)


def level_codes(words: Words, level: LatentLevel, config: BlockConfig) -> BlockCodes:
    """Return the codes of all blocks of a level; `words` begin with the level's directory."""
    sizes = _level_sizes(words, level.cells, config)
    lengths = np.array(config.block_words, np.int64)[sizes]
    begins = directory_words(level.cells, config) + np.cumsum(lengths) - lengths
    # Padding: a full code is read at the last block, whatever its size.
    padded = np.concatenate([words, np.zeros(config.block_words[-1], np.uint32)])
    return BlockCodes(padded[begins[:, None] + np.arange(config.block_words[-1])], sizes)


def _axes_shape(config: BlockConfig) -> tuple[int, ...]:
    """Return the shape of a texture's axes in a file: one matrix; for material sets the matrices of all planes, one after the
    other."""
    channels = config.output_channels
    return (channels, channels) if config.maps == BASE_ALONE else (config.axis_numbers,)


def texture_shapes(config: BlockConfig) -> dict[str, TensorShape]:
    """Type and shape of the tensors of a texture: words of codes, means and axes."""
    return {
        "latents.{}": ("U8", (None, WORD.itemsize)),
        "latents.{}.mean": ("F32", (config.mips, config.output_channels)),
        "latents.{}.axes": ("F32", _axes_shape(config)),
    }


def _plane_blocks(config: BlockConfig) -> list[tuple[NDArray[np.intp], ...]]:
    """Return for each plane the index of its part in a matrix of channels."""
    planes = plane_channels(config.maps, config.output_channels).values()
    return [np.ix_(list(channels.values()), list(channels.values())) for channels in planes]


def _axes_matrix(parts: NDArray[np.float32], config: BlockConfig) -> NDArray[np.float32]:
    """[channels, channels] float32: `BlockTexture.axes` of its `parts` as files hold them."""
    axes, first = np.zeros((config.output_channels, config.output_channels), np.float32), 0
    for plane in _plane_blocks(config):
        count = plane[0].size
        axes[plane] = parts[first : first + count * count].reshape(count, count)
        first += count * count
    return axes


def texture_tensors(texture: BlockTexture, config: BlockConfig) -> dict[str, NDArray[Any]]:
    """Return the tensors of a texture, contiguous. Axes hold the rows of each plane's part, plane by plane."""
    axes = np.concatenate([texture.axes[plane].reshape(-1) for plane in _plane_blocks(config)])
    words = np.ascontiguousarray(texture.words, WORD)
    return {
        "latents.{}": words.view(np.uint8).reshape(-1, WORD.itemsize),
        "latents.{}.mean": np.ascontiguousarray(texture.mean),
        "latents.{}.axes": axes.reshape(_axes_shape(config)),
    }


def read_texture(tensors: Tensors, known: Mapping[str, Any], config: BlockConfig) -> BlockTexture:
    """Return the texture of these tensors and `known` fields.

    Raises ValueError for directories, means or axes that no encoder writes; all codes are valid."""
    parts = tensors["latents.{}.axes"].reshape(-1)
    _check_numbers(tensors["latents.{}.mean"], "latents.{}.mean")
    _check_numbers(parts, "latents.{}.axes")
    words = np.ascontiguousarray(tensors["latents.{}"]).view(WORD).reshape(-1)
    texture = BlockTexture(
        **known,
        words=words.astype(np.uint32, copy=False),
        mean=tensors["latents.{}.mean"],
        axes=_axes_matrix(parts, config),
    )
    try:
        level_rows(texture.words, texture_levels(texture, config), config)
    except ValueError as error:
        raise ValueError(f"latents.{{}}.{error}") from error
    return texture


def _check_numbers(array: NDArray[Any], name: str) -> None:
    """Check the numbers of the tensor `name`. Raises ValueError, which names it, for a number that no encoder writes."""
    if float(np.abs(array).max(initial=0.0)) > LARGEST_NUMBER:
        raise ValueError(f"{name}: a number is beyond {LARGEST_NUMBER:g}")
