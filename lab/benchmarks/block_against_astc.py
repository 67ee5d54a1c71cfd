"""Codec `block` beside ASTC (astcenc, thorough) on the same images, at ASTC's rates, mips and side information counted.

python -m lab.benchmarks.block_against_astc FOLDER --texture-size 512 --json lab/benchmarks/results/studies/block_against_astc.json
"""

import argparse
import json
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ntc.codec.block.config import BlockCodecConfig
from ntc.codec.config import GroupingConfig
from ntc.codec.latents import latent_levels
from ntc.codec.model import Pack
from ntc.codec.textures import SourceTexture
from ntc.errors import InputError
from ntc.grouping import GroupingInputs, make_grouping
from ntc.io import write_text
from ntc.metrics.metrics import PsnrSummary, psnr_db
from ntc.training.encode_blocks import encode_blocks
from viewer.cli.encode import read_source

RATES: tuple[tuple[int, tuple[int, int]], ...] = ((2, (12, 10)), (4, (8, 8)), (8, (6, 5)))
"""Words of an 8x8 block, and the ASTC block (width, height) whose rate is nearest: about 1, 2 and 4 bits a texel."""
ASTC_THOROUGH = 98.0
ASTC_BITS = 128


def astc_decoded(pixels: NDArray[np.uint8], block: tuple[int, int]) -> NDArray[np.uint8]:
    """[H, W, 3] uint8: what hardware reads from `pixels` [H, W, 3] uint8 sRGB in ASTC LDR sRGB blocks. Raises InputError."""
    try:
        from astc_encoder import ASTCConfig, ASTCContext, ASTCImage, ASTCProfile, ASTCSwizzle, ASTCType
    except ImportError as error:
        raise InputError(f"ASTC: the encoder is not installed ({error}); pip install astc-encoder-py") from error
    height, width = pixels.shape[:2]
    context = ASTCContext(ASTCConfig(ASTCProfile.LDR_SRGB, *block, 1, ASTC_THOROUGH))
    rgba = np.dstack([pixels, np.full((height, width), 255, np.uint8)])
    swizzle = ASTCSwizzle.from_str("RGBA")
    coded = context.compress(ASTCImage(ASTCType.U8, width, height, 1, rgba.tobytes()), swizzle)
    image = ASTCImage(ASTCType.U8, width, height, 1)
    context.decompress(coded, image, swizzle)
    return np.frombuffer(image.data or b"", np.uint8).reshape(height, width, 4)[..., :3]


def _texels_and_astc_bits(texture: SourceTexture, block: tuple[int, int], config: BlockCodecConfig) -> tuple[int, int]:
    """Texels of the mips that the pack holds, and the bits of ASTC blocks for the same mips."""
    levels = latent_levels(*texture.size, config)
    texels = sum(level.texel_width * level.texel_height for level in levels)
    blocks = sum(-(-level.texel_width // block[0]) * -(-level.texel_height // block[1]) for level in levels)
    return texels, blocks * ASTC_BITS


def _pack_bits(pack: Pack) -> int:
    """Codes, colour axes and tables."""
    own = sum(t.latents.nbytes + t.scale.nbytes + t.offset.nbytes for t in pack.textures)
    return 8 * own + sum(decoder.stored_bits for decoder in pack.block_decoders)


def _summary(psnr: Sequence[float]) -> dict[str, float]:
    found = PsnrSummary.of(psnr)
    if found is None:
        raise InputError("no texture to compare; name a folder of images that are not constant")
    return {"mean_db": round(found.mean_db, 2), "of_mean_mse_db": round(found.of_mean_mse_db, 2)}


def compare(textures: Sequence[SourceTexture], clusters: int) -> list[dict[str, Any]]:
    """A row for each rate: bits a texel, PSNR in dB of mip 0, and seconds of both."""
    grouping = make_grouping(GroupingConfig("clustered", clusters), textures, GroupingInputs())
    rows = []
    for words, block in RATES:
        config = BlockCodecConfig(block_words=words)
        began = time.perf_counter()
        pack = encode_blocks(textures, grouping, config)
        between = time.perf_counter()
        astc = [psnr_db(astc_decoded(texture.pixels, block), texture.pixels) for texture in textures]
        ended = time.perf_counter()
        own = [texture.psnr_db for texture in pack.textures if texture.psnr_db is not None]
        counted = [_texels_and_astc_bits(texture, block, config) for texture in textures]
        texels = sum(each for each, _ in counted)
        rows.append(
            {
                "block": {"bits_per_texel": round(_pack_bits(pack) / texels, 3), **_summary(own)},
                "astc": {
                    "block": f"{block[0]}x{block[1]}",
                    "bits_per_texel": round(sum(bits for _, bits in counted) / texels, 3),
                    **_summary(astc),
                },
                "worse_by_over_1_db": sum(mine < other - 1.0 for mine, other in zip(own, astc, strict=True)),
                "seconds": {"block": round(between - began, 1), "astc": round(ended - between, 1)},
            }
        )
        print(json.dumps(rows[-1]), flush=True)
    return rows


def main() -> int:
    """Compare and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("source", type=Path, help="scene or folder of images without alpha")
    parser.add_argument("--texture-size", type=int, default=512)
    parser.add_argument("--clusters", type=int, default=4)
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    try:
        textures = [t for t in read_source(options.source, options.texture_size).textures if t.pixels.shape[2] == 3]
        record = {
            "source": options.source.name,
            "textures": len(textures),
            "texture_size": options.texture_size,
            "clusters": options.clusters,
            "rates": compare(textures, options.clusters),
        }
    except InputError as error:
        sys.stderr.write(f"error: {error}\n")
        return 2
    if options.json:
        write_text(options.json, json.dumps(record, indent=1) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
