"""Edge parts of blocks: two colours and an index a texel, found by least squares. They mend flat graphics, which no transform codes
well."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ntc.codec.block.codes import EdgePart
from ntc.codec.block.config import BlockConfig
from ntc.codec.block.encoding.blocks import Array, Axes
from ntc.codec.block.encoding.masks import alpha_values, mask_part
from ntc.codec.block.model import BlockDecoder
from ntc.codec.block.reference import edge_values

compiled: Any
try:
    from ntc.codec.block.encoding import compiled_edges as compiled
except ImportError:
    compiled = None

DERIVED_WORTH = 1.0
"""Of a squared error in the derived mip, beside one in mip 0, which has four times as many texels."""
ROUNDS = 4
"""Alternations between the indices of texels and the colours that fit them."""
POWER_ROUNDS = 6
"""Of the iteration that finds a block's principal direction."""


class EdgeKind(NamedTuple):
    """Modes of a decoder that have the same edge parts."""

    bits: tuple[int, ...]
    """By plane: index bits a texel; 0: no edge part."""
    modes: NDArray[np.int64]


def edge_kinds(decoder: BlockDecoder) -> list[EdgeKind]:
    """Those of `decoder`, that of modes without edge parts first."""
    rows = [tuple(row) for row in decoder.edges.tolist()]
    found = sorted(set(rows))
    return [EdgeKind(bits, np.array([mode for mode, own in enumerate(rows) if own == bits])) for bits in found]


class EdgeFit(NamedTuple):
    """Blocks with edge parts."""

    parts: tuple[EdgePart, ...]
    """By plane."""
    rest: Array
    """[blocks, texels x channels] what is left for the transform, normalised."""


def fitted_edges(
    blocks: Array, axes: Axes, bits: tuple[int, ...], config: BlockConfig, rounds: int = ROUNDS
) -> EdgeFit:
    """Edge parts of `bits` by plane for normalised `blocks` [blocks, texels x channels], after so many rounds. Compiled where numba is
    installed."""
    if not any(bits):
        return EdgeFit(tuple(_no_part(config, channels) for channels in config.planes), blocks)
    if compiled is None:
        return _with_sides(fitted_edges_by_numpy(blocks, axes, bits, config, rounds), blocks, axes, config)
    shown = blocks.reshape(-1, config.block_texels, config.output_channels)
    weights = np.linalg.norm(axes.inverse, axis=1)
    rest, parts = shown.copy(), []
    for channels, own in zip(config.planes, bits, strict=True):
        if not own:
            parts.append(_no_part(config, channels))
            continue
        colours, indices = _room_for(len(blocks), config, len(channels))
        numbers, means, to_values, inverse = _plane_of(axes, channels)
        squares, largest = _squares(weights[numbers]), (1 << own) - 1
        compiled.fit_plane(
            shown, numbers, means[0], to_values, inverse, squares, largest, rounds, colours, indices, rest
        )
        parts.append(EdgePart(np.arange(len(blocks)), np.full(len(blocks), own), colours, indices))
    return _with_sides(EdgeFit(tuple(parts), rest.reshape(blocks.shape)), blocks, axes, config)


def _with_sides(fit: EdgeFit, blocks: Array, axes: Axes, config: BlockConfig) -> EdgeFit:
    """`fit` of a mask with each texel on its side of the cutoff; that of another texture as it is."""
    part = fit.parts[-1]
    if axes.cutoff is None or not len(part.blocks):
        return fit
    values = alpha_values(blocks, axes, config)
    sided = mask_part(part, values * np.float32(255.0), 255.0 * axes.cutoff)
    left = values - edge_values(sided, config, 0)[..., 0].astype(np.float32)
    fit.rest.reshape(-1, config.block_texels, config.output_channels)[..., -1] = left * axes.inverse[-1, -1]
    return EdgeFit((*fit.parts[:-1], sided), fit.rest)


