"""Textures in formats of graphics hardware, with mips and quality; their blocks are kept on disk, because encoding takes long."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ntc.codec.config import ColorSpace
from ntc.codec.maps import BASE_ALONE, SRGB_MAPS, TABLE_OF_MAP, MapName
from ntc.codec.mips import mip_chain
from ntc.codec.quality import PsnrSummary, psnr_db
from ntc.codec.textures import hash_pixels
from ntc.content_cache import ContentCache
from ntc.metrics.block_compression import (
    AstcKind,
    BlockFormat,
    Effort,
    compressed_blocks,
    compressed_bytes,
    decompress,
)

VERSION = 1
"""Changes with the encoders and their settings."""
EFFORT: Effort = "medium"
"""Effort for textures that are looked at: a quarter of the time of `thorough`, and 0.1 to 0.2 dB less."""
Shape = tuple[int, int, int]


@dataclass(frozen=True)
class CompressedTexture:
    """One texture in blocks."""

    block_format: BlockFormat
    shape: Shape
    """(height, width, channels) of mip 0."""
    blocks: tuple[bytes, ...]
    """Blocks of each mip down to 1x1 texel, in the order of hardware."""
    psnr_db: float
    """PSNR in dB of mip 0 over 8-bit values; infinite when equal."""
    maps: tuple[MapName, ...] = BASE_ALONE
    """Maps of its channels: a base colour, normals or emission alone, or linear maps together."""

    @property
    def stored_bytes(self) -> int:
        """Bytes of all blocks."""
        return sum(map(len, self.blocks))

    @property
    def texels(self) -> int:
        """Texels of mip 0, over which stored bits are counted."""
        return self.shape[0] * self.shape[1]

    def mips(self) -> tuple[NDArray[np.uint8], ...]:
        """Return [h, w, C] uint8 of each mip, as hardware reads it. Raises InputError where the decoder is not installed."""
        shapes = mip_shapes(self.shape)
        kind = kind_of(self.maps)
        return tuple(
            decompress(own, shape, self.block_format, kind) for own, shape in zip(self.blocks, shapes, strict=True)
        )


@dataclass(frozen=True, eq=False)
class CompressedTextures:
    """The textures of a scene in one format, in their order."""

    block_format: BlockFormat
    textures: tuple[CompressedTexture, ...]
    """Base colours; of a material set without one, its first picture."""
    further: tuple[tuple[CompressedTexture, ...], ...] = ()
    """Further pictures of the maps of each texture (`viewer.scene.map_pictures`); empty where base colours alone were encoded."""

    @property
    def stored_bytes(self) -> int:
        """Bytes of all blocks of all mips."""
        further = sum(picture.stored_bytes for pictures in self.further for picture in pictures)
        return sum(texture.stored_bytes for texture in self.textures) + further

    @property
    def bits_per_texel(self) -> float:
        """Bits of all blocks of all maps per texel of mip 0."""
        return 8.0 * self.stored_bytes / max(1, sum(texture.texels for texture in self.textures))

    @property
    def psnr(self) -> PsnrSummary | None:
        """Summary of the PSNR of all textures; None for none."""
        return PsnrSummary.of([texture.psnr_db for texture in self.textures])


def mip_shapes(shape: Shape) -> tuple[Shape, ...]:
    """Shapes of all mips of a texture, down to 1x1 texel."""
    height, width, channels = shape
    levels = max(height, width).bit_length()
    return tuple((max(1, height >> level), max(1, width >> level), channels) for level in range(levels))


@dataclass(frozen=True, eq=False)
class CompressionRequest:
    """A picture for `compress_texture` to encode, and how; can be sent to another process."""

    pixels: NDArray[np.uint8]
    """[H, W, C] uint8, C from 1 to 4, in `color_space`."""
    block_format: BlockFormat
    cache: Path | None = None
    """Folder that keeps blocks. None: nothing is kept."""
    effort: Effort = EFFORT
    color_space: ColorSpace = "srgb"
    maps: tuple[MapName, ...] = BASE_ALONE
    """Maps of the first channels; further channels are unused."""


def kind_of(maps: tuple[MapName, ...]) -> AstcKind:
    """Return the kind of data that encoders take a picture of `maps` for."""
    if TABLE_OF_MAP[maps[0]].is_direction:
        return "normal"
    return "srgb" if maps[0] in SRGB_MAPS else "linear"


def _cache_key(request: CompressionRequest) -> str:
    what = request.color_space if request.maps == BASE_ALONE else "-".join(request.maps)
    return f"{VERSION} {hash_pixels(request.pixels)} {what} {request.block_format} {request.effort}"


def _compressed(request: CompressionRequest, blocks: tuple[bytes, ...]) -> CompressedTexture:
    height, width, channels = request.pixels.shape
    decoded = decompress(blocks[0], (height, width, channels), request.block_format, kind_of(request.maps))
    quality = psnr_db(decoded, request.pixels[..., : decoded.shape[2]])
    return CompressedTexture(request.block_format, (height, width, channels), blocks, quality, request.maps)


def cached_texture(request: CompressionRequest) -> CompressedTexture | None:
    """Return what an earlier `compress_texture` has kept; None for nothing. Raises InputError where the decoder is not installed."""
    if request.cache is None:
        return None
    height, width, channels = request.pixels.shape
    kind, shapes = kind_of(request.maps), mip_shapes((height, width, channels))
    sizes = [compressed_bytes(w, h, request.block_format, kind) for h, w, _ in shapes]
    blocks = ContentCache(request.cache).read(_cache_key(request))
    if blocks is None or len(blocks) != sum(sizes):
        return None
    ends = np.cumsum(sizes).tolist()
    return _compressed(request, tuple(blocks[end - size : end] for end, size in zip(ends, sizes, strict=True)))


def compress_texture(request: CompressionRequest) -> CompressedTexture:
    """Encode a texture with all mips, or read it from the cache. Raises InputError where the encoder is not installed."""
    cached = cached_texture(request)
    if cached is not None:
        return cached
    kind = kind_of(request.maps)
    if kind == "normal":
        chain = mip_chain(request.pixels, "linear", request.maps)
    else:
        chain = mip_chain(request.pixels, "linear" if kind == "linear" else request.color_space)
    blocks = tuple(compressed_blocks(mip, request.block_format, request.effort, kind) for mip in chain)
    if request.cache is not None:
        ContentCache(request.cache).write(_cache_key(request), b"".join(blocks))
    return _compressed(request, blocks)
