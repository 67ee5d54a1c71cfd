"""Maps in the formats of graphics hardware: BC7, BC5 for normals, and ASTC, with two channels and its normal mode for normals."""

from collections.abc import Callable, Mapping, Sequence
from itertools import product

import numpy as np
from numpy.typing import NDArray

from lab.studies.materials.coding import PARTS, CodedMaps, Coding, Part, joined, mean_psnr_db, part_of
from lab.studies.set_quality import texel_count
from ntc.codec.maps import SRGB_MAPS
from ntc.codec.mips import mip_sizes
from ntc.codec.textures import SourceTexture
from ntc.metrics import block_compression
from ntc.metrics.block_compression import BlockFormat, block_size, compressed_bytes

ASTC_FORMATS: tuple[BlockFormat, ...] = (
    "astc-4x4", "astc-5x5", "astc-6x6", "astc-8x6", "astc-8x8", "astc-10x8", "astc-10x10", "astc-12x12",
)  # fmt: skip
NEARLY = 1.02
"""Of the bits asked for, at most: what block formats may take."""
Report = Callable[[str], None]


def _padded(pixels: NDArray[np.uint8], block: tuple[int, int], channels: Sequence[int]) -> NDArray[np.uint8]:
    """[whole blocks, whole blocks, 4] uint8: `channels` of `pixels` as RGB, alpha 255."""
    rgba = np.full((*pixels.shape[:2], 4), 255, np.uint8)
    rgba[..., :3] = pixels[..., channels]
    return np.pad(rgba, ((0, -pixels.shape[0] % block[1]), (0, -pixels.shape[1] % block[0]), (0, 0)), mode="edge")


def decoded_part(texture: SourceTexture, block_format: BlockFormat) -> NDArray[np.uint8]:
    """[H, W, C] uint8: what hardware reads of a part's pixels in `block_format`; of BC7, BC5 for normals.

    Raises InputError where the encoders are not installed.
    """
    pixels, block = texture.pixels, block_size(block_format)
    count, is_normal = texture.channels, texture.maps == ("normal",)
    # Fewer than three channels: the last one again, which costs next to nothing.
    rgba = _padded(pixels, block, [min(number, count - 1) for number in range(3)])
    height, width = rgba.shape[:2]
    if block_format == "bc7":
        if is_normal:
            decoded = block_compression.decode_bc5(block_compression.encode_bc5(rgba), width, height)
        else:
            decoded = block_compression.decode_bc(block_compression.encode_bc7(rgba, "thorough"), width, height, 7)
    else:
        kind: block_compression.AstcKind = (
            "normal" if is_normal else "srgb" if texture.maps[0] in SRGB_MAPS else "linear"
        )
        blocks = block_compression.encode_astc(rgba, block, "thorough", kind)
        decoded = block_compression.decode_astc(blocks, width, height, block, kind)
        if is_normal:
            decoded = decoded[..., [0, 3]]
    return np.ascontiguousarray(decoded[: pixels.shape[0], : pixels.shape[1], :count])


def part_coding(textures: Sequence[SourceTexture], part: Part, block_format: BlockFormat) -> Coding:
    """The maps of `part` of all material sets in one format."""
    found, bits = list[CodedMaps | None](), 0.0
    for texture in textures:
        own = part_of(texture, part)
        if own is None:
            found.append(None)
            continue
        found.append(CodedMaps.of(own.maps, decoded_part(own, block_format), own.pixels))
        bits += 8.0 * sum(compressed_bytes(*mip, block_format) for mip in mip_sizes(*own.size))
    return Coding(tuple(found), bits)


def present_parts(textures: Sequence[SourceTexture]) -> list[Part]:
    """Those of PARTS that any of the sets has."""
    return [part for part in PARTS if any(part_of(texture, part) is not None for texture in textures)]


def bc_coding(textures: Sequence[SourceTexture]) -> Coding:
    """All maps in BC7, normals in BC5: 24 bits a texel of base, normal and one picture of linear maps."""
    return joined([part_coding(textures, part, "bc7") for part in present_parts(textures)])


def astc_parts(textures: Sequence[SourceTexture], report: Report) -> dict[Part, dict[BlockFormat, Coding]]:
    """Every part in every format of ASTC_FORMATS."""
    found: dict[Part, dict[BlockFormat, Coding]] = {}
    for part in present_parts(textures):
        found[part] = {}
        for block_format in ASTC_FORMATS:
            report(f"{block_format}, {' '.join(part)}")
            found[part][block_format] = part_coding(textures, part, block_format)
    return found


def best_astc(
    parts: Mapping[Part, Mapping[BlockFormat, Coding]], textures: Sequence[SourceTexture], bits: float
) -> tuple[str, Coding] | None:
    """(formats, coding): of at most `bits` bits a texel in all, the formats by part whose mean PSNR over all channels is greatest;
    None where there are none."""
    texels = texel_count([texture.size for texture in textures])
    best: tuple[str, Coding] | None = None
    for formats in product(ASTC_FORMATS, repeat=len(parts)):
        chosen = [parts[part][each] for part, each in zip(parts, formats, strict=True)]
        if sum(coding.stored_bits for coding in chosen) > NEARLY * bits * texels:
            continue
        coding = joined(chosen)
        if best is None or mean_psnr_db(coding) > mean_psnr_db(best[1]):
            best = (", ".join(each.removeprefix("astc-") for each in formats), coding)
    return best
