"""Flat view of one texture: its original, its block formats, what packs decode, and the visible part of an image."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ntc.codec.latents import texture_levels
from ntc.codec.mips import mip_chain
from ntc.codec.model import Pack
from ntc.codec.quality import psnr_db
from ntc.codec.reference import decode_texels, texel_centres
from ntc.codec.textures import SourceTexture
from ntc.metrics.compressed_textures import CompressedTexture
from viewer.jobs.job import JobReport
from viewer.scene.model import SceneTexture
from viewer.scene.source_textures import reduce_texture

PREVIEW_SIDE = 256
TEXELS_AT_ONCE = 1 << 15
"""Number of texels decoded between two reports of progress: about a tenth of a second."""


@dataclass(frozen=True, eq=False)
class FlatTexture:
    """Texture as pixels, decoded or original."""

    mips: tuple[NDArray[np.uint8], ...]
    """Mips as [h, w, 3] uint8 sRGB, from the finest."""
    level: int
    """Mip level of the first of `mips`: above 0 in a preview."""
    psnr_db: float | None
    """PSNR in dB of mip 0 against the original, over 8-bit values; infinite when equal, None for a preview and for the original."""
    reduced: bool = False
    """True where the texture was reduced before encoding. `psnr_db` then compares with the original, reduced in the same way."""


def as_rgb8(pixels: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return [H, W, 3] of pixels with 1 to 4 channels: grey is repeated, alpha is left out."""
    return pixels[..., :3] if pixels.shape[2] >= 3 else np.repeat(pixels[..., :1], 3, axis=2)


def _mips(pixels: NDArray[np.uint8]) -> tuple[NDArray[np.uint8], ...]:
    return tuple(mip_chain(np.ascontiguousarray(as_rgb8(pixels)), "srgb"))


def original_flat(texture: SceneTexture, report: JobReport) -> FlatTexture:
    """Return the original image of `texture` (a job)."""
    report.show(FlatTexture((as_rgb8(texture.pixels),), 0, None))
    return FlatTexture(_mips(texture.pixels), 0, None)


def compressed_flat(compressed: CompressedTexture, _report: JobReport) -> FlatTexture:
    """Return a texture as graphics hardware decodes its blocks (a job)."""
    return FlatTexture(tuple(as_rgb8(mip) for mip in compressed.mips()), 0, compressed.psnr_db)


def _decode(pack: Pack, index: int, level: int, report: JobReport) -> NDArray[np.uint8]:
    texture = pack.textures[index]
    geometry = texture_levels(texture, pack.config)[level]
    width, height = geometry.texel_width, geometry.texel_height
    uv = texel_centres(width, height)
    parts: list[NDArray[np.uint8]] = []
    for start in range(0, len(uv), TEXELS_AT_ONCE):
        part = uv[start : start + TEXELS_AT_ONCE]
        values = decode_texels(pack, index, part, np.full(len(part), float(level)))
        parts.append(np.rint(values * 255.0).astype(np.uint8))
        report.progress(start + len(part), len(uv))
    return np.concatenate(parts).reshape(height, width, -1)


def decode_flat(texture: SceneTexture, pack: Pack, index: int, report: JobReport) -> FlatTexture:
    """Decode texture `index` of `pack`, which encodes `texture`, with the numpy reference; show a small mip first (a job)."""
    encoded = pack.textures[index]
    levels = texture_levels(encoded, pack.config)
    preview = next((n for n, size in enumerate(levels) if max(size.texel_width, size.texel_height) <= PREVIEW_SIDE), 0)
    if preview:
        report.show(FlatTexture((as_rgb8(_decode(pack, index, preview, report)),), preview, None))
    decoded = _decode(pack, index, 0, report)
    original = texture.pixels
    reduced = original.shape[:2] != decoded.shape[:2]
    if reduced:
        source = SourceTexture(texture.name, texture.pixels, texture.pixel_hash)
        original = reduce_texture(source, max(encoded.width, encoded.height)).pixels
    same = original.shape[:2] == decoded.shape[:2]
    channels = min(original.shape[2], decoded.shape[2])
    quality = psnr_db(original[..., :channels], decoded[..., :channels]) if same else None
    return FlatTexture(_mips(decoded), 0, quality, reduced)


LARGEST_REPEAT = 32
"""Largest side in pixels of a repeated texel. Above it the GPU's filter enlarges the texels and blurs their edges."""


@dataclass(frozen=True, eq=False)
class VisiblePart:
    """Visible part of an image, cut out as new pixels."""

    mips: tuple[NDArray[np.uint8], ...]
    """Mips of the whole image."""
    key: object
    """Key of the part, equal for equal parts of one image."""
    pixels: NDArray[np.uint8]
    """Pixels of the part: [h, w, 3] uint8 sRGB."""
    rectangle: tuple[float, float, float, float]
    """Place of the part in the whole image: (left, top, right, bottom) as shares of its size."""


def visible_part(
    mips: tuple[NDArray[np.uint8], ...],
    visible: tuple[float, float, float, float],
    width: float,
    known: VisiblePart | None = None,
) -> VisiblePart | None:
    """Return the part `visible` (left, top, right, bottom as shares) of an image with `mips` that is drawn `width` pixels wide.

    The part is cut from the finest mip that has no more texels than pixels. Texels of an enlarged image are repeated, so that they
    stay square. Returns `known` where it is the same part, and None where nothing is visible.
    """
    finest = mips[0].shape[1]
    level = min(max(math.floor(math.log2(max(finest / max(width, 1.0), 1.0)) + 0.5), 0), len(mips) - 1)
    image = mips[level]
    rows, columns = image.shape[:2]
    left, right = _range(visible[0], visible[2], columns)
    top, bottom = _range(visible[1], visible[3], rows)
    if left >= right or top >= bottom:
        return None
    repeat = min(max(math.ceil(width / columns), 1), LARGEST_REPEAT)
    key = (level, left, top, right, bottom, repeat)
    if known is not None and known.mips is mips and known.key == key:
        return known
    part = image[top:bottom, left:right]
    if repeat > 1:
        part = part.repeat(repeat, axis=0).repeat(repeat, axis=1)
    rectangle = (left / columns, top / rows, right / columns, bottom / rows)
    return VisiblePart(mips, key, np.ascontiguousarray(part), rectangle)


def _range(low: float, high: float, texels: int) -> tuple[int, int]:
    """Return the range of texels that a range of shares touches, and one more on each side, which the GPU's filter reads."""
    return max(math.floor(low * texels) - 1, 0), min(math.ceil(high * texels) + 1, texels)
