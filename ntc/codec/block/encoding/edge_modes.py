"""Modes with edge parts: they take the place of modes that few blocks choose, where they lower the errors of some texture."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ntc.codec.block.config import LARGEST_EDGE_BITS, BlockConfig
from ntc.codec.block.encoding.blocks import Sample
from ntc.codec.block.encoding.choices import block_choices, left_out
from ntc.codec.block.encoding.edges import costs_without_edges, derived_costs, fitted_edges
from ntc.codec.block.encoding.masks import side_costs
from ntc.codec.block.encoding.quantizer import expected_errors
from ntc.codec.block.encoding.transform import Tables
from ntc.codec.block.model import BlockDecoder, stored_scales
from ntc.codec.block.trellis import scale_values

COMPARED_BLOCKS = 2000
"""Of a group's sample, about."""
LEAST_GAIN = 0.03
"""Share of some texture's error, at some size of codes, that a mode with edge parts must take away."""
LARGEST_SHARE = 8
"""One mode of so many has edge parts at most."""
FITTING_ROUNDS = 2
FEWEST_BLOCKS = 16


def with_edge_modes(decoder: BlockDecoder, samples: Sequence[Sample], config: BlockConfig) -> BlockDecoder:
    """`decoder` with as many modes with edge parts as `samples` gain by."""
    each = max(1, COMPARED_BLOCKS // len(samples))
    few = [replace(sample, blocks=sample.blocks[:each]) for sample in samples]
    tables = Tables.of(decoder, config)
    choices = [block_choices(sample.blocks, sample.axes, tables, decoder, config) for sample in few]
    least = np.concatenate([own.errors for own in choices])
    bare = [costs_without_edges(sample.blocks, sample.axes, config) for sample in few]
    least += np.concatenate(bare)[:, None]
    middle = len(config.block_words) // 2
    uses = np.bincount(
        np.concatenate([own.modes[:, middle, 0] for own in choices]).astype(np.int64), minlength=config.modes
    )
    rarest = np.argsort(uses, kind="stable")
    owner = np.repeat(np.arange(len(few)), [len(sample.blocks) for sample in few])
    trials = [_Trial(bits, few, tables, config) for bits in _possible(config)]
    scales, edges = decoder.scales.copy(), decoder.edges.copy()
    for mode in rarest[: config.modes // LARGEST_SHARE]:
        found = [trial.fitted(least, config) for trial in trials]
        gains = [_gain(least, errors, owner) for _, errors in found]
        if not gains or max(gains) < LEAST_GAIN:
            break
        best = int(np.argmax(gains))
        scales[mode], edges[mode] = found[best][0], trials.pop(best).bits
        least = np.minimum(least, found[best][1])
    return replace(decoder, scales=scales, edges=edges)


def _possible(config: BlockConfig) -> list[tuple[int, ...]]:
    planes = range(len(config.planes))
    return [
        tuple(bits if plane == own else 0 for plane in planes)
        for own in planes
        for bits in range(1, LARGEST_EDGE_BITS + 1)
        if config.edge_part_bits(own, bits) <= 32 * config.block_words[-1] - config.mode_bits
    ]


def _gain(least: NDArray[np.float32], errors: NDArray[np.float32], owner: NDArray[np.int64]) -> float:
    """The largest share of a texture's error that `errors` take away, at any size of codes."""
    gain = 0.0
    for size in range(least.shape[1]):
        before = np.bincount(owner, least[:, size])
        after = np.bincount(owner, np.minimum(least[:, size], errors[:, size]))
        gain = max(gain, float((1.0 - after / np.maximum(before, 1e-12)).max()))
    return gain


class _Trial:
    """A kind of edge parts, tried on samples."""

    def __init__(self, bits: tuple[int, ...], samples: Sequence[Sample], tables: Tables, config: BlockConfig) -> None:
        self.bits = bits
        fits = [fitted_edges(sample.blocks, sample.axes, bits, config) for sample in samples]
        self._rest = np.concatenate([fit.rest for fit in fits])
        costs = [
            derived_costs(sample.blocks, fit, sample.axes, config)
            + side_costs(sample.blocks, bits, sample.axes, config)
            for sample, fit in zip(samples, fits, strict=True)
        ]
        self._costs = np.concatenate(costs)
        self._values = tables.project(self._rest)

    def fitted(self, least: NDArray[np.float32], config: BlockConfig) -> tuple[NDArray[np.uint8], NDArray[np.float32]]:
        """(scales [coefficients], expected errors [blocks, sizes]) of a mode for the blocks that gain by it beside `least`."""
        own = np.square(self._rest).sum(1) + self._costs < least[:, len(config.block_words) // 2]
        squares = np.square(self._values)
        for _ in range(FITTING_ROUNDS):
            used = squares[own] if own.sum() >= FEWEST_BLOCKS else squares
            variance = used.mean(0, dtype=np.float64)
            scales = stored_scales(np.sqrt(np.maximum(variance, 1e-9)))
            errors = self._errors(scales, config)
            own = np.asarray((errors < least).any(1))
        return scales, errors

    def _errors(self, scales: NDArray[np.uint8], config: BlockConfig) -> NDArray[np.float32]:
        count = self._values.shape[1]
        none = np.zeros((count, config.block_texels), np.int8)
        zeros = np.zeros(count, np.uint8)
        alone = BlockDecoder(none, zeros, zeros, scales[None], np.array([self.bits], np.uint8))
        values = scale_values(scales[None]).astype(np.float32)
        errors = expected_errors(self._values, alone.depths(config), values)[..., 0]
        errors += (left_out(self._rest, self._values) + self._costs)[:, None]
        fits = (alone.fitting_edges(config) == alone.edges).all(2)[:, 0]
        return np.where(fits, errors, np.float32(np.inf))
