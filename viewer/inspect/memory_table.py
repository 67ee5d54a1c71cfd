"""Table of bytes: the original textures, block compression, and each slot's latents, decoders and cache."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache

from ntc.codec.maps import BASE_ALONE, MapName
from ntc.codec.mips import mip_sizes
from ntc.codec.model import Pack
from ntc.codec.registry import codec_of
from ntc.metrics.block_compression import compressed_bytes
from ntc.metrics.compressed_textures import CompressedTextures, kind_of
from ntc.metrics.metrics import psnr_table
from ntc.pack.match import PackMatch
from viewer.scene.map_pictures import pictures_of
from viewer.scene.model import Scene

RGBA_BYTES = 4


@dataclass(frozen=True)
class MemoryRow:
    """Row of the table: one kind of bytes."""

    name: str
    bytes: int
    share: float | None = None
    """Size as a share of the original textures; None without one."""
    explanation: str = ""
    is_total: bool = False


@lru_cache(maxsize=4096)
def _bytes_of(width: int, height: int, maps: tuple[MapName, ...]) -> tuple[int, int]:
    """Return the bytes (as RGBA8, as BC7) of a texture with these maps and all mips.

    The maps make up to four pictures: base colour; normals (in BC5); roughness, metalness and occlusion; emission.
    """
    sizes, pictures = mip_sizes(width, height), pictures_of(maps)
    plain = len(pictures) * sum(w * h * RGBA_BYTES for w, h in sizes)
    blocks = sum(compressed_bytes(w, h, "bc7", kind_of(picture)) for w, h in sizes for picture in pictures)
    return plain, blocks


def scene_memory(scene: Scene) -> tuple[MemoryRow, MemoryRow]:
    """Return the size of the scene's textures as RGBA8 and as BC7, with all maps and mips."""
    sizes = [_bytes_of(*texture.size, texture.maps) for texture in scene.textures]
    plain, blocks = sum(size[0] for size in sizes), sum(size[1] for size in sizes)
    return (
        MemoryRow("original RGBA8", plain, 1.0, "original images of all maps with mips, 4 bytes per texel"),
        MemoryRow(
            "as BC7", blocks, blocks / max(plain, 1), "original images in blocks, 1 byte per texel, normals in BC5"
        ),
    )


@dataclass(frozen=True)
class SizePair:
    """Sizes (width, height) in texels of a texture and of its encoded form."""

    original: tuple[int, int]
    encoded: tuple[int, int]
    maps: tuple[MapName, ...] = BASE_ALONE
    """Maps that the pack holds."""

    @property
    def is_smaller(self) -> bool:
        """True where the pack has fewer texels than the original."""
        return self.encoded[0] * self.encoded[1] < self.original[0] * self.original[1]


def size_pairs(scene: Scene, pack: Pack, match: PackMatch) -> tuple[SizePair, ...]:
    """Return the sizes of the scene's textures that the pack holds."""
    pairs = []
    for texture, index in zip(scene.textures, match.texture_index, strict=True):
        if index >= 0:
            encoded = pack.textures[index]
            size = (texture.pixels.shape[1], texture.pixels.shape[0])
            pairs.append(SizePair(size, (encoded.width, encoded.height), encoded.maps))
    return tuple(pairs)


def smaller_note(pairs: Sequence[SizePair]) -> str:
    """Return a note about textures that were encoded smaller than their originals; "" where none was."""
    smaller = [pair for pair in pairs if pair.is_smaller]
    if not smaller:
        return ""
    (width, height), (was_width, was_height) = max(
        ((pair.encoded, pair.original) for pair in smaller), key=lambda sizes: sizes[1][0] * sizes[1][1]
    )
    sizes = f"{width} x {height} of {was_width} x {was_height} texels"
    return f"{len(smaller)} of {len(pairs)} textures encoded smaller than the originals, up to {sizes}"


def pack_memory(
    scene: Scene, pack: Pack, match: PackMatch, on_gpu: Mapping[str, int] | None, idle: int = 0
) -> tuple[MemoryRow, ...]:
    """Return the size of a pack by part: in its file, and on the GPU where it has been drawn.

    Shares are relative to the original images of the pack's textures and maps, reduced to the encoded size, because fewer texels
    are not compression. `idle` bytes on the GPU belong to decode paths that are not in use; the sum leaves them out.
    """
    pairs = size_pairs(scene, pack, match)
    original = max(1, sum(_bytes_of(*pair.encoded, pair.maps)[0] for pair in pairs))
    table = psnr_table(pack)
    rows = []
    if any(pair.is_smaller for pair in pairs):
        about = "originals as RGBA8 with mips, reduced to the encoded size"
        rows.append(MemoryRow("originals, that size", original, 1.0, about, is_total=True))
    rows += [
        MemoryRow("pack: latents", table.latent_bytes, table.latent_bytes / original, "quantised, all mips"),
        MemoryRow(
            "pack: decoders",
            table.decoder_bytes,
            table.decoder_bytes / original,
            codec_of(pack.config).table_text,
        ),
    ]
    if table.adapter_bytes:
        rows.append(MemoryRow("pack: adapters", table.adapter_bytes, table.adapter_bytes / original))
    total = table.latent_bytes + table.decoder_bytes + table.adapter_bytes
    rows.append(MemoryRow("pack in all", total, total / original, is_total=True))
    if on_gpu is not None:
        rows += [MemoryRow(f"GPU: {name}", size, size / original) for name, size in on_gpu.items() if size]
        total = sum(on_gpu.values())
        rows.append(MemoryRow("GPU in all", total, total / original, is_total=True))
    if idle:
        rows.append(
            MemoryRow("for other paths", idle, None, "stays on the GPU for a fast switch to other decode paths")
        )
    return tuple(rows)


def compressed_memory(compressed: CompressedTextures) -> tuple[MemoryRow, ...]:
    """Return the size of the textures in a block format. The viewer itself draws them decoded to RGBA8."""
    pictures = (*compressed.textures, *(picture for pictures in compressed.further for picture in pictures))
    plain = max(1, sum(_bytes_of(picture.shape[1], picture.shape[0], picture.maps)[0] for picture in pictures))
    stored = compressed.stored_bytes
    explanation = f"{compressed.bits_per_texel:.2f} bits per texel, all mips, padding of blocks included"
    return (MemoryRow("blocks in all", stored, stored / plain, explanation, is_total=True),)


def megabytes(count: int) -> str:
    """Return a size as text such as `12.34 MB`, with fewer digits for large numbers and kB for small ones."""
    if count < 100_000:
        return f"{count / 1e3:.1f} kB"
    return f"{count / 1e6:.2f} MB" if count < 1e8 else f"{count / 1e6:,.0f} MB"
