"""Images in blocks of texels, and textures as the encoder works on them: in blocks of normalised values."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ntc.codec.block.config import BlockCodecConfig
from ntc.codec.config import WrapMode
from ntc.codec.latents import LatentLevel, latent_levels
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


def image_of(blocks: NDArray[np.floating], level: LatentLevel, side: int) -> NDArray[np.floating]:
    """[height, width, C]: the inverse of `blocks_of` for the blocks [rows * columns, side * side, C] of `level`."""
    parts = blocks.reshape(level.height, level.width, side, side, -1).transpose(0, 2, 1, 3, 4)
    return parts.reshape(level.height * side, level.width * side, -1)[: level.texel_height, : level.texel_width]


@dataclass(frozen=True, eq=False)
class PreparedTexture:
    """A texture in blocks of normalised values."""

    mean: Array
    axes: Array
    """[channels, channels] orthogonal, all of the length `contrast`."""
    blocks: Array
    """[blocks of all levels, texels x channels]: (value - mean) in units of the axes."""

    @property
    def contrast(self) -> float:
        """What a normalised value is multiplied by to give a texture's value in [0, 1]."""
        return float(np.linalg.norm(self.axes[:, 0]))


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


def prepare_texture(source: SourceTexture, config: BlockCodecConfig) -> PreparedTexture:
    """All mips of `source` in blocks."""
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
    return PreparedTexture(mean, axes, np.concatenate(blocks).reshape(-1, config.block_values))


@dataclass(frozen=True, eq=False)
class Sample:
    """Some blocks of a texture, for what is fitted or estimated."""

    blocks: Array
    """[sampled blocks, texels x channels], normalised."""
    contrast: float
    """As `PreparedTexture.contrast`."""
    block_count: int
    """Blocks of all levels of the texture."""


def sample_textures(
    sources: Sequence[SourceTexture], config: BlockCodecConfig, seed: int = 0, most: int = SAMPLED_BLOCKS
) -> tuple[Sample, ...]:
    """At most `most` blocks of a group's textures, chosen at random; each texture has the same weight, whatever its size."""
    random = np.random.default_rng(seed)
    each = max(1, most // max(1, len(sources)))
    samples = []
    for source in sources:
        texture = prepare_texture(source, config)
        chosen = random.permutation(len(texture.blocks))[:each]
        samples.append(Sample(texture.blocks[chosen], texture.contrast, len(texture.blocks)))
    return tuple(samples)
