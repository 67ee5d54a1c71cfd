"""The mip chain of a texture: the truth for every latent level and for the reference path. Colours by the sRGB transfer function.

Colours are box-filtered in linear light, normals as vectors that are made unit vectors again, all other maps as they are.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ntc.codec.config import ColorSpace
from ntc.codec.maps import BASE_ALONE, SRGB_MAPS, MapName, map_slices

Floats = NDArray[np.floating]
LEAST_COMPILED = 1 << 21
"""Least number of values for which compiled code is loaded. Loading it takes about 0.8 s, as long as numpy takes for a hundred images
of 512x512 texels: a viewer of small textures does without."""


def compiled_maps(values: int) -> Any:
    """Return the module of compiled code for so many values; None for few of them."""
    if values < LEAST_COMPILED:
        return None
    from ntc.codec import compiled_maps as module

    return module


def srgb_to_linear(srgb: Floats) -> Floats:
    """Linear light in [0, 1] of sRGB-coded values in [0, 1], any shape, in the precision of the input."""
    return np.where(srgb <= 0.04045, srgb / 12.92, ((np.maximum(srgb, 0.0) + 0.055) / 1.055) ** 2.4)


def linear_to_srgb(linear: Floats) -> Floats:
    """Return sRGB-coded values in [0, 1] of linear light in [0, 1], any shape, in the precision of the input."""
    return np.where(linear <= 0.0031308, linear * 12.92, 1.055 * np.maximum(linear, 0.0) ** (1.0 / 2.4) - 0.055)


def srgb8_to_linear_table() -> NDArray[np.float32]:
    """Return [256] float32: linear light of every 8-bit sRGB value."""
    return srgb_to_linear(np.arange(256, dtype=np.float64) / 255.0).astype(np.float32)


def linear_to_srgb8(linear: Floats) -> NDArray[np.uint8]:
    """Return 8-bit sRGB of linear light, any shape; clamped to [0, 1], rounded to nearest; NaN counts as 0."""
    clipped = np.clip(np.nan_to_num(linear, nan=0.0, posinf=1.0, neginf=0.0), 0.0, 1.0)
    return np.asarray(np.rint(linear_to_srgb(clipped) * 255.0), np.uint8)


def alpha_channel(channels: int) -> int | None:
    """Index of the alpha channel, which is never sRGB-coded: the last of two or of four; None without one."""
    return channels - 1 if channels in (2, 4) else None


def to_linear(pixels: NDArray[np.uint8], color_space: ColorSpace) -> NDArray[np.float32]:
    """Return [H, W, C] float32 linear light in [0, 1] of `pixels` [H, W, C] uint8."""
    if color_space == "linear":
        return pixels.astype(np.float32) / np.float32(255.0)
    linear = srgb8_to_linear_table()[pixels]
    alpha = alpha_channel(pixels.shape[2])
    if alpha is not None:
        linear[..., alpha] = pixels[..., alpha] / np.float32(255.0)
    return linear


def to_8bit(linear: NDArray[np.float32], color_space: ColorSpace) -> NDArray[np.uint8]:
    """Return [H, W, C] uint8 in `color_space` of `linear` [H, W, C] float32 linear light, clamped to [0, 1], rounded to nearest."""
    if color_space == "linear":
        return np.asarray(np.rint(np.clip(linear, 0.0, 1.0) * 255.0), np.uint8)
    coded = linear_to_srgb8(linear)
    alpha = alpha_channel(linear.shape[2])
    if alpha is not None:
        coded[..., alpha] = np.rint(np.clip(linear[..., alpha], 0.0, 1.0) * 255.0)
    return coded


LEAST_LENGTH = 1e-6
"""Least length of an averaged normal: a shorter one has no direction."""


def mip_sizes(width: int, height: int) -> list[tuple[int, int]]:
    """Return (width, height) in texels of all mips of a texture, down to 1x1 texel."""
    return [(max(1, width >> level), max(1, height >> level)) for level in range(max(width, height).bit_length())]


def _resample_axis(image: NDArray[np.float32], size: int) -> NDArray[np.float32]:
    """Area-weighted box filter of axis 0 down to `size` rows; each output row covers an equal share of the input."""
    rows = image.shape[0]
    if rows == size:
        return image
    if rows == 2 * size:
        return (image[0::2] + image[1::2]) * np.float32(0.5)
    step = rows / size
    result = np.zeros((size, *image.shape[1:]), np.float32)
    if rows % size == 0:
        # The same sums, without gathering rows.
        for tap in range(rows // size):
            result += image[tap :: rows // size] * np.float32(1.0 / step)
        return result
    starts = np.arange(size) * step
    for tap in range(int(np.ceil(step)) + 1):
        row = np.floor(starts).astype(np.int64) + tap
        overlap = np.clip(np.minimum(row + 1, starts + step) - np.maximum(row, starts), 0.0, None) / step
        weights = overlap.astype(np.float32).reshape(-1, *([1] * (image.ndim - 1)))
        result += image[np.minimum(row, rows - 1)] * weights
    return result


def box_resize(linear: NDArray[np.float32], width: int, height: int) -> NDArray[np.float32]:
    """Return [height, width, C] float32: area-weighted reduction of `linear` [H, W, C], numbers in linear light."""
    narrow = _resample_axis(linear.transpose(1, 0, 2), width).transpose(1, 0, 2)
    return np.ascontiguousarray(_resample_axis(narrow, height))


def normal_vectors(coded: NDArray[np.uint8]) -> NDArray[np.float32]:
    """Return [H, W, 3] float32: tangent-space normals of their xy `coded` [H, W, 2] uint8 as (n + 1) / 2; z is what is left of a unit
    vector, never below 0. They are longer than 1 where x and y already are."""
    xy = coded.astype(np.float32) * np.float32(2.0 / 255.0) - np.float32(1.0)
    z = np.sqrt(np.maximum(np.float32(1.0) - np.square(xy).sum(-1, keepdims=True), np.float32(0.0)))
    return np.concatenate([xy, z], axis=-1)


def coded_z(coded: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return [H, W, 1] uint8: z of the normals whose xy are `coded` [H, W, 2] uint8, as (n + 1) / 2."""
    return np.asarray(np.rint((normal_vectors(coded)[..., 2:] * 0.5 + 0.5) * 255.0), np.uint8)


