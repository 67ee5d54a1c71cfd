"""Edge parts of blocks: two colours and an index per texel, fitted by least squares (`compiled_edges`).

A transform spends many bits on sharp edges between flat colours, as in lettering. An edge part codes them as BC1 does: two colours and
an index between them for each texel. The transform then codes what is left. A mip that is derived from a code with an edge part
averages its colours in squares, near to linear light, and so differs from averages of the transform: `derived_costs` measures that
difference, so that modes are compared by all mips of a code (docs/reference/codec-block.md).
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ntc.codec.block.codes import EdgePart
from ntc.codec.block.config import BlockConfig
from ntc.codec.block.encoding import compiled_edges
from ntc.codec.block.encoding.blocks import Array, Axes
from ntc.codec.block.encoding.masks import alpha_values, mask_part
from ntc.codec.block.model import BlockDecoder
from ntc.codec.block.reference import edge_values

DERIVED_WEIGHT = 1.0
"""Weight of a squared error in the derived mip, relative to one in mip 0, which has four times as many texels."""
ROUNDS = 4
"""Alternations between the indices of texels and the colours that fit them."""


class EdgeKind(NamedTuple):
    """Modes of a decoder that have the same edge parts."""

    bits: tuple[int, ...]
    """Index bits per texel by plane; 0: no edge part."""
    modes: NDArray[np.int64]


def edge_kinds(decoder: BlockDecoder) -> list[EdgeKind]:
    """Return the kinds of edge parts of `decoder`, modes without edge parts first."""
    rows = [tuple(row) for row in decoder.edges.tolist()]
    distinct = sorted(set(rows))
    return [
        EdgeKind(bits, np.array([mode for mode, mode_bits in enumerate(rows) if mode_bits == bits]))
        for bits in distinct
    ]


class EdgeFit(NamedTuple):
    """Blocks with edge parts."""

    parts: tuple[EdgePart, ...]
    """Edge parts by plane."""
    rest: Array
    """[blocks, texels x channels]: normalised values that are left for the transform."""


def fitted_edges(
    blocks: Array, axes: Axes, bits: tuple[int, ...], config: BlockConfig, rounds: int = ROUNDS
) -> EdgeFit:
    """Return edge parts with `bits` by plane for normalised `blocks` [blocks, texels x channels], fitted in at most `rounds`
    rounds."""
    if not any(bits):
        return EdgeFit(tuple(_no_part(config, channels) for channels in config.planes), blocks)
    shown = blocks.reshape(-1, config.block_texels, config.output_channels)
    weights = np.linalg.norm(axes.inverse, axis=1)
    rest, parts = shown.copy(), []
    for channels, index_bits in zip(config.planes, bits, strict=True):
        if not index_bits:
            parts.append(_no_part(config, channels))
            continue
        colours, indices = _room_for(len(blocks), config, len(channels))
        numbers, means, to_values, inverse = _plane_of(axes, channels)
        squares, largest = _squares(weights[numbers]), (1 << index_bits) - 1
        compiled_edges.fit_plane(
            shown, numbers, means[0], to_values, inverse, squares, largest, rounds, colours, indices, rest
        )
        parts.append(EdgePart(np.arange(len(blocks)), np.full(len(blocks), index_bits), colours, indices))
    return _with_sides(EdgeFit(tuple(parts), rest.reshape(blocks.shape)), blocks, axes, config)


def _with_sides(fit: EdgeFit, blocks: Array, axes: Axes, config: BlockConfig) -> EdgeFit:
    """Return `fit` with each texel of a mask on its side of the cutoff; unchanged for other textures."""
    part = fit.parts[-1]
    if axes.cutoff is None or not len(part.blocks):
        return fit
    values = alpha_values(blocks, axes, config)
    sided = mask_part(part, values * np.float32(255.0), 255.0 * axes.cutoff)
    left = values - edge_values(sided, config, 0)[..., 0].astype(np.float32)
    fit.rest.reshape(-1, config.block_texels, config.output_channels)[..., -1] = left * axes.inverse[-1, -1]
    return EdgeFit((*fit.parts[:-1], sided), fit.rest)


def derived_costs(blocks: Array, fit: EdgeFit, axes: Axes, config: BlockConfig) -> Array:
    """Return [blocks]: DERIVED_WEIGHT times the squared error of the next mip of `blocks`, which is derived from them with the parts
    of `fit`, if the transform shows all that is left. Averages by squares serve as the truth. 0 where no mip is derived."""
    costs = np.zeros(len(blocks), np.float32)
    if not axes.has_derived:
        return costs
    shape = (-1, config.block_texels, config.output_channels)
    for channels, part in zip(config.planes, fit.parts, strict=True):
        has_part = len(part.blocks) > 0
        colours, indices = (part.colours, part.indices) if has_part else _room_for(1, config, len(channels))
        compiled_edges.add_derived(
            blocks.reshape(shape),
            fit.rest.reshape(shape),
            config.block_side,
            *_plane_of(axes, channels),
            axes.colours[list(channels)],
            (1 << int(part.bits[0])) - 1 if has_part else 0,
            colours,
            indices,
            costs,
        )
    return costs * np.float32(DERIVED_WEIGHT)


def costs_without_edges(blocks: Array, axes: Axes, config: BlockConfig) -> Array:
    """Return [blocks]: `derived_costs` of modes without edge parts."""
    return derived_costs(blocks, fitted_edges(blocks, axes, (0,) * len(config.planes), config), axes, config)


def _no_part(config: BlockConfig, channels: tuple[int, ...]) -> EdgePart:
    none = np.zeros(0, np.int64)
    texels = np.zeros((0, config.block_texels), np.uint8)
    return EdgePart(none, none, np.zeros((0, 2, len(channels)), np.uint8), texels)


def _squares(weights: NDArray[np.floating]) -> Array:
    """Return [channels]: relative weights of squared errors, at most 1."""
    return np.asarray(np.square(weights / max(float(weights.max()), 1e-9)).astype(np.float32))


def _plane_of(axes: Axes, channels: tuple[int, ...]) -> tuple[NDArray[np.int64], Array, Array, Array]:
    """Return (channels, means by mip, axes, inverse) of a plane: axes never mix planes."""
    plane = np.ix_(channels, channels)
    means = np.ascontiguousarray(axes.mean[:, list(channels)])
    return np.array(channels, np.int64), means, axes.axes[plane], axes.inverse[plane]


def _room_for(blocks: int, config: BlockConfig, channels: int) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
    """Return zeros for the (colours, indices) of `blocks` blocks."""
    return np.zeros((blocks, 2, channels), np.uint8), np.zeros((blocks, config.block_texels), np.uint8)
