"""`python -m lab.benchmarks.library.encoding_cost FOLDER --json F`: what encoding a megatexel takes, in seconds of one thread.

FOLDER holds images. Told are CPU seconds (so that what else runs on the machine counts little) by step: reading an image, features,
fitting the decoder of a group, encoding; and bytes of images and of codes a texel.
"""

import json
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Annotated, TypeVar

import torch
import tyro

from ntc.codec.block.config import BlockOptions
from ntc.codec.block.encoding.groups import fitted_groups
from ntc.codec.block.encoding.rate import config_for_bits
from ntc.codec.encoding import texture_set
from ntc.codec.model import Grouping
from ntc.codec.quality import PsnrSummary
from ntc.codec.registry import codec_of
from ntc.codec.textures import SourceTexture, hash_pixels
from ntc.features import feature_matrix
from ntc.io import write_text
from ntc.training.encode import encode_textures
from viewer.scene.images import read_image

BITS = 2.0
Result = TypeVar("Result")


@dataclass(frozen=True)
class Options:
    """Measure what encoding takes."""

    folder: Annotated[Path, tyro.conf.Positional]
    """Images."""
    textures: int = 24
    """How many of them, evenly spread over the folder."""
    json: Path | None = None
    """Where to write the figures."""


def _timed(work: Callable[[], Result]) -> tuple[Result, float]:
    """(what `work` gives, CPU seconds)."""
    began = time.process_time()
    found = work()
    return found, time.process_time() - began


def _read(path: Path) -> SourceTexture:
    pixels = read_image(path)[..., :3]
    return SourceTexture(path.stem, pixels, hash_pixels(pixels))


def main(options: Options) -> None:
    """Run the benchmark."""
    torch.set_num_threads(1)
    paths = sorted(path for path in options.folder.rglob("*") if path.suffix.lower() in (".png", ".jpg", ".webp"))
    chosen = paths[:: max(1, len(paths) // options.textures)][: options.textures]
    textures, reading = _timed(lambda: [_read(path) for path in chosen])
    texels = sum(texture.size[0] * texture.size[1] for texture in textures)
    _, features = _timed(lambda: feature_matrix("low_level", textures))
    figures: dict[str, object] = {
        "textures": len(textures),
        "texels": texels,
        "image_bytes_a_texel": sum(path.stat().st_size for path in chosen) / texels,
        "read_seconds_a_megatexel": reading / texels * 1e6,
        "features_seconds_a_megatexel": features / texels * 1e6,
    }
    for name, decoders in (("universal", 0), ("single", 1)):
        grouping = Grouping(name, (0,) * len(textures))
        config = config_for_bits(BITS, texture_set(textures, decoders, None))
        _, fitting = _timed(partial(fitted_groups, textures, grouping, (0,), config, 0))
        pack, whole = _timed(partial(encode_textures, textures, grouping, config, BlockOptions(threads=1)))
        summary = PsnrSummary.of([texture.psnr_db or 0.0 for texture in pack.textures])
        figures[name] = {
            "fit_seconds_a_group": fitting,
            "encode_seconds_a_megatexel": (whole - fitting) / texels * 1e6,
            "code_bytes_a_texel": sum(
                codec_of(config).texture_bytes(texture, config).latents for texture in pack.textures
            )
            / texels,
            "psnr_db": summary.of_mean_mse_db if summary else None,
        }
    text = json.dumps(figures, indent=2) + "\n"
    print(text, end="")
    if options.json is not None:
        write_text(options.json, text)


if __name__ == "__main__":
    main(tyro.cli(Options))
