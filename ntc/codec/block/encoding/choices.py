"""The choice of modes for blocks, by estimates of their errors.

A mode says how many bits each coefficient gets and whether a plane has an edge part. For each kind of edge parts, the parts are fitted
first, then the transform of what they leave is estimated in all modes of that kind at once (`quantizer.expected_errors`). The estimate
adds what the basis cannot represent, and the error of the derived mip where the kinds differ in it. Each block keeps the two best
modes at each size of code; the search of the trellis later decides between them. Kinds that help no part of a sample are left out.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from ntc.codec.block.config import BlockConfig
from ntc.codec.block.encoding import compiled_modes
from ntc.codec.block.encoding.blocks import Array, Axes, PreparedTexture
from ntc.codec.block.encoding.edges import EdgeKind, costs_without_edges, derived_costs, edge_kinds, fitted_edges
from ntc.codec.block.encoding.masks import side_costs
from ntc.codec.block.encoding.quantizer import expected_errors
from ntc.codec.block.encoding.rate import JUDGED_BLOCKS
from ntc.codec.block.encoding.transform import Tables
from ntc.codec.block.model import BlockDecoder

CANDIDATES = 2
"""Modes that are searched for each block: with more of them, pictures were not nearer."""
ROUNDS_TO_CHOOSE = 2
"""Rounds of fitting edge parts to choose modes; codes take `edges.ROUNDS`."""
LEAST_GAIN = 0.005
"""Share of the error that a kind of edge parts must take away."""


@dataclass(frozen=True, eq=False)
class Choices:
    """Expected errors and best modes of some blocks."""

    errors: Array
    """[blocks, sizes] float32: least expected squared error, in units of the axes, with `derived_costs` where edge parts are compared.
    """
    unavoidable: Array
    """[blocks] float32: the part of `derived_costs` that every mode has."""
    modes: NDArray[np.uint8]
    """[blocks, sizes, CANDIDATES] modes of the least expected errors."""

    @classmethod
    def joined(cls, parts: "Sequence[Choices]") -> "Choices":
        """Return the choices of the blocks of all `parts`, one after the other."""
        return cls(*(np.concatenate([getattr(part, field.name) for part in parts]) for field in fields(cls)))

    def of_first(self, blocks: int) -> "Choices":
        """Return the choices of the first `blocks` blocks."""
        return Choices(self.errors[:blocks], self.unavoidable[:blocks], self.modes[:blocks])


def left_out(blocks: Array, values: Array) -> Array:
    """[blocks] squared error of what the basis cannot show of `blocks`, whatever their coefficients `values` become."""
    whole, shown = (np.einsum("bk,bk->b", each, each) for each in (blocks, values))
    left: Array = np.maximum(whole - shown, np.float32(0.0))
    return left


def paying_kinds(
    texture: PreparedTexture, tables: Tables, decoder: BlockDecoder, config: BlockConfig
) -> tuple[EdgeKind, ...]:
    """Return the kinds of edge parts that lower the error of `texture` by LEAST_GAIN at some size of codes, judged by a sample of
    its blocks; modes without edge parts, where there are any, come first."""
    kinds = edge_kinds(decoder)
    if len(kinds) == 1:
        return tuple(kinds)
    rows = np.unique(np.linspace(0, len(texture.texels) - 1, JUDGED_BLOCKS).astype(np.int64))
    blocks = texture.normalised(rows)
    least = block_choices(blocks, texture.axes, tables, decoder, config, kinds[:1]).errors
    if not any(kinds[0].bits):
        least += costs_without_edges(blocks, texture.axes, config)[:, None]
    useful = kinds[:1]
    for kind in kinds[1:]:
        errors = np.minimum(least, block_choices(blocks, texture.axes, tables, decoder, config, (kind,)).errors)
        if (errors.sum(0, np.float64) < (1.0 - LEAST_GAIN) * least.sum(0, np.float64)).any():
            useful.append(kind)
    return tuple(useful)


def block_choices(
    blocks: Array,
    axes: Axes,
    tables: Tables,
    decoder: BlockDecoder,
    config: BlockConfig,
    kinds: Sequence[EdgeKind] | None = None,
) -> Choices:
    """Return the choices for normalised `blocks` [blocks, texels x channels] of a texture with `axes`, among modes of `kinds`; None:
    all."""
    sizes = len(config.block_words)
    kinds = edge_kinds(decoder) if kinds is None else kinds
    every = sum(len(kind.modes) for kind in kinds) == config.modes
    if len(kinds) > 1 or not every:
        expected = np.full((len(blocks), sizes, config.modes), np.inf, np.float32)
    unavoidable: Array | None = None
    fits = (decoder.fitting_edges(config) == decoder.edges).all(2)
    for kind in kinds:
        fit = fitted_edges(blocks, axes, kind.bits, config, ROUNDS_TO_CHOOSE)
        values = tables.project(fit.rest)
        estimates = expected_errors(values, tables.depths[:, kind.modes], tables.scales[kind.modes])
        estimates += (left_out(fit.rest, values) + side_costs(blocks, kind.bits, axes, config))[:, None, None]
        if len(kinds) > 1 or any(kind.bits):
            costs = derived_costs(blocks, fit, axes, config)
            estimates += costs[:, None, None]
            unavoidable = costs if unavoidable is None else np.minimum(unavoidable, costs)
        if len(kinds) == 1 and every and fits.all():
            expected = estimates
            break
        expected[:, :, kind.modes] = np.where(fits[:, kind.modes], estimates, np.float32(np.inf))
    unavoidable = np.zeros(len(blocks), np.float32) if unavoidable is None else unavoidable
    errors = np.empty((len(blocks), sizes), np.float32)
    modes = np.empty((len(blocks), sizes, CANDIDATES), np.uint8)
    compiled_modes.two_least(expected, errors, modes)
    return Choices(errors, unavoidable, modes)