def coded_normals(vectors: NDArray[np.float32]) -> NDArray[np.uint8]:
    """Return [H, W, 2] uint8: xy of `vectors` [H, W, 3] made unit vectors, as (n + 1) / 2; straight up where they have no length."""
    lengths = np.linalg.norm(vectors, axis=-1, keepdims=True)
    xy = np.where(lengths > LEAST_LENGTH, vectors[..., :2] / np.maximum(lengths, np.float32(LEAST_LENGTH)), 0.0)
    return np.asarray(np.rint(np.clip(xy * 0.5 + 0.5, 0.0, 1.0) * 255.0), np.uint8)


def filterable(
    pixels: NDArray[np.uint8], color_space: ColorSpace, maps: Sequence[MapName] = BASE_ALONE
) -> NDArray[np.float32]:
    """Return [H, W, C or C + 1] float32: what is averaged where `pixels` [H, W, C] of `maps` are filtered: linear light, normals as
    vectors of three numbers, linear maps in [0, 1]. `color_space` is that of the base."""
    if tuple(maps) == BASE_ALONE:
        return to_linear(pixels, color_space)
    parts = []
    for name, place in map_slices(maps, pixels.shape[2]).items():
        part = pixels[..., place]
        parts.append(normal_vectors(part) if name == "normal" else to_linear(part, _space(name, color_space)))
    return np.concatenate(parts, axis=-1)


def coded(
    filtered: NDArray[np.float32], color_space: ColorSpace, maps: Sequence[MapName] = BASE_ALONE
) -> NDArray[np.uint8]:
    """Return [H, W, C] uint8: the inverse of `filterable`, rounded to nearest."""
    if tuple(maps) == BASE_ALONE:
        return to_8bit(filtered, color_space)
    extra = "normal" in maps
    parts, grown = [], False
    for name, place in map_slices(maps, filtered.shape[2] - extra).items():
        part = filtered[..., place.start + grown : place.stop + grown + (name == "normal")]
        parts.append(coded_normals(part) if name == "normal" else to_8bit(part, _space(name, color_space)))
        grown = grown or name == "normal"
    return np.concatenate(parts, axis=-1)


