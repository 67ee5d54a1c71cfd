"""Fitting the tables of a group: basis, then modes, then edge parts.

Modes are classes of blocks with similar variances of coefficients. They are fitted as in Lloyd's iteration: each block chooses the
mode of least expected error, then each mode's scales become the standard deviations of its blocks' coefficients. Bits of
coefficients follow from the scales (`trellis.share_out_bits`), so that only scales are stored. The first classes come from a few
rounds of k-means over the logarithms of the strongest coefficients' energies. Blocks at the edge of a mask form classes of their own
kind, with an edge part for alpha; the transform is fitted to what that part leaves.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from ntc.codec.block.config import BlockConfig
from ntc.codec.block.encoding.bit_allocation import RateCurve
from ntc.codec.block.encoding.blocks import Array, Sample
from ntc.codec.block.encoding.choices import block_choices
from ntc.codec.block.encoding.edge_modes import with_edge_modes
from ntc.codec.block.encoding.edges import fitted_edges
from ntc.codec.block.encoding.masks import mixed_blocks
from ntc.codec.block.encoding.quantizer import best_modes, expected_errors
from ntc.codec.block.encoding.transform import Tables, fitted_basis, one_thread, projected
from ntc.codec.block.model import BlockDecoder, stored_scales
from ntc.codec.block.trellis import scale_values

MODE_ROUNDS = 6
"""Alternations between choosing a mode for each block and fitting the modes to their blocks."""
CLASS_ROUNDS = 12
"""Rounds of the clustering that the first modes come from."""
MODE_FEATURES = 64
"""Leading coefficients whose energies the first modes are clustered by."""
CURVE_BLOCKS = 1024
"""Blocks of a texture that its rate curve is estimated from."""
FEWEST_BLOCKS = 16
"""Least number of blocks that a mode is fitted to; a rarer mode is fitted to all blocks."""
MASK_BITS = 1
"""Index bits of a texel at a mask's edge."""
LEAST_MASK_SHARE, LARGEST_MASK_SHARE = 0.125, 0.5
"""Limits of the share of modes for blocks at the edges of masks, which otherwise is the share of such blocks."""


def _fitted_scales(squares: Array, chosen: NDArray[np.int64], modes: int) -> NDArray[np.uint8]:
    """[modes, coefficients] stored scales for the blocks that chose each mode."""
    counts, sums = np.bincount(chosen, minlength=modes), np.zeros((modes, squares.shape[1]))
    used, order = np.flatnonzero(counts), np.argsort(chosen, kind="stable")
    sums[used] = np.add.reduceat(squares[order], (np.cumsum(counts) - counts)[used])
    counts = counts[:, None]
    means = np.where(counts >= FEWEST_BLOCKS, sums / np.maximum(counts, 1), sums.sum(0) / len(chosen))
    return stored_scales(np.sqrt(np.maximum(means, 1e-9)))


def first_classes(features: Array, count: int, random: np.random.Generator) -> NDArray[np.int64]:
    """[rows] class of each of `features` [rows, K], by a few rounds of Lloyd's iteration from rows chosen at random."""
    centres = features[random.permutation(len(features))[:count]]
    for _ in range(CLASS_ROUNDS):
        # Squared distances but for a summand that all classes share.
        chosen = (np.square(centres).sum(1) - 2.0 * features @ centres.T).argmin(1)
        sizes = np.bincount(chosen, minlength=len(centres))
        sums = np.stack([np.bincount(chosen, column, len(centres)) for column in features.T], axis=1)
        centres = np.where(sizes[:, None] > 0, sums / np.maximum(sizes, 1)[:, None], centres).astype(np.float32)
    classes: NDArray[np.int64] = chosen.astype(np.int64)
    return classes


def _modes(
    coefficients: Array,
    decoder: BlockDecoder,
    config: BlockConfig,
    random: np.random.Generator,
    worked: Callable[[float], None],
) -> NDArray[np.uint8]:
    """[modes, coefficients] stored scales, as many modes as `decoder` has."""
    modes = len(decoder.scales)
    squares = np.square(coefficients)
    # Leading coefficients: those of greatest variance.
    leading = np.argsort(-squares.mean(0, dtype=np.float64), kind="stable")[:MODE_FEATURES]
    energies = np.log(squares[:, leading] + np.float32(1e-4))
    scales = _fitted_scales(squares, first_classes(energies, modes, random), modes)
    worked(1.0 / (MODE_ROUNDS + 1))
    middle = len(config.block_words) // 2
    for _ in range(MODE_ROUNDS):
        depths = replace(decoder, scales=scales).depths(config)[middle]
        values = scale_values(scales).astype(np.float32)
        expected = expected_errors(coefficients, depths[None], values)[:, 0]
        chosen = best_modes(coefficients, expected, depths, values)
        scales = _fitted_scales(squares, chosen, modes)
        worked(1.0 / (MODE_ROUNDS + 1))
    return scales


