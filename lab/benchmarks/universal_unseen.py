"""Grouping `universal` on textures that its tables never saw, beside ASTC: fitted to every other texture, measured on the rest.

python -m lab.benchmarks.universal_unseen FOLDER --with FOLDER --json lab/benchmarks/results/studies/universal_unseen.json
"""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from assets.build.universal import fitted_tables, permissive_textures
from lab.benchmarks.block_against_astc import FORMATS
from lab.runner import options, run, write_record
from lab.studies.hardware_formats import FormatStudy
from lab.studies.set_quality import PictureQuality, picture_quality
from ntc.codec.block.encoding.blocks import sample_textures
from ntc.codec.block.encoding.encoder import encode_texture
from ntc.codec.block.encoding.rate import config_for_bits
from ntc.codec.block.encoding.sharing import share_words
from ntc.codec.block.encoding.tables import rate_curve
from ntc.codec.block.model import BlockDecoder
from ntc.codec.block.reference import decode_image
from ntc.codec.encoding import TextureSet
from ntc.codec.quality import PsnrSummary
from ntc.codec.textures import SourceTexture
from ntc.errors import InputError
from viewer.locations import blocks_cache


def _encoded(textures: Sequence[SourceTexture], tables: BlockDecoder, bits: float) -> list[PictureQuality]:
    """Quality of each texture at `bits` a texel under tables that no pack holds."""
    config = config_for_bits(bits, TextureSet([texture.size for texture in textures], 0, 3))
    curves = [rate_curve(sample, tables, config) for sample in sample_textures(textures, config)]
    words = share_words(curves, config.mean_words * sum(curve.block_count for curve in curves))
    found = []
    for texture, own in zip(textures, words, strict=True):
        encoded = encode_texture(texture, tables, config, own)
        found.append(picture_quality(texture.pixels, decode_image(encoded, tables, config), with_flip=False))
    return found


def _decibels(pictures: Sequence[PictureQuality]) -> dict[str, float]:
    summary = PsnrSummary.of([picture.psnr_db for picture in pictures])
    if summary is None:
        raise InputError("no texture to measure; name a folder of more images")
    return {"mean_db": round(summary.mean_db, 2), "of_mean_mse_db": round(summary.of_mean_mse_db, 2)}


def halves(folder: Path, others: Sequence[Path], cache: Path) -> list[dict[str, Any]]:
    """A row for each half that was not seen and each rate. Raises InputError."""
    own = [texture for texture in permissive_textures([folder]) if texture.pixels.shape[2] == 3]
    more = [texture for texture in permissive_textures(others) if texture.pixels.shape[2] == 3]
    study, rows = FormatStudy(cache), []
    for half in (0, 1):
        tables, unseen = fitted_tables([*own[half::2], *more], 3), own[1 - half :: 2]
        for block_format in FORMATS:
            astc, quality = study.measure_all(unseen, block_format, flip_every=1000)
            pictures = _encoded(unseen, tables, quality.bits_per_texel)
            losses = [b.psnr_db - a.psnr_db for a, b in zip(pictures, astc, strict=True)]
            rows.append(
                {
                    "unseen": len(unseen),
                    "fitted_to": len(own[half::2]) + len(more),
                    "bits_per_texel": round(quality.bits_per_texel, 3),
                    "universal": _decibels(pictures),
                    block_format: _decibels(astc),
                    "worse_by_over_1_db": sum(loss > 1.0 for loss in losses),
                }
            )
            print(json.dumps(rows[-1]), flush=True)
    return rows


def main() -> None:
    """Measure and print. Raises InputError."""
    parser = options(__doc__)
    parser.add_argument("folder", type=Path, help="images, half of which are left out of the fit in turn")
    parser.add_argument("--with", dest="others", type=Path, nargs="*", default=[], help="more to fit to")
    parser.add_argument("--cache", type=Path, default=blocks_cache(), help="folder that keeps ASTC's figures")
    given = parser.parse_args()
    rows = halves(given.folder, given.others, given.cache)
    write_record(given.json, {"halves_of": given.folder.name, "rows": rows})


if __name__ == "__main__":
    run(main)