def _space(name: MapName, color_space: ColorSpace) -> ColorSpace:
    if name == "base":
        return color_space
    return "srgb" if name in SRGB_MAPS else "linear"


def srgb_channels(maps: Sequence[MapName], channels: int, color_space: ColorSpace) -> list[bool]:
    """Return for each channel of a texture of `maps` whether it is sRGB-coded; `color_space` is that of the base."""
    found = []
    for name, place in map_slices(maps, channels).items():
        count = place.stop - place.start
        found += [_space(name, color_space) == "srgb" and number != alpha_channel(count) for number in range(count)]
    return found


def hardware_filtered(
    pixels: NDArray[np.uint8], color_space: ColorSpace, maps: Sequence[MapName]
) -> NDArray[np.float32]:
    """Return [H, W, C] float32 in [0, 1]: what hardware blends between texels of a mip: linear light, all else as it is stored."""
    table = srgb8_to_linear_table()
    coded = srgb_channels(maps, pixels.shape[2], color_space)
    return np.where(coded, table[pixels], pixels / np.float32(255.0))


def _second_mip(pixels: NDArray[np.uint8], color_space: ColorSpace, maps: Sequence[MapName]) -> NDArray[np.float32]:
    """Return mip 1 of `pixels` as `filterable` numbers."""
    height, width, channels = pixels.shape
    is_even, compiled = width % 2 == height % 2 == 0, compiled_maps(pixels.size)
    if is_even and compiled is None and all(srgb_channels(maps, channels, color_space)):
        # As `box_resize`, without a picture of numbers in between.
        table = srgb8_to_linear_table()
        left, right = (table.take(pixels[:, side::2]) for side in (0, 1))
        columns = left + right
        return np.asarray((columns[0::2] + columns[1::2]) * np.float32(0.25))
    if compiled is None or not is_even:
        return box_resize(filterable(pixels, color_space, maps), max(1, width >> 1), max(1, height >> 1))
    values = np.arange(256, dtype=np.float32)
    tables = np.empty((channels, 256), np.float32)
    tables[:] = values / np.float32(255.0)
    tables[np.array(srgb_channels(maps, channels, color_space))] = srgb8_to_linear_table()
    normal = map_slices(maps, channels)["normal"].start if "normal" in maps else -1
    if normal >= 0:
        tables[normal : normal + 2] = values * np.float32(2.0 / 255.0) - np.float32(1.0)
    found = np.empty((height // 2, width // 2, channels + (normal >= 0)), np.float32)
    compiled.halve(pixels, tables, normal, found)
    return found


def mip_chain(
    pixels: NDArray[np.uint8], color_space: ColorSpace, maps: Sequence[MapName] = BASE_ALONE
) -> tuple[NDArray[np.uint8], ...]:
    """Return all mips of `pixels` [H, W, C] uint8 of `maps`, down to 1x1 texel: mip l is [max(1, H >> l), max(1, W >> l), C] uint8.

    Filtered from the unrounded mip above (`filterable`), then coded again; `color_space` is that of the base.
    """
    height, width = pixels.shape[:2]
    chain = [pixels]
    if width <= 1 and height <= 1:
        return (pixels,)
    values = _second_mip(pixels, color_space, maps)
    chain.append(coded(values, color_space, maps))
    while width >> len(chain) or height >> len(chain):
        values = box_resize(values, max(1, width >> len(chain)), max(1, height >> len(chain)))
        chain.append(coded(values, color_space, maps))
    return tuple(chain)


def resize_to(
    pixels: NDArray[np.uint8],
    width: int,
    height: int,
    color_space: ColorSpace,
    maps: Sequence[MapName] = BASE_ALONE,
) -> NDArray[np.uint8]:
    """Return [height, width, C] uint8: `pixels` of `maps` reduced by an area-weighted box filter, as `mip_chain` filters."""
    return coded(box_resize(filterable(pixels, color_space, maps), width, height), color_space, maps)
