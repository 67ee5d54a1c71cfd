"""The bits of a block's code: its mode, its edge parts, the branch bits of all coefficients, then the other bits of their indices."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ntc.codec.block.config import COLOUR_BITS, LARGEST_EDGE_BITS, BlockConfig
from ntc.codec.block.model import BlockDecoder
from ntc.codec.block.storage import BlockCodes
from ntc.codec.block.trellis import LARGEST_DEPTH


class EdgePart(NamedTuple):
    """Edge parts of one plane: two colours of some blocks, and each texel's index between them."""

    blocks: NDArray[np.int64]
    """[parts] numbers of the blocks that have one."""
    bits: NDArray[np.int64]
    """[parts] index bits a texel."""
    colours: NDArray[np.uint8]
    """[parts, 2, channels of the plane]."""
    indices: NDArray[np.uint8]
    """[parts, texels of a block]."""


class UnpackedCodes(NamedTuple):
    """Codes of blocks taken apart."""

    modes: NDArray[np.int64]
    """[blocks]."""
    depths: NDArray[np.uint8]
    """[blocks, coefficients]."""
    starts: NDArray[np.int64]
    """[blocks] states in which paths through the trellis start: the three bits before the first branch bit, the first one highest."""
    indices: NDArray[np.uint32]
    """[blocks, coefficients] the branch in the lowest bit, the place in the subset above it."""
    edges: tuple[EdgePart, ...]
    """Edge parts by plane."""


def first_branches(decoder: BlockDecoder, config: BlockConfig) -> NDArray[np.int64]:
    """[sizes of codes, modes] int64: bits of a code before its first branch bit."""
    return config.mode_bits + decoder.edge_bits(config)


def _spread(codes: NDArray[np.uint32]) -> NDArray[np.uint8]:
    """[blocks, bits] uint8 of `codes` [blocks, words], the least significant bit of a block's first word first."""
    return np.unpackbits(np.ascontiguousarray(codes, "<u4").view(np.uint8), axis=1, bitorder="little")


def joined_words(bits: NDArray[np.uint8]) -> NDArray[np.uint32]:
    """[blocks, words] uint32 of `bits` [blocks, 32 x words]."""
    return np.packbits(bits, axis=1, bitorder="little").view("<u4").astype(np.uint32)


def _numbers(bits: NDArray[np.uint8], first: NDArray[np.int64], count: int) -> NDArray[np.int64]:
    """Return the numbers of `count` bits each at places `first` [rows, ...] of `bits` [rows, bits]; bits beyond the end are 0."""
    rows = np.arange(len(bits)).reshape(-1, *[1] * (first.ndim - 1))
    numbers = np.zeros(first.shape, np.int64)
    for bit in range(count):
        place = first + bit
        inside = place < bits.shape[1]
        numbers |= (bits[rows, np.where(inside, place, 0)] * inside).astype(np.int64) << bit
    return numbers


def start_states(bits: NDArray[np.uint8], first: NDArray[np.int64]) -> NDArray[np.int64]:
    """[blocks] states of paths whose branch bits begin at `first` [blocks] of `bits`."""
    three = _numbers(bits, first - 3, 3)
    return (three & 1) << 2 | (three & 2) | three >> 2


def edge_places(decoder: BlockDecoder, config: BlockConfig, plane: int) -> NDArray[np.int64]:
    """Return [sizes of codes, modes] int64: the bit at which the edge part of `plane` begins."""
    fitting = decoder.fitting_edges(config)
    places = np.full(fitting.shape[:2], config.mode_bits, np.int64)
    for other in range(plane):
        lengths = np.array([config.edge_part_bits(other, bits) for bits in range(LARGEST_EDGE_BITS + 1)])
        places += lengths[fitting[..., other]]
    return places


class BitPlaces(NamedTuple):
    """Positions of the bits of coefficients in the codes of some blocks."""

    depths: NDArray[np.uint8]
    """[blocks, coefficients]."""
    first: NDArray[np.int64]
    """[blocks] of the first branch bit."""
    branches: NDArray[np.int64]
    """[blocks, coefficients] of the branch bit."""
    others: NDArray[np.int64]
    """[blocks, coefficients] of the lowest of the other bits."""


def bit_places(
    modes: NDArray[np.int64], sizes: NDArray[np.int64], decoder: BlockDecoder, config: BlockConfig
) -> BitPlaces:
    """Return the bit positions of codes of `modes` [blocks] and size classes `sizes` [blocks]."""
    depths = decoder.depths(config)[sizes, modes]
    first = first_branches(decoder, config)[sizes, modes]
    active = depths > 0
    rest = np.where(active, depths.astype(np.int64) - 1, 0)
    branches = first[:, None] + np.cumsum(active, axis=1) - active
    others = (first + active.sum(1))[:, None] + np.cumsum(rest, axis=1) - rest
    return BitPlaces(depths, first, branches, others)


