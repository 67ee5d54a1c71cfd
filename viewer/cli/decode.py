"""`ntc-viewer decode`: every texture of a pack as a PNG."""

import re
import sys
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from ntc.codec.latents import latent_levels
from ntc.codec.model import Pack
from ntc.errors import InputError
from ntc.pack.file import read_pack
from viewer.cli.options import DecodeOptions
from viewer.scene.images import write_png

ImageDecoder = Callable[[int, int], NDArray[np.uint8]]
"""(texture index, level) -> [h, w, channels] uint8."""


def _decoder(pack: Pack, options: DecodeOptions) -> ImageDecoder:
    match options.backend:
        case "numpy":
            from ntc.codec.reference import decode_image

            return lambda index, level: decode_image(pack, index, level)
        case "torch":
            from ntc.codec.torch_block import torch_codec

            return torch_codec(pack, "cpu").decode_image
        case "gl":
            from viewer.gl.context import create_headless_context
            from viewer.render.passes.decode_texels import GlTexelDecoder

            return GlTexelDecoder(create_headless_context(), pack, options.precision).decode_image


def image_file_names(names: Sequence[str]) -> tuple[str, ...]:
    """File names for textures: as in the pack where a file system allows, made unique by a number where they repeat."""
    result: list[str] = []
    for name in names:
        stem = re.sub(r"\.(png|jpe?g|webp)$", "", name, flags=re.IGNORECASE)
        stem = re.sub(r'[\x00-\x1f<>:"/\\|?*]', "_", stem).strip(" .")[:200] or "texture"
        candidate, number = stem, 2
        while f"{candidate}.png" in result:
            candidate, number = f"{stem}_{number}", number + 1
        result.append(f"{candidate}.png")
    return tuple(result)


def decode(options: DecodeOptions) -> int:
    """Run `ntc-viewer decode`. Raises InputError for bad input."""
    if options.level < 0:
        raise InputError(f"--level {options.level}: must be 0 or more")
    if options.precision != "fp32" and options.backend != "gl":
        raise InputError(f"--precision {options.precision}: only --backend gl has it")
    pack = read_pack(options.pack)
    decode_level = _decoder(pack, options)
    for index, file_name in enumerate(image_file_names([texture.name for texture in pack.textures])):
        texture = pack.textures[index]
        last = len(latent_levels(texture.width, texture.height, pack.config)) - 1
        write_png(options.out / file_name, decode_level(index, min(options.level, last)))
    sys.stdout.write(f"wrote {len(pack.textures)} images to {options.out} ({options.backend})\n")
    return 0
