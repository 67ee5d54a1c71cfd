"""Encoding a group in closed form: principal components, bit allocations, trellis-coded indices. Torch on the CPU, float32."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray

from ntc.codec.block.blocks import blocks_of, packed_codes
from ntc.codec.block.config import BlockCodecConfig
from ntc.codec.block.model import BlockDecoder, BlockTexture, scale_values, stored_scales
from ntc.codec.block.quantizer import TrellisQuantizer, best_modes
from ntc.codec.block.trellis import indices_of, share_out_bits
from ntc.codec.latents import latent_levels
from ntc.codec.mips import mip_chain
from ntc.codec.textures import SourceTexture

Array = NDArray[np.float32]
LEAST_CONTRAST = 1e-4
"""Axes of a constant texture are this long, so that nothing is divided by zero."""
SAMPLED_BLOCKS = 24_000
"""Blocks that a group's tables are fitted to."""
MODE_ROUNDS = 6
"""Alternations between choosing a mode for each block and fitting the modes to their blocks."""
CLASS_ROUNDS = 12
"""Rounds of the clustering that the first modes come from."""
MODE_FEATURES = 24
"""Leading coefficients whose energies the first modes are clustered by."""
BLOCKS_AT_ONCE = 1 << 14


@dataclass(frozen=True, eq=False)
class _Texture:
    """A texture in blocks of normalised values."""

    mean: Array
    axes: Array
    blocks: Array
    """[blocks of all levels, texels x channels]: (value - mean) in units of the axes."""


def _colour_axes(pixels: Array) -> tuple[Array, Array]:
    """(mean [C], axes [C, C]) of `pixels` [N, C]: orthogonal, all of the length of the texture's contrast.

    Of one length, so that an error has the same weight in every direction.
    """
    mean = pixels.mean(0, dtype=np.float64)
    centred = pixels - mean
    variances, vectors = np.linalg.eigh(centred.T @ centred / len(pixels))
    vectors = vectors[:, ::-1] * np.where(vectors[:, ::-1].sum(0) < 0.0, -1.0, 1.0)
    contrast = max(float(np.sqrt(max(variances.sum(), 0.0))), LEAST_CONTRAST)
    return mean.astype(np.float32), (vectors * contrast).astype(np.float32)


def _prepared(source: SourceTexture, config: BlockCodecConfig) -> _Texture:
    width, height = source.size
    levels = latent_levels(width, height, config)
    mips = mip_chain(source.pixels, source.color_space)[: len(levels)]
    missing = config.output_channels - source.pixels.shape[2]
    # A channel that the texture lacks is 0 everywhere, which costs no bits.
    values = [np.pad(mip.astype(np.float32) / np.float32(255.0), ((0, 0), (0, 0), (0, missing))) for mip in mips]
    mean, axes = _colour_axes(values[0].reshape(-1, config.output_channels))
    # The inverse of orthogonal axes of one length.
    inverse = axes / np.square(np.linalg.norm(axes[:, 0]))
    blocks = [blocks_of((value - mean) @ inverse, config.block_side, source.wrap) for value in values]
    return _Texture(mean, axes, np.concatenate(blocks).reshape(-1, config.block_values))


def _basis(blocks: Array, config: BlockCodecConfig) -> tuple[NDArray[np.int8], Array]:
    """(basis, basis_scale) of BlockDecoder: leading principal directions of `blocks` about 0, rounded to 8 bits."""
    values = torch.from_numpy(blocks).double()
    vectors = torch.linalg.eigh(values.T @ values / len(blocks))[1].numpy()[:, ::-1].T[: config.coefficients]
    vectors = vectors * np.where(vectors.sum(1, keepdims=True) < 0.0, -1.0, 1.0)
    scale = np.abs(vectors).max(1) / 127.0
    rounded = np.rint(vectors / scale[:, None]).astype(np.int8)
    return rounded.reshape(len(vectors), config.block_texels, config.output_channels), scale.astype(np.float32)