def _edge_part(
    bits: NDArray[np.uint8],
    modes: NDArray[np.int64],
    sizes: NDArray[np.int64],
    decoder: BlockDecoder,
    config: BlockConfig,
    plane: int,
) -> EdgePart:
    widths = decoder.fitting_edges(config)[sizes, modes, plane].astype(np.int64)
    blocks = np.nonzero(widths)[0]
    width, channels = widths[blocks], len(config.planes[plane])
    first = edge_places(decoder, config, plane)[sizes[blocks], modes[blocks]]
    places = first[:, None] + COLOUR_BITS * np.arange(2 * channels)
    colours = _numbers(bits[blocks], places, COLOUR_BITS).astype(np.uint8).reshape(-1, 2, channels)
    begin = (first + 2 * COLOUR_BITS * channels)[:, None]
    places = begin + width[:, None] * np.arange(config.block_texels)
    indices = _numbers(bits[blocks], places, LARGEST_EDGE_BITS) & ((1 << width) - 1)[:, None]
    return EdgePart(blocks, width, colours, indices.astype(np.uint8))


def edge_parts(stored: BlockCodes, decoder: BlockDecoder, config: BlockConfig) -> tuple[EdgePart, ...]:
    """Return the edge parts of `stored`, by plane."""
    modes = (stored.codes[:, 0] & np.uint32(config.modes - 1)).astype(np.int64)
    with_parts = np.nonzero(decoder.fitting_edges(config)[stored.sizes, modes].any(axis=1))[0]
    bits, sizes = _spread(stored.codes[with_parts]), stored.sizes[with_parts]
    planes = range(len(config.planes))
    parts = [_edge_part(bits, modes[with_parts], sizes, decoder, config, plane) for plane in planes]
    return tuple(part._replace(blocks=with_parts[part.blocks]) for part in parts)


def unpacked_codes(stored: BlockCodes, decoder: BlockDecoder, config: BlockConfig) -> UnpackedCodes:
    """Return `stored` taken apart into modes, edge parts and indices."""
    bits = _spread(stored.codes)
    modes, sizes = _numbers(bits, np.zeros(len(bits), np.int64), config.mode_bits), stored.sizes
    places = bit_places(modes, sizes, decoder, config)
    active = places.depths > 0
    rest = np.where(active, places.depths.astype(np.int64) - 1, 0)
    branches = np.where(active, _numbers(bits, places.branches, 1), 0)
    others = _numbers(bits, places.others, LARGEST_DEPTH - 1) & ((1 << rest) - 1)
    edges = edge_parts(stored, decoder, config)
    indices = (others * 2 + branches).astype(np.uint32)
    return UnpackedCodes(modes, places.depths, start_states(bits, places.first), indices, edges)


class ChannelIndices(NamedTuple):
    """Indices of the coefficients of one channel, read without the others."""

    modes: NDArray[np.int64]
    """[blocks]."""
    depths: NDArray[np.int64]
    """[blocks, coefficients of the channel]."""
    states: NDArray[np.int64]
    """[blocks, coefficients of the channel] before each."""
    branches: NDArray[np.int64]
    others: NDArray[np.int64]


def channel_indices(stored: BlockCodes, decoder: BlockDecoder, config: BlockConfig, channel: int) -> ChannelIndices:
    """Return the indices of the coefficients of `channel` in `stored`."""
    modes = (stored.codes[:, 0] & np.uint32(config.modes - 1)).astype(np.int64)
    is_own_channel, sizes = decoder.channels == channel, np.arange(len(config.block_words) * config.modes)
    # Places by size and mode: far fewer than blocks.
    table = bit_places(sizes % config.modes, sizes // config.modes, decoder, config)
    rows = stored.sizes * config.modes + modes
    depths = table.depths[:, is_own_channel].astype(np.int64)[rows]
    bits = _spread(stored.codes)
    at = table.branches[:, is_own_channel][rows]
    window = _numbers(bits, at - 3, 4)
    states = (window & 1) << 2 | (window & 2) | (window >> 2 & 1)
    others = _numbers(bits, table.others[:, is_own_channel][rows], LARGEST_DEPTH - 1) & (
        (1 << np.maximum(depths - 1, 0)) - 1
    )
    return ChannelIndices(modes, depths, states, window >> 3, others)


def bits_before_branches(
    modes: NDArray[np.int64],
    sizes: NDArray[np.int64],
    edges: tuple[EdgePart, ...],
    decoder: BlockDecoder,
    config: BlockConfig,
) -> NDArray[np.uint8]:
    """Return [blocks, bits of the largest code] uint8: modes and edge parts written, all else 0."""
    bits = np.zeros((len(modes), 32 * config.block_words[-1]), np.uint8)
    _write(bits, np.arange(len(modes)), np.zeros(len(modes), np.int64), modes, config.mode_bits)
    for plane, part in enumerate(edges):
        first = edge_places(decoder, config, plane)[sizes[part.blocks], modes[part.blocks]]
        for colour in part.colours.reshape(len(part.blocks), 2 * len(config.planes[plane])).T:
            _write(bits, part.blocks, first, colour.astype(np.int64), COLOUR_BITS)
            first = first + COLOUR_BITS
        for width in np.unique(part.bits):
            of_width = part.bits == width
            for texel in range(config.block_texels):
                values = part.indices[of_width, texel].astype(np.int64)
                _write(bits, part.blocks[of_width], first[of_width] + width * texel, values, int(width))
    return bits


def _write(
    bits: NDArray[np.uint8],
    rows: NDArray[np.int64],
    first: NDArray[np.int64],
    values: NDArray[np.int64],
    count: int,
) -> None:
    for bit in range(count):
        bits[rows, first + bit] = values >> bit & 1
