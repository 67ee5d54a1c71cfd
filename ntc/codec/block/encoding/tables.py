"""Fitting what a group shares: basis and modes. Torch on the CPU, float32."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray

from ntc.codec.block.config import BlockConfig
from ntc.codec.block.encoding.blocks import Array, Sample
from ntc.codec.block.encoding.quantizer import best_modes, expected_errors
from ntc.codec.block.encoding.sharing import RateCurve
from ntc.codec.block.model import BlockDecoder, scale_values, stored_scales

MODE_ROUNDS = 6
"""Alternations between choosing a mode for each block and fitting the modes to their blocks."""
CLASS_ROUNDS = 12
"""Rounds of the clustering that the first modes come from."""
MODE_FEATURES = 24
"""Leading coefficients whose energies the first modes are clustered by."""
MODE_FEATURES_OF_SETS = 64
"""Of material sets: those of all maps."""
FEWEST_BLOCKS = 16
"""A mode that fewer blocks chose is fitted to all."""


@dataclass(frozen=True, eq=False)
class Tables:
    """A decoder's tables as the encoder reads them."""

    projection: torch.Tensor
    """[values of a block, coefficients] float32: blocks times this are the coefficients of least squared error."""
    depths: torch.Tensor
    """[sizes, modes, coefficients] int64."""
    scales: torch.Tensor
    """[modes, coefficients] float32."""

    @classmethod
    def of(cls, decoder: BlockDecoder, config: BlockConfig) -> "Tables":
        """Those of `decoder`."""
        depths = torch.from_numpy(decoder.depths(config).astype(np.int64))
        scales = torch.from_numpy(scale_values(decoder.scales).astype(np.float32))
        return cls(_projection(decoder.basis, decoder.basis_scale), depths, scales)


def _basis(blocks: Array, config: BlockConfig) -> tuple[NDArray[np.int8], Array]:
    """(basis, basis_scale) of BlockDecoder: leading principal directions of `blocks` about 0, rounded to 8 bits."""
    if config.has_sets:
        return _basis_by_channel(blocks, config)
    values = torch.from_numpy(blocks).double()
    vectors = torch.linalg.eigh(values.T @ values / len(blocks))[1].numpy()[:, ::-1].T[: config.coefficients]
    vectors = vectors * np.where(vectors.sum(1, keepdims=True) < 0.0, -1.0, 1.0)
    scale = np.abs(vectors).max(1) / 127.0
    rounded = np.rint(vectors / scale[:, None]).astype(np.int8)
    return rounded.reshape(len(vectors), config.block_texels, config.output_channels), scale.astype(np.float32)


