"""Textures as the encoder works on them: blocks of normalised values.

A texture's channels are correlated, and textures differ in mean and contrast. So each colour is turned to the principal axes of its
values (a Karhunen-Loeve transform of 3x3), the mean is subtracted, and all is divided by the contrast. Blocks of all textures are then
alike enough for one basis and one set of modes. Axes have one length after the weights of maps are applied: an error of a normalised
value costs the same along each axis. The decoder undoes this with a mean and a matrix per texture (docs/reference/codec-block.md).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from ntc.codec.block.config import BlockConfig
from ntc.codec.block.encoding import compiled_texels
from ntc.codec.block.encoding.rate import SAMPLED_BLOCKS
from ntc.codec.config import WrapMode
from ntc.codec.latents import LatentLevel, latent_cell_count, latent_levels
from ntc.codec.maps import SRGB_MAPS, channel_places, map_slices
from ntc.codec.mips import mip_chain, srgb_channels
from ntc.codec.textures import SourceTexture
from ntc.threads import mapped

Array = NDArray[np.float32]
Number = TypeVar("Number", bound=np.generic)
COMPARED_BLOCKS, COMPARED_MIPS = 512, 4
"""Blocks of each mip, and mips, that are compared to choose the mips per code."""
MASK_MARGIN = 40
"""Distance in 8-bit steps between a mask's texels and its cutoff before encoding: small errors then change no texel's side."""
MASK_WEIGHT = 0.25
"""Weight of an error of a mask's alpha that does not cross the cutoff, relative to one of blended alpha."""
LEAST_CONTRAST = 1e-4
"""Length of the axes of a constant texture, which avoids a division by zero."""
_PAD_MODES = {"repeat": "wrap", "mirror": "symmetric", "clamp": "edge"}


def blocks_of(image: NDArray[Number], side: int, wrap: tuple[WrapMode, WrapMode]) -> NDArray[Number]:
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


