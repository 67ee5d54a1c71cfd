"""`ntc-viewer decode`: every texture of a pack as a PNG."""

import re
import sys
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from ntc.codec.latents import texture_levels
from ntc.codec.maps import MapName, map_slices
from ntc.codec.mips import coded_z
from ntc.codec.model import Pack
from ntc.errors import InputError
from ntc.pack.file import read_pack
from viewer.cli.options import DecodeOptions
from viewer.scene.images import write_png
from viewer.scene.json_text import counted

ImageDecoder = Callable[[int, int], NDArray[np.uint8]]
"""(texture index, level) -> [h, w, channels] uint8."""


def _decoder(pack: Pack, options: DecodeOptions) -> ImageDecoder:
    match options.backend:
        case "numpy":
            from ntc.codec.reference import decode_image

            return lambda index, level: decode_image(pack, index, level)
        case "torch":
            from ntc.codec.registry import codec_of

            return codec_of(pack.config).torch_twin(pack, "cpu").decode_image
        case "gl":
            from viewer.gl.context import create_headless_context
            from viewer.render.passes.decode_texels import GlTexelDecoder

            context = create_headless_context(options.device)
            if not context.features.compute:
                raise InputError(
                    f"--backend gl needs OpenGL 4.3, and {context.info.version} is there; use --backend torch"
                )
            return GlTexelDecoder(context, pack, options.precision).decode_image


def map_images(maps: Sequence[MapName], pixels: NDArray[np.uint8]) -> dict[MapName, NDArray[np.uint8]]:
    """Return the picture [H, W, C] of each map in `pixels` [H, W, channels of all maps]. Normals get z, as (z + 1) / 2, in blue."""
    images: dict[MapName, NDArray[np.uint8]] = {}
    for name, place in map_slices(maps, pixels.shape[2]).items():
        images[name] = np.ascontiguousarray(pixels[..., place])
        if name == "normal":
            images[name] = np.concatenate([images[name], coded_z(images[name])], axis=-1)
    return images


def image_file_names(names: Sequence[str]) -> tuple[str, ...]:
    """Return a file name for each texture: its name without forbidden characters, and with a number where names repeat."""
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
    if options.device is not None and options.backend != "gl":
        raise InputError(f"--device {options.device}: only --backend gl has it")
    pack = read_pack(options.pack)
    decode_level, written = _decoder(pack, options), 0
    for index, file_name in enumerate(image_file_names([texture.name for texture in pack.textures])):
        texture = pack.textures[index]
        last = len(texture_levels(texture, pack.config)) - 1
        images = map_images(texture.maps, decode_level(index, min(options.level, last)))
        for name, image in images.items():
            path = options.out / file_name
            write_png(path if name == "base" else path.with_suffix(f".{name}.png"), image)
        written += len(images)
    sys.stdout.write(f"wrote {counted(written, 'image')} to {options.out} ({options.backend})\n")
    return 0