def fit_decoder(
    samples: Sequence[Sample], config: BlockConfig, seed: int = 0, worked: Callable[[float], None] = lambda _share: None
) -> BlockDecoder:
    """Return the tables of a group, fitted to samples of its textures. `seed` decides where the search for modes begins. `worked` gets
    the share of the work done since its last call; what it raises ends the work."""
    random = np.random.default_rng(seed)
    with one_thread():
        mixed, rests = _with_mask_parts(samples, config)
        basis = fitted_basis(rests, config)
        blocks = np.concatenate([sample.blocks for sample in rests])
        coefficients = projected(blocks, basis.projections(config))
        # Basis, modes and edge parts count alike.
        worked(1.0 / 3.0)
        share = float(mixed.mean())
        with_parts = round(config.modes * min(max(share, LEAST_MASK_SHARE), LARGEST_MASK_SHARE)) if mixed.any() else 0
        scales = np.zeros((config.modes, config.coefficients), np.uint8)
        edges = np.zeros((config.modes, len(config.planes)), np.uint8)
        edges[config.modes - with_parts :, -1] = MASK_BITS
        decoder = BlockDecoder(basis.rows, basis.channels, basis.scale, scales, edges)
        for selected, modes in (
            (~mixed, slice(0, config.modes - with_parts)),
            (mixed, slice(config.modes - with_parts, None)),
        ):
            if selected.any():
                part = replace(decoder, scales=scales[modes], edges=edges[modes])
                of_blocks = coefficients if selected.all() else coefficients[selected]
                done = partial(_part_done, worked, float(selected.mean()) / 3.0)
                scales[modes] = _modes(of_blocks, part, config, random, done)
        decoder = with_edge_modes(decoder, samples, config)
        worked(1.0 / 3.0)
        return decoder


def _part_done(worked: Callable[[float], None], part: float, share: float) -> None:
    worked(part * share)


def _with_mask_parts(samples: Sequence[Sample], config: BlockConfig) -> tuple[NDArray[np.bool_], list[Sample]]:
    """([blocks] which of all blocks of `samples` lie at the edge of a mask, `samples` of what an edge part leaves of these)."""
    mixed = [mixed_blocks(sample.blocks, sample.axes, config) for sample in samples]
    bits, rests = (*(0,) * (len(config.planes) - 1), MASK_BITS), list(samples)
    for number, (sample, selected) in enumerate(zip(samples, mixed, strict=True)):
        if selected.any():
            blocks = sample.blocks.copy()
            blocks[selected] = fitted_edges(blocks[selected], sample.axes, bits, config).rest
            rests[number] = replace(sample, blocks=blocks)
    return np.concatenate(mixed), rests


def rate_curve(sample: Sample, decoder: BlockDecoder, config: BlockConfig) -> RateCurve:
    """Return the rate curve of a texture under `decoder`, from a sample of its blocks."""
    with one_thread():
        blocks = sample.blocks[:CURVE_BLOCKS]
        choices = block_choices(blocks, sample.axes, Tables.of(decoder, config), decoder, config)
        # Errors of mip 0, plus what its best modes cost the derived mip beyond other modes.
        expected = choices.errors - choices.unavoidable[:, None]
    # In units of values in [0, 1], because textures are compared.
    errors = expected * np.float32(sample.axes.contrast**2 / config.block_values)
    return RateCurve(errors, config.block_words, sample.block_count)


def coefficient_energies(sample: Sample, decoder: BlockDecoder, config: BlockConfig) -> Array:
    """Return [coefficients] float32: the mean squared error of a texture's values without each coefficient."""
    with one_thread():
        values = Tables.of(decoder, config).project(sample.blocks)
    scale = np.float32(sample.axes.contrast**2 / config.block_values)
    return np.asarray(np.square(values).mean(0, dtype=np.float64), np.float32) * scale