def reduction(size: tuple[int, int], side: int) -> int:
    """Return the factor by which `reduced` divides each side of a texture of `size`."""
    return max(1, min(-(-max(size) // side), *size))


def reduced(source: SourceTexture, side: int) -> SourceTexture:
    """Return `source` with at most about `side` texels along its longer side: means of stored values, for a picture that is soon
    replaced."""
    channels, factor = source.channels, reduction(source.size, side)
    if factor <= 1:
        return source
    columns, rows = (length // factor for length in source.size)
    cut = source.pixels[: rows * factor, : columns * factor]
    sums = cut.reshape(rows, factor, columns, factor, channels).sum((1, 3), np.uint32)
    return replace(source, pixels=np.asarray((sums + factor * factor // 2) // (factor * factor), np.uint8))


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
    colours: NDArray[np.bool_]
    """[channels] which are sRGB-coded."""
    has_derived: bool
    """True if mip 1 is derived from the codes of mip 0."""
    contrast: float
    """Factor from the error of a normalised value to the weighted error of a value in [0, 1]."""
    cutoff: float | None = None
    """Alpha from which on a texel of a mask is there; None: the texture is no mask."""


@dataclass(frozen=True, eq=False)
class PreparedTexture:
    """A texture in blocks."""

    axes: Axes
    texels: NDArray[np.uint8]
    """[blocks of all levels, texels, channels] 8-bit values; 0 in channels that the texture lacks."""
    compared: tuple[NDArray[np.uint8], ...] = ()
    """8-bit values [blocks, texels of a code's mip, channels] of the `compared_blocks` of the first COMPARED_MIPS levels."""
    derived_errors: tuple[float, ...] = ()
    """Mean squared error, in 8-bit steps squared, of each derived mip against averages of the values of mip 0; of samples."""

    def normalised(self, rows: slice | NDArray[np.int64]) -> Array:
        """[blocks, texels x channels]: (value - mean) in units of the axes, of the blocks `rows`."""
        texels, axes = np.ascontiguousarray(self.texels[rows]), self.axes
        out = np.empty((len(texels), texels.shape[1] * texels.shape[2]), np.float32)
        compiled_texels.normalise(texels, axes.mean[0], np.ascontiguousarray(axes.inverse), out)
        return out


@dataclass(frozen=True, eq=False)
class _Moments:
    """First and second moments of values in [0, 1]."""

    mean: NDArray[np.float64]
    """[channels]."""
    products: NDArray[np.float64]
    """[channels, channels] means of products."""

    @classmethod
    def of(cls, pixels: NDArray[np.uint8]) -> "_Moments":
        """Return the moments of `pixels` [H, W, channels], from exact sums."""
        channels = pixels.shape[2]
        rows, count = pixels.reshape(-1, channels), pixels.size // channels
        sums, products = np.zeros(channels, np.int64), np.zeros((channels, channels), np.int64)
        compiled_texels.add_moments(rows, sums, products)
        return cls(sums / (255.0 * count), products / (255.0**2 * count))


def _turned_channels(config: BlockConfig) -> list[list[int]]:
    """Return the lists of channels that share axes: those of a colour. Others correlate differently in each texture."""
    groups = []
    for name, place in map_slices(config.maps, config.output_channels).items():
        channels = list(range(place.start, place.stop))
        groups.extend([channels] if name in SRGB_MAPS else [[channel] for channel in channels])
    return groups


def _principal_axes(
    moments: _Moments,
    weights: NDArray[np.float64],
    colours: Sequence[bool],
    has_derived: bool,
    cutoff: float | None,
    config: BlockConfig,
) -> Axes:
    """Return the axes of values with `moments`, whose squared errors have the weights `weights` [channels].

    Weighted axes have one length, so that an error has the same weight in every direction.
    """
    mean = moments.mean
    roots = np.sqrt(weights)
    covariance = (moments.products - np.outer(mean, mean)) * np.outer(roots, roots)
    vectors, total = np.zeros_like(covariance), 0.0
    for channels in _turned_channels(config):
        block = np.ix_(channels, channels)
        variances, directions = np.linalg.eigh(covariance[block])
        vectors[block] = directions[:, ::-1] * np.where(directions[:, ::-1].sum(0) < 0.0, -1.0, 1.0)
        total += variances.sum()
    contrast = max(float(np.sqrt(max(total, 0.0))), LEAST_CONTRAST)
    weighted = (vectors * contrast).astype(np.float32)
    length = np.linalg.norm(weighted[:, 0])
    scale = roots.astype(np.float32)[:, None]
    # The inverse of orthogonal axes of one length.
    means = np.repeat(mean.astype(np.float32)[None], config.mips, axis=0)
    inverse = weighted * scale / np.square(length)
    return Axes(means, weighted / scale, inverse, np.array(colours), has_derived, float(length), cutoff)


def prepare_texture(source: SourceTexture, config: BlockConfig, code_mips: int | None = None) -> PreparedTexture:
    """Return all mips of `source` in blocks, with `code_mips` mips per code, or as many as `config` says. Raises ValueError for maps
    that the codec lacks."""
    width, height = source.size
    levels = latent_levels(width, height, config, code_mips)
    mips = mip_chain(source.pixels, source.color_space, source.maps)[: len(levels)]
    cutoff = source.cutoff if "alpha" in source.maps else None
    if cutoff is not None:
        mips = tuple(masked_mips(mips, cutoff))
    places = list(channel_places(source.maps, source.channels, config.maps, config.output_channels))
    values, weights = list[NDArray[np.uint8]](), np.ones(config.output_channels)
    weights[places] = source.map_weights.of_channels(source.maps, source.channels)
    for mip in mips:
        if places == list(range(config.output_channels)):
            values.append(mip)
            continue
        # A channel that the texture lacks is 0 everywhere, which costs no bits.
        value = np.zeros((*mip.shape[:2], config.output_channels), np.uint8)
        value[..., places] = mip
        values.append(value)
    if cutoff is not None:
        weights[-1] *= MASK_WEIGHT
    colours = srgb_channels(config.maps, config.output_channels, source.color_space)
    has_derived = any(not level.has_own_cells for level in levels[:2])
    # Means of coarse mips are compared where any is derived.
    moments = [_Moments.of(value) for value in (values if config.mips > 1 else values[:1])]
    axes = _principal_axes(moments[0], weights, colours, has_derived, cutoff, config)
    for number in range(1, config.mips):
        axes.mean[number] = axes.mean[0] + _offset([each.mean for each in moments], levels, number)
    coded_levels = [number for number, level in enumerate(levels) if level.has_own_cells]
    blocks = {number: blocks_of(values[number], config.block_side, source.wrap) for number in coded_levels}
    compared = []
    for number, level in enumerate(levels[:COMPARED_MIPS]):
        side = config.code_sides[level.mip_of_cell]
        every = blocks[number] if level.has_own_cells else blocks_of(values[number], side, source.wrap)
        compared.append(every[compared_blocks(level.cells)])
    texels = np.concatenate(list(blocks.values()))
    shown = [channel for channel in places if cutoff is None or channel != config.alpha]
    return PreparedTexture(axes, texels, tuple(compared), _derived_errors(compared, levels, axes, shown, config))


def compared_blocks(count: int) -> NDArray[np.int64]:
    """Return the numbers of the blocks among `count` by which the quality of a level is judged."""
    return np.unique(np.linspace(0, count - 1, COMPARED_BLOCKS).astype(np.int64))


def _derived_errors(
    compared: Sequence[NDArray[np.uint8]],
    levels: Sequence[LatentLevel],
    axes: Axes,
    channels: Sequence[int],
    config: BlockConfig,
) -> tuple[float, ...]:
    """`PreparedTexture.derived_errors` over `channels` of the blocks `compared` by level."""
    errors = []
    finest = compared[0][..., channels]
    for number, (level, truth) in enumerate(zip(levels[1:], compared[1:], strict=False), 1):
        if level.mip_of_cell != number:
            break
        side, count = config.code_sides[number], 1 << number
        squares = finest.reshape(len(finest), side, count, side, count, len(channels))
        means = squares.mean((2, 4), dtype=np.float32).reshape(len(finest), side * side, -1)
        means += np.float32(255.0) * (axes.mean[number] - axes.mean[0])[channels]
        errors.append(float(np.square(means - truth[..., channels]).mean()))
    return tuple(errors)


def masked_mips(mips: Sequence[NDArray[np.uint8]], cutoff: float) -> list[NDArray[np.uint8]]:
    """Return `mips` [h, w, channels] uint8 of a mask, whose last channel is alpha: in all of them, about the same share of texels
    is at or above `cutoff`, and none is within MASK_MARGIN of it."""
    limit = cutoff * 255.0
    share, masked = float((mips[0][..., -1] >= limit).mean()), []
    for number, mip in enumerate(mips):
        alpha = mip[..., -1].astype(np.float64)
        above = alpha >= limit
        if number:
            # The texels of greatest alpha.
            order = np.argsort(-alpha, axis=None, kind="stable")
            above = np.zeros(alpha.size, np.bool_)
            above[order[: round(share * alpha.size)]] = True
            above = above.reshape(alpha.shape)
        moved = np.where(above, np.maximum(alpha, limit + MASK_MARGIN), np.minimum(alpha, limit - MASK_MARGIN))
        masked.append(mip.copy())
        masked[-1][..., -1] = np.rint(np.clip(moved, 0.0, 255.0))
    return masked


def _offset(means: Sequence[NDArray[np.float64]], levels: Sequence[LatentLevel], mip: int) -> Array:
    """Return [channels]: mean difference between mips that codes hold as their mip `mip` and averages of the values of mip 0. Colours
    are averaged in linear light, values are not. `means` [channels] by level."""
    sums, count = np.zeros(len(means[0])), 0
    for number, level in enumerate(levels):
        if level.mip_of_cell == mip:
            texels = level.texel_width * level.texel_height
            sums += texels * (means[number] - means[number - mip])
            count += texels
    return np.asarray(sums / max(1, count), np.float32)


@dataclass(frozen=True, eq=False)
class Sample:
    """A random part of a texture's blocks, to which tables are fitted."""

    blocks: Array
    """[sampled blocks, texels x channels], normalised."""
    axes: Axes
    """Axes of the texture."""
    block_count: int
    """Blocks of all levels of the texture."""


def sample_textures(
    sources: Sequence[SourceTexture],
    config: BlockConfig,
    seed: int = 0,
    most: int = SAMPLED_BLOCKS,
    threads: int = 1,
    prepared: dict[SourceTexture, PreparedTexture] | None = None,
) -> tuple[Sample, ...]:
    """Return at most `most` blocks of a group's textures, chosen at random; each texture has the same weight, whatever its size.
    `threads` change nothing. `prepared` receives the textures in blocks."""
    random = np.random.default_rng(seed)
    each = max(1, most // max(1, len(sources)))
    counts = [latent_cell_count(*source.size, config) for source in sources]
    chosen = [random.permutation(count)[:each] for count in counts]

    def sample(number: int) -> Sample:
        texture = prepare_texture(sources[number], config)
        if prepared is not None:
            prepared[sources[number]] = texture
        return Sample(texture.normalised(chosen[number]), texture.axes, counts[number])

    return tuple(mapped(sample, range(len(sources)), threads))