def _basis_by_channel(blocks: Array, config: BlockConfig) -> tuple[NDArray[np.int8], Array]:
    """As `_basis`, with each row of one channel: maps of different materials are alike in no common way, and common directions of all
    of them fit none."""
    images = torch.from_numpy(blocks).view(-1, config.block_texels, config.output_channels)
    variances, vectors = [], []
    for channel in range(config.output_channels):
        values = images[..., channel].double()
        found, directions = torch.linalg.eigh(values.T @ values / len(values))
        variances.append(found.numpy())
        vectors.append(directions.numpy().T)
    rows = np.concatenate(vectors)
    order = np.argsort(-np.concatenate(variances), kind="stable")[: config.coefficients]
    chosen = rows[order] * np.where(rows[order].sum(1, keepdims=True) < 0.0, -1.0, 1.0)
    scale = np.abs(chosen).max(1) / 127.0
    basis = np.zeros((len(order), config.block_texels, config.output_channels), np.int8)
    basis[np.arange(len(order)), :, order // config.block_texels] = np.rint(chosen / scale[:, None])
    return basis, scale.astype(np.float32)


def _projection(basis: NDArray[np.int8], basis_scale: Array) -> torch.Tensor:
    """[values of a block, coefficients] float32: blocks times this are the coefficients of least squared error under the rounded
    basis."""
    rows = torch.from_numpy((basis.reshape(len(basis), -1) * basis_scale[:, None]).astype(np.float64))
    # The rows are orthogonal but for their rounding.
    solution: torch.Tensor = torch.linalg.solve(rows @ rows.T, rows)
    return solution.T.float().contiguous()


def _fitted_scales(squares: torch.Tensor, chosen: NDArray[np.int64], modes: int) -> NDArray[np.uint8]:
    """[modes, coefficients] stored scales for the blocks that chose each mode."""
    total = squares.mean(0).numpy().astype(np.float64)
    scales = []
    for mode in range(modes):
        own = squares[torch.from_numpy(chosen == mode)]
        variance = own.mean(0).numpy().astype(np.float64) if len(own) >= FEWEST_BLOCKS else total
        scales.append(stored_scales(np.sqrt(np.maximum(variance, 1e-9))))
    return np.stack(scales)


def _first_classes(features: Array, count: int, random: np.random.Generator) -> NDArray[np.int64]:
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
    coefficients: torch.Tensor, decoder: BlockDecoder, config: BlockConfig, random: np.random.Generator
) -> NDArray[np.uint8]:
    """[modes, coefficients] stored scales."""
    squares = coefficients.square()
    features = MODE_FEATURES_OF_SETS if config.has_sets else MODE_FEATURES
    energies = torch.log(squares[:, :features] + 1e-4).numpy()
    scales = _fitted_scales(squares, _first_classes(energies, config.modes, random), config.modes)
    middle = len(config.block_words) // 2
    for _ in range(MODE_ROUNDS):
        tables = Tables.of(BlockDecoder(decoder.basis, decoder.basis_scale, scales), config)
        depths = tables.depths[middle : middle + 1]
        expected = expected_errors(coefficients, depths, tables.scales)[:, 0]
        chosen = best_modes(coefficients, expected, depths, tables.scales).numpy()
        scales = _fitted_scales(squares, chosen, config.modes)
    return scales


@contextmanager
def one_thread() -> Iterator[None]:
    """Torch on one thread: the same numbers on every machine, and the other cores are left alone."""
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(before)


def fit_decoder(samples: Sequence[Sample], config: BlockConfig, seed: int = 0) -> BlockDecoder:
    """The tables of a group, from samples of its textures. `seed` decides where the search for modes begins."""
    random = np.random.default_rng(seed)
    blocks = np.concatenate([sample.blocks for sample in samples])
    with one_thread():
        basis, basis_scale = _basis(blocks, config)
        decoder = BlockDecoder(basis, basis_scale, np.zeros((config.modes, len(basis)), np.uint8))
        coefficients = torch.from_numpy(blocks) @ _projection(basis, basis_scale)
        scales = _modes(coefficients, decoder, config, random)
    return BlockDecoder(basis, basis_scale, scales)


def rate_curve(sample: Sample, decoder: BlockDecoder, config: BlockConfig) -> RateCurve:
    """What the words of a texture's blocks are worth under `decoder`."""
    with one_thread():
        tables = Tables.of(decoder, config)
        blocks = torch.from_numpy(sample.blocks)
        values = blocks @ tables.projection
        expected = expected_errors(values, tables.depths, tables.scales).amin(2)
        # The polynomials that errors come from may fall below 0.
        expected = expected.clamp_(min=0.0)
        # What the basis cannot show, whatever a code's size.
        expected += (blocks.square().sum(1, keepdim=True) - values.square().sum(1, keepdim=True)).clamp_(min=0.0)
    # In units of the texture's own values, for textures are compared.
    errors = expected.numpy() * np.float32(sample.contrast**2 / config.block_values)
    return RateCurve(errors, config.block_words, sample.block_count)


def coefficient_energies(sample: Sample, decoder: BlockDecoder, config: BlockConfig) -> Array:
    """[coefficients] float32: mean squared error of a texture's values that each coefficient stands for."""
    with one_thread():
        values = torch.from_numpy(sample.blocks) @ _projection(decoder.basis, decoder.basis_scale)
        energies: Array = values.square().mean(0).numpy() * np.float32(sample.contrast**2 / config.block_values)
    return energies
