"""JPEG XL: what a codec without random access makes of textures, as a bound. By OpenImageIO, if its build has it."""

import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import OpenImageIO
from numpy.typing import NDArray

from lab.studies.set_quality import PictureQuality, SetQuality, picture_quality, texel_count
from ntc.codec.mips import mip_chain
from ntc.codec.textures import SourceTexture
from ntc.errors import InputError

DISTANCES = (0.1, 0.25, 0.5, 1.0, 2.0, 3.0, 5.0)
"""From nearly exact to coarse; 1 is what a viewer just does not see."""
EFFORT = 7
"""Of 9; the encoder's own default."""


def has_jpeg_xl() -> bool:
    """Whether this build of OpenImageIO writes JPEG XL."""
    return "jpegxl" in str(OpenImageIO.get_string_attribute("format_list")).split(",")


def jpeg_xl(pixels: NDArray[np.uint8], distance: float) -> tuple[int, NDArray[np.uint8]]:
    """(bytes of the file, what is read from it) of `pixels` [H, W, C] uint8. Raises InputError where it cannot be written."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "texture.jxl"
        image = OpenImageIO.ImageBuf(np.ascontiguousarray(pixels))
        image.specmod().attribute("jpegxl:distance", float(distance))
        image.specmod().attribute("jpegxl:effort", EFFORT)
        read = OpenImageIO.ImageBuf(str(file)).get_pixels(OpenImageIO.UINT8) if image.write(str(file)) else None
        if read is None or read.shape != pixels.shape:
            raise InputError(f"JPEG XL: OpenImageIO cannot write it ({image.geterror() or 'another size was read'})")
        return file.stat().st_size, np.asarray(read)


def measured_jpeg_xl(
    textures: Sequence[SourceTexture],
    distance: float,
    flip_every: int,
    report: Callable[[int, int], None] = lambda _done, _of: None,
) -> tuple[tuple[PictureQuality, ...], SetQuality]:
    """Each texture's quality and the set's; bits are those of a file for each mip. Raises InputError."""
    spent, stored, pictures = 0.0, 0, []
    for number, texture in enumerate(textures):
        began = time.process_time()
        chain = mip_chain(texture.pixels, texture.color_space)
        files = [jpeg_xl(mip, distance) for mip in chain]
        stored += sum(size for size, _ in files)
        spent += time.process_time() - began
        pictures.append(picture_quality(texture.pixels, files[0][1], number % flip_every == 0))
        report(number + 1, len(textures))
    bits = 8.0 * stored / texel_count([texture.size for texture in textures])
    return tuple(pictures), SetQuality.of(pictures, bits, spent, bits)
