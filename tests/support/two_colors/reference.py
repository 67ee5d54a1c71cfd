"""The slow twin of every decoder of codec `two_colors`: numpy float64."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ntc.codec.config import WrapMode
from ntc.codec.latents import LatentLevel, texture_levels
from ntc.codec.sampling import Array, bilinear, clamped_lod, trilinear
from tests.support.two_colors.model import PLANE_WORDS, SIDE, TwoColorsConfig, TwoColorsTexture


def block_values(stored: NDArray[np.uint8], config: TwoColorsConfig) -> Array:
    """[blocks, 16, channels] float64 in [0, 1] of blocks `stored` [blocks, block_bytes]."""
    parts = stored.reshape(len(stored), -1, 4 * PLANE_WORDS)
    indices = (parts[:, :, 8:, None] >> (2 * np.arange(SIDE, dtype=np.uint8))) & 3
    shares = indices.reshape(len(stored), -1, SIDE * SIDE, 1) / 3.0
    values = np.zeros((len(stored), SIDE * SIDE, config.output_channels))
    for place, channels in enumerate(config.planes.values()):
        first, second = (parts[:, place, None, start : start + 4] / 255.0 for start in (0, 4))
        both = first + (second - first) * shares[:, place]
        values[..., list(channels.values())] = both[..., list(channels)]
    return values


def image_of(blocks: Any, level: LatentLevel) -> Any:
    """[height, width, C] of the texels of `blocks` [blocks of `level`, 16, C], an array of numpy or torch."""
    parts = blocks.reshape(level.height, level.width, SIDE, SIDE, -1).swapaxes(1, 2)
    image = parts.reshape(level.height * SIDE, level.width * SIDE, -1)
    return image[: level.texel_height, : level.texel_width]


def decode_image(texture: TwoColorsTexture, config: TwoColorsConfig, number: int = 0) -> NDArray[np.uint8]:
    """[h, w, channels of the texture] uint8: mip `number`."""
    level = texture_levels(texture, config)[number]
    stored = texture.blocks[level.first_cell : level.first_cell + level.cells]
    image = image_of(block_values(stored, config), level)[..., texture.places(config)]
    return np.asarray(np.rint(image * 255.0), np.uint8)


def lookup_values(
    texture: TwoColorsTexture, config: TwoColorsConfig, uv: Array, lod: Array, wrap: tuple[WrapMode, WrapMode]
) -> Array:
    """[N, output_channels] float64 at `uv` [N, 2] and `lod` [N]: decoded texels are blended."""
    levels = texture_levels(texture, config)

    def of_level(level: LatentLevel, at: Array) -> Array:
        def texel(column: NDArray[np.int64], row: NDArray[np.int64]) -> Array:
            used, place = np.unique(row // SIDE * level.width + column // SIDE, return_inverse=True)
            values = block_values(texture.blocks[level.first_cell + used], config)
            return np.asarray(values[place.reshape(-1), row % SIDE * SIDE + column % SIDE])

        return bilinear(texel, (level.texel_width, level.texel_height), at, wrap)

    return trilinear(levels, of_level, config.output_channels, uv, clamped_lod(lod, len(levels)), wrap)
