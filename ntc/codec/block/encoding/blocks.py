"""Images in blocks of texels, and textures as the encoder works on them: in blocks of normalised values."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ntc.codec.block.config import BlockConfig
from ntc.codec.config import WrapMode
from ntc.codec.latents import LatentLevel, latent_levels
from ntc.codec.maps import SRGB_MAPS, channel_places, map_slices
from ntc.codec.mips import mip_chain
from ntc.codec.textures import SourceTexture

Array = NDArray[np.float32]
SAMPLED_BLOCKS = 24_000
"""Blocks that a group's tables are fitted to."""
LEAST_CONTRAST = 1e-4
"""Axes of a constant texture are this long, so that nothing is divided by zero."""
_PAD_MODES = {"repeat": "wrap", "mirror": "symmetric", "clamp": "edge"}


def blocks_of(image: NDArray[np.float32], side: int, wrap: tuple[WrapMode, WrapMode]) -> NDArray[np.float32]:
    """[rows * columns, side * side, C]: `image` [H, W, C] in blocks, filled up beyond its edges by what its wrap modes (u, v) show."""
    height, width, channels = image.shape
    pad_v, pad_u = (0, -height % side), (0, -width % side)
    if pad_u[1]:
        image = np.pad(image, ((0, 0), pad_u, (0, 0)), mode=_PAD_MODES[wrap[0]])  # type: ignore[call-overload]
    if pad_v[1]:
        image = np.pad(image, (pad_v, (0, 0), (0, 0)), mode=_PAD_MODES[wrap[1]])  # type: ignore[call-overload]
    rows, columns = image.shape[0] // side, image.shape[1] // side
    parts = image.reshape(rows, side, columns, side, channels).transpose(0, 2, 1, 3, 4)
    return np.ascontiguousarray(parts.reshape(rows * columns, side * side, channels))


@dataclass(frozen=True, eq=False)
class Axes:
    """A texture's mean and principal axes, map by map."""

    mean: Array
    """[mips of a code, channels]."""
    axes: Array
    """[channels, channels], 0 where channels are of different maps: orthogonal columns of the length `contrast`, divided by the
    square roots of the channels' weights."""
    inverse: Array
    """[channels, channels]: value - mean, times this, is in units of the axes."""
    contrast: float
    """What the error of a normalised value is multiplied by to give a weighted error of values in [0, 1]."""


@dataclass(frozen=True, eq=False)
class PreparedTexture:
    """A texture in blocks of normalised values."""

    axes: Axes
    blocks: Array
    """[blocks of all levels, texels x channels]: (value - mean) in units of the axes."""


def _turned_channels(config: BlockConfig) -> list[list[int]]:
    """Channels that share axes: those of a colour. All others are less alike from texture to texture than one basis needs."""
    found = []
    for name, place in map_slices(config.maps, config.output_channels).items():
        channels = list(range(place.start, place.stop))
        found.extend([channels] if name in SRGB_MAPS else [[channel] for channel in channels])
    return found


def _principal_axes(pixels: Array, weights: NDArray[np.float64], config: BlockConfig) -> Axes:
    """Axes of `pixels` [N, C] whose squared errors are worth `weights` [C].

    Of one length after weighting, so that an error has the same weight in every direction.
    """
    mean = pixels.mean(0, dtype=np.float64)
    roots = np.sqrt(weights)
    centred = (pixels - mean) * roots
    covariance = centred.T @ centred / len(pixels)
    vectors, total = np.zeros_like(covariance), 0.0
    for channels in _turned_channels(config):
        own = np.ix_(channels, channels)
        variances, found = np.linalg.eigh(covariance[own])
        vectors[own] = found[:, ::-1] * np.where(found[:, ::-1].sum(0) < 0.0, -1.0, 1.0)
        total += variances.sum()
    contrast = max(float(np.sqrt(max(total, 0.0))), LEAST_CONTRAST)
    weighted = (vectors * contrast).astype(np.float32)
    length = np.linalg.norm(weighted[:, 0])
    scale = roots.astype(np.float32)[:, None]
    # The inverse of orthogonal axes of one length.
    means = np.repeat(mean.astype(np.float32)[None], config.mips, axis=0)
    return Axes(means, weighted / scale, weighted * scale / np.square(length), float(length))


def prepare_texture(source: SourceTexture, config: BlockConfig) -> PreparedTexture:
    """All mips of `source` in blocks. Raises ValueError for maps that the codec lacks."""
    width, height = source.size
    levels = latent_levels(width, height, config)
    mips = mip_chain(source.pixels, source.color_space, source.maps)[: len(levels)]
    places = list(channel_places(source.maps, source.channels, config.maps, config.output_channels))
    values, weights = [], np.ones(config.output_channels)
    weights[places] = source.map_weights.of_channels(source.maps, source.channels)
    for mip in mips:
        # A channel that the texture lacks is 0 everywhere, which costs no bits.
        value = np.zeros((*mip.shape[:2], config.output_channels), np.float32)
        value[..., places] = mip.astype(np.float32) / np.float32(255.0)
        values.append(value)
    axes = _principal_axes(values[0].reshape(-1, config.output_channels), weights, config)
    for number in range(1, config.mips):
        axes.mean[number] = axes.mean[0] + _offset(values, levels, number)
    own = [number for number, level in enumerate(levels) if level.has_own_cells]
    side = config.block_side
    blocks = [blocks_of((values[number] - axes.mean[0]) @ axes.inverse, side, source.wrap) for number in own]
    return PreparedTexture(axes, np.concatenate(blocks).reshape(-1, config.block_values))


def _offset(values: Sequence[Array], levels: Sequence[LatentLevel], mip: int) -> Array:
    """[channels]: by how much mips that codes hold as their mip `mip` are above the average of stored values, for colours are
    averaged in linear light."""
    sums, count = np.zeros(values[0].shape[2]), 0
    for number, level in enumerate(levels):
        if level.mip_of_cell == mip:
            finer, texels = values[number - mip], values[number].shape[0] * values[number].shape[1]
            sums += texels * (values[number].mean((0, 1), np.float64) - finer.mean((0, 1), np.float64))
            count += texels
    return np.asarray(sums / max(1, count), np.float32)


@dataclass(frozen=True, eq=False)
class Sample:
    """Some blocks of a texture, for what is fitted or estimated."""

    blocks: Array
    """[sampled blocks, texels x channels], normalised."""
    axes: Axes
    """Of the texture."""
    block_count: int
    """Blocks of all levels of the texture."""


def sample_textures(
    sources: Sequence[SourceTexture], config: BlockConfig, seed: int = 0, most: int = SAMPLED_BLOCKS
) -> tuple[Sample, ...]:
    """At most `most` blocks of a group's textures, chosen at random; each texture has the same weight, whatever its size."""
    random = np.random.default_rng(seed)
    each = max(1, most // max(1, len(sources)))
    samples = []
    for source in sources:
        texture = prepare_texture(source, config)
        chosen = random.permutation(len(texture.blocks))[:each]
        samples.append(Sample(texture.blocks[chosen], texture.axes, len(texture.blocks)))
    return tuple(samples)