def fitted_edges_by_numpy(
    blocks: Array, axes: Axes, bits: tuple[int, ...], config: BlockConfig, rounds: int = ROUNDS
) -> EdgeFit:
    """As `fitted_edges`, without compiled code."""
    shown = blocks.reshape(-1, config.block_texels, config.output_channels)
    values = axes.mean[0] + shown @ axes.axes.T
    weights = np.linalg.norm(axes.inverse, axis=1)
    # What edge parts show takes the place of the mean.
    rest, parts = values - axes.mean[0], []
    for channels, own in zip(config.planes, bits, strict=True):
        columns = list(channels)
        if not own:
            parts.append(_no_part(config, channels))
            continue
        colours, indices = two_colours_by_numpy(
            values[..., columns] * np.float32(255.0), _squares(weights[columns]), own, rounds
        )
        part = EdgePart(np.arange(len(blocks)), np.full(len(blocks), own), colours, indices)
        rest[..., columns] = values[..., columns] - edge_values(part, config, 0).astype(np.float32)
        parts.append(part)
    return EdgeFit(tuple(parts), (rest @ axes.inverse).reshape(blocks.shape).astype(np.float32))


def derived_costs(blocks: Array, fit: EdgeFit, axes: Axes, config: BlockConfig) -> Array:
    """[blocks] DERIVED_WORTH times the squared error of the next mip of `blocks`, which is derived from them with the parts of `fit`,
    if the transform shows all that is left. Its truth is taken for the average by squares. 0 where none is derived. Compiled where
    numba is installed."""
    costs = np.zeros(len(blocks), np.float32)
    if not axes.has_derived:
        return costs
    if compiled is None:
        return derived_costs_by_numpy(blocks, fit, axes, config)
    shape = (-1, config.block_texels, config.output_channels)
    for channels, part in zip(config.planes, fit.parts, strict=True):
        has_part = len(part.blocks) > 0
        colours, indices = (part.colours, part.indices) if has_part else _room_for(1, config, len(channels))
        compiled.add_derived(
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
    return costs * np.float32(DERIVED_WORTH)


def derived_costs_by_numpy(blocks: Array, fit: EdgeFit, axes: Axes, config: BlockConfig) -> Array:
    """As `derived_costs` where a mip is derived, without compiled code."""
    values = axes.mean[0] + blocks.reshape(-1, config.block_texels, config.output_channels) @ axes.axes.T
    squares = np.sqrt(_halved(np.square(values), config))
    missed = np.where(axes.colours, squares, _halved(values, config)) - axes.mean[1]
    for channels, part in zip(config.planes, fit.parts, strict=True):
        if len(part.blocks):
            columns = list(channels)
            shown = edge_values(part, config, 1, axes.colours[columns]).astype(np.float32)
            missed[..., columns] += axes.mean[1][columns] - shown
    rest = _halved(fit.rest.reshape(-1, config.block_texels, config.output_channels), config)
    return np.asarray(np.square(missed @ axes.inverse - rest).sum((1, 2)) * np.float32(DERIVED_WORTH))


def costs_without_edges(blocks: Array, axes: Axes, config: BlockConfig) -> Array:
    """[blocks] `derived_costs` of modes without edge parts."""
    return derived_costs(blocks, fitted_edges(blocks, axes, (0,) * len(config.planes), config), axes, config)


def _halved(texels: Array, config: BlockConfig) -> Array:
    """[blocks, texels / 4, channels]: `texels` [blocks, texels, channels] averaged over 2x2 texels."""
    half = config.block_side // 2
    parts = texels.reshape(-1, half, 2, half, 2, config.output_channels)
    sums = parts[:, :, 0, :, 0] + parts[:, :, 0, :, 1] + parts[:, :, 1, :, 0] + parts[:, :, 1, :, 1]
    return np.asarray(sums.reshape(-1, half * half, config.output_channels) * np.float32(0.25))


def _no_part(config: BlockConfig, channels: tuple[int, ...]) -> EdgePart:
    none = np.zeros(0, np.int64)
    texels = np.zeros((0, config.block_texels), np.uint8)
    return EdgePart(none, none, np.zeros((0, 2, len(channels)), np.uint8), texels)


def _squares(weights: NDArray[np.floating]) -> Array:
    """[channels] what squared errors are worth beside each other."""
    return np.asarray(np.square(weights / max(float(weights.max()), 1e-9)).astype(np.float32))


def _plane_of(axes: Axes, channels: tuple[int, ...]) -> tuple[NDArray[np.int64], Array, Array, Array]:
    """(channels, means by mip, axes, inverse) of a plane: axes never mix planes."""
    own = np.ix_(channels, channels)
    means = np.ascontiguousarray(axes.mean[:, list(channels)])
    return np.array(channels, np.int64), means, axes.axes[own], axes.inverse[own]


def _room_for(blocks: int, config: BlockConfig, channels: int) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
    """Zeros for the (colours, indices) of so many blocks."""
    return np.zeros((blocks, 2, channels), np.uint8), np.zeros((blocks, config.block_texels), np.uint8)


def two_colours_by_numpy(
    values: Array, squares: Array, bits: int, rounds: int = ROUNDS
) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
    """(colours [blocks, 2, channels] uint8, indices [blocks, texels] uint8) nearest to `values` [blocks, texels, channels], which are
    in steps of 8 bits; `squares` [channels]: what their squared errors are worth."""
    largest = (1 << bits) - 1
    mean = values.mean(1, keepdims=True)
    centred = values - mean
    direction = _principal(centred * np.sqrt(squares))
    place = np.einsum("btc,bc->bt", centred * np.sqrt(squares), direction)
    shares = np.stack([place.argmin(1), place.argmax(1)], axis=1)
    colours = np.take_along_axis(values, shares[..., None], axis=1)
    best = np.full(len(values), np.inf, np.float32)
    found = np.zeros((len(values), 2, values.shape[2]), np.uint8)
    indices = np.zeros(values.shape[:2], np.uint8)
    for _ in range(rounds):
        stored = np.clip(np.rint(colours), 0.0, 255.0).astype(np.float32)
        step = stored[:, 1] - stored[:, 0]
        length = np.maximum((step * step * squares).sum(1), 1e-9)
        share = np.einsum("btc,bc->bt", values - stored[:, :1], step * squares) / length[:, None]
        number = np.clip(np.rint(share * largest), 0, largest)
        share = (number / largest).astype(np.float32)
        shown = stored[:, :1] + share[..., None] * step[:, None]
        error = (np.square(values - shown) * squares).sum((1, 2))
        better = error < best
        best = np.where(better, error, best)
        found[better], indices[better] = stored[better].astype(np.uint8), number[better].astype(np.uint8)
        colours = _colours_for(values, share, stored)
    return found, indices


def _principal(centred: Array) -> Array:
    """[blocks, channels] about the direction of greatest variance of `centred` [blocks, texels, channels]."""
    covariance = np.einsum("btc,btd->bcd", centred, centred)
    direction = covariance.sum(2) + 1e-6
    for _ in range(POWER_ROUNDS):
        direction = np.einsum("bcd,bd->bc", covariance, direction)
        direction /= np.linalg.norm(direction, axis=1, keepdims=True) + 1e-12
    return np.asarray(direction, np.float32)


def _colours_for(values: Array, share: Array, before: Array) -> Array:
    """[blocks, 2, channels]: colours of least squared error for the `share` [blocks, texels] of the second one in each texel."""
    rest = 1.0 - share
    first, both, second = (rest * rest).sum(1), (rest * share).sum(1), (share * share).sum(1)
    determinant = first * second - both * both
    to_first, to_second = np.einsum("bt,btc->bc", rest, values), np.einsum("bt,btc->bc", share, values)
    safe = np.where(determinant > 1e-4, determinant, 1.0)[:, None]
    found = np.stack(
        [
            (second[:, None] * to_first - both[:, None] * to_second) / safe,
            (first[:, None] * to_second - both[:, None] * to_first) / safe,
        ],
        axis=1,
    )
    return np.where((determinant > 1e-4)[:, None, None], found, before).astype(np.float32)
