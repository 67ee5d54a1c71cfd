"""Modes with edge parts, which replace rarely chosen modes where they lower the error of some texture.

Which planes have edge parts, and with how many index bits, is tried kind by kind on samples. Each trial fits a mode to the blocks that
gain by it, as Lloyd's iteration does: scales from the coefficients of these blocks, then the blocks whose error falls. The kind with
the largest gain in any texture takes the place of the rarest mode. This repeats until no kind gains LEAST_GAIN, or one mode in
LARGEST_SHARE has edge parts. A gain counts by texture: flat graphics are few among photographs, and gain most.
"""

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
"""Approximate number of a group's sampled blocks that kinds are compared on."""
LEAST_GAIN = 0.03
"""Share of some texture's error, at some size of codes, that a mode with edge parts must take away."""
LARGEST_SHARE = 8
"""Modes for each one that has edge parts, at least."""
FITTING_ROUNDS = 2
FEWEST_BLOCKS = 16


def with_edge_modes(decoder: BlockDecoder, samples: Sequence[Sample], config: BlockConfig) -> BlockDecoder:
    """Return `decoder` with the modes with edge parts that lower the errors of `samples`."""
    each = max(1, COMPARED_BLOCKS // len(samples))
    few = [replace(sample, blocks=sample.blocks[:each]) for sample in samples]
    tables = Tables.of(decoder, config)
    choices = [block_choices(sample.blocks, sample.axes, tables, decoder, config) for sample in few]
    least = np.concatenate([of_sample.errors for of_sample in choices])
    bare = [costs_without_edges(sample.blocks, sample.axes, config) for sample in few]
    least += np.concatenate(bare)[:, None]
    middle = len(config.block_words) // 2
    uses = np.bincount(
        np.concatenate([of_sample.modes[:, middle, 0] for of_sample in choices]).astype(np.int64),
        minlength=config.modes,
    )
    rarest = np.argsort(uses, kind="stable")
    owner = np.repeat(np.arange(len(few)), [len(sample.blocks) for sample in few])
    trials = [_Trial(bits, few, tables, config) for bits in _possible(config)]
    scales, edges = decoder.scales.copy(), decoder.edges.copy()
    for mode in rarest[: config.modes // LARGEST_SHARE]:
        fits = [trial.fitted(least, config) for trial in trials]
        gains = [_gain(least, errors, owner) for _, errors in fits]
        if not gains or max(gains) < LEAST_GAIN:
            break
        best = int(np.argmax(gains))
        scales[mode], edges[mode] = fits[best][0], trials.pop(best).bits
        least = np.minimum(least, fits[best][1])
    return replace(decoder, scales=scales, edges=edges)


def _possible(config: BlockConfig) -> list[tuple[int, ...]]:
    planes = range(len(config.planes))
    return [
        tuple(bits if plane == with_part else 0 for plane in planes)
        for with_part in planes
        for bits in range(1, LARGEST_EDGE_BITS + 1)
        if config.edge_part_bits(with_part, bits) <= 32 * config.block_words[-1] - config.mode_bits
    ]


def _gain(least: NDArray[np.float32], errors: NDArray[np.float32], owner: NDArray[np.int64]) -> float:
    """Return the largest share of a texture's error that `errors` remove, at any size of codes."""
    gain = 0.0
    for size in range(least.shape[1]):
        before = np.bincount(owner, least[:, size])
        after = np.bincount(owner, np.minimum(least[:, size], errors[:, size]))
        gain = max(gain, float((1.0 - after / np.maximum(before, 1e-12)).max()))
    return gain


class _Trial:
    """One kind of edge parts, fitted to samples."""

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
        gaining = np.square(self._rest).sum(1) + self._costs < least[:, len(config.block_words) // 2]
        squares = np.square(self._values)
        for _ in range(FITTING_ROUNDS):
            used = squares[gaining] if gaining.sum() >= FEWEST_BLOCKS else squares
            variance = used.mean(0, dtype=np.float64)
            scales = stored_scales(np.sqrt(np.maximum(variance, 1e-9)))
            errors = self._errors(scales, config)
            gaining = np.asarray((errors < least).any(1))
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