def _projection(basis: NDArray[np.int8], basis_scale: Array) -> torch.Tensor:
    """[values of a block, coefficients] float32: blocks times this are the coefficients of least squared error under the rounded
    basis."""
    rows = torch.from_numpy((basis.reshape(len(basis), -1) * basis_scale[:, None]).astype(np.float64))
    # The rows are orthogonal but for their rounding.
    solution: torch.Tensor = torch.linalg.solve(rows @ rows.T, rows)
    return solution.T.float().contiguous()


def _fitted_modes(
    squares: torch.Tensor, chosen: NDArray[np.int64], config: BlockCodecConfig
) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
    """(depths, scales) of BlockDecoder for the blocks that chose each mode."""
    total = squares.mean(0).numpy().astype(np.float64)
    depths, scales = [], []
    for mode in range(config.modes):
        own = squares[torch.from_numpy(chosen == mode)]
        variance = own.mean(0).numpy().astype(np.float64) if len(own) >= 16 else total
        variance = np.maximum(variance, 1e-9)
        depths.append(share_out_bits(variance, config.coefficient_bits))
        scales.append(stored_scales(np.sqrt(variance)))
    return np.stack(depths), np.stack(scales)


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
    coefficients: torch.Tensor, config: BlockCodecConfig, random: np.random.Generator
) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
    squares = coefficients.square()
    energies = torch.log(squares[:, :MODE_FEATURES] + 1e-4).numpy()
    depths, scales = _fitted_modes(squares, _first_classes(energies, config.modes, random), config)
    for _ in range(MODE_ROUNDS):
        chosen = best_modes(coefficients, *_tables(depths, scales)).numpy()
        depths, scales = _fitted_modes(squares, chosen, config)
    return depths, scales


def _tables(depths: NDArray[np.uint8], scales: NDArray[np.uint8]) -> tuple[torch.Tensor, torch.Tensor]:
    return torch.from_numpy(depths.astype(np.int64)), torch.from_numpy(scale_values(scales).astype(np.float32))


@contextmanager
def _one_thread() -> Iterator[None]:
    """Torch on one thread: the same numbers on every machine, and the other cores are left alone."""
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(before)


def fit_decoder(sources: Sequence[SourceTexture], config: BlockCodecConfig, seed: int = 0) -> BlockDecoder:
    """The tables of a group of textures; each texture has the same weight, whatever its size."""
    random = np.random.default_rng(seed)
    each = max(1, SAMPLED_BLOCKS // len(sources))
    samples = []
    for source in sources:
        blocks = _prepared(source, config).blocks
        samples.append(blocks[random.permutation(len(blocks))[:each]])
    sample = np.concatenate(samples)
    with _one_thread():
        basis, basis_scale = _basis(sample, config)
        coefficients = torch.from_numpy(sample) @ _projection(basis, basis_scale)
        depths, scales = _modes(coefficients, config, random)
    return BlockDecoder(basis, basis_scale, depths, scales)


def encode_texture(
    source: SourceTexture, decoder: BlockDecoder, config: BlockCodecConfig, quantizer: TrellisQuantizer
) -> BlockTexture:
    """The codes of a texture under a group's tables."""
    texture = _prepared(source, config)
    depths, scales = _tables(decoder.depths, decoder.scales)
    parts = []
    with _one_thread():
        projection = _projection(decoder.basis, decoder.basis_scale)
        for start in range(0, len(texture.blocks), BLOCKS_AT_ONCE):
            blocks = texture.blocks[start : start + BLOCKS_AT_ONCE]
            values = torch.from_numpy(blocks) @ projection
            modes = best_modes(values, depths, scales)
            numbers, _ = quantizer.quantize(values, depths[modes], scales[modes])
            indices = indices_of(numbers.numpy(), depths[modes].numpy())
            parts.append(packed_codes(modes.numpy(), indices, decoder, config))
    width, height = source.size
    return BlockTexture(width, height, np.concatenate(parts), texture.mean, texture.axes)


def encode_group(
    sources: Sequence[SourceTexture], config: BlockCodecConfig, seed: int = 0
) -> tuple[BlockDecoder, tuple[BlockTexture, ...]]:
    """Tables and codes of textures that share a decoder. `seed` decides which blocks are sampled, and so every byte."""
    decoder, quantizer = fit_decoder(sources, config, seed), TrellisQuantizer()
    return decoder, tuple(encode_texture(source, decoder, config, quantizer) for source in sources)
