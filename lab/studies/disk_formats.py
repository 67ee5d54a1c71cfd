"""Textures as files that are small on disk: JPEG (Pillow), Basis Universal's XUASTC and ETC1S in KTX2 (alktx2), and JPEG XL
(OpenImageIO, if its build has it), a bound without random access."""

import io
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import OpenImageIO
from numpy.typing import NDArray
from PIL import Image

from lab.studies.set_quality import SetQuality, picture_quality, texel_count
from lab.studies.settings import DiskFormat
from ntc.codec.mips import mip_chain
from ntc.codec.textures import SourceTexture
from ntc.errors import InputError

alktx2: Any
try:
    import alktx2
except ImportError:
    alktx2 = None

TITLES: dict[DiskFormat, str] = {"jpeg": "JPEG 4:2:0", "xuastc": "XUASTC", "etc1s": "ETC1S"}
EFFORT = 6
"""Of alktx2, up to 10."""
DISTANCES = (0.1, 0.25, 0.5, 1.0, 2.0, 3.0, 5.0)
"""Settings of JPEG XL, from nearly exact to coarse; 1 is what a viewer just does not see."""
JPEG_XL_EFFORT = 7
"""Of 9; the encoder's own default."""
SUBSAMPLING_420 = 2
"""Pillow's number of it."""


def _jpeg(pixels: NDArray[np.uint8], quality: int) -> tuple[int, NDArray[np.uint8]]:
    """(bytes of the file, what is read from it) of `pixels` [H, W, 3]."""
    file = io.BytesIO()
    Image.fromarray(pixels).save(file, "jpeg", quality=quality, subsampling=SUBSAMPLING_420, optimize=True)
    return len(file.getvalue()), np.asarray(Image.open(file))


def _basis(pixels: NDArray[np.uint8], name: DiskFormat, quality: int) -> tuple[int, NDArray[np.uint8]]:
    """(bytes of the file with all mips, mip 0 as read from it) of `pixels` [H, W, 3]."""
    height, width = pixels.shape[:2]
    rgba = np.dstack([pixels, np.full((height, width), 255, np.uint8)]).tobytes()
    codec = {"codec": "xuastc_ldr", "xuastc_syntax": "arith"} if name == "xuastc" else {"codec": "etc1s"}
    file = alktx2.encode_raw_rgba_to_ktx2(
        rgba, width, height, False, quality=quality, effort=EFFORT, mipmaps=True, threads=1, **codec
    )
    shown = Image.open(io.BytesIO(alktx2.decode_ktx2_to_bytes(file)[0])).convert("RGB")
    return len(file), np.asarray(shown)[:height, :width]


def side_by_side(mips: Sequence[NDArray[np.uint8]]) -> NDArray[np.uint8]:
    """[height, width, C] uint8: mip 0, and on its right all others, one below the other; the rest is a mean colour."""
    first, others = mips[0], mips[1:]
    height = max(first.shape[0], sum(mip.shape[0] for mip in others))
    width = first.shape[1] + max((mip.shape[1] for mip in others), default=0)
    found = np.empty((height, width, first.shape[2]), np.uint8)
    found[:] = np.rint(first.mean((0, 1)))
    found[: first.shape[0], : first.shape[1]] = first
    row = 0
    for mip in others:
        found[row : row + mip.shape[0], first.shape[1] : first.shape[1] + mip.shape[1]] = mip
        row += mip.shape[0]
    return found


def disk_file(pixels: NDArray[np.uint8], name: DiskFormat, quality: int) -> tuple[int, NDArray[np.uint8]]:
    """(bytes with all mips, what is read of mip 0) of the sRGB picture `pixels` [H, W, 3] in a format. JPEG takes one file with
    all mips side by side.

    Raises InputError where the encoder is not installed.
    """
    if name == "jpeg":
        size, shown = _jpeg(side_by_side(mip_chain(pixels, "srgb")), quality)
        return size, shown[: pixels.shape[0], : pixels.shape[1]]
    if alktx2 is None:
        raise InputError(f"{TITLES[name]} needs the extra `export`: pip install 'ntc-viewer[export]'")
    return _basis(pixels, name, quality)


def has_jpeg_xl() -> bool:
    """Whether this build of OpenImageIO writes JPEG XL."""
    return "jpegxl" in str(OpenImageIO.get_string_attribute("format_list")).split(",")


def jpeg_xl(pixels: NDArray[np.uint8], distance: float) -> tuple[int, NDArray[np.uint8]]:
    """(bytes of the file, what is read from it) of `pixels` [H, W, C] uint8. Raises InputError where it cannot be written."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "texture.jxl"
        image = OpenImageIO.ImageBuf(np.ascontiguousarray(pixels))
        image.specmod().attribute("jpegxl:distance", float(distance))
        image.specmod().attribute("jpegxl:effort", JPEG_XL_EFFORT)
        read = OpenImageIO.ImageBuf(str(file)).get_pixels(OpenImageIO.UINT8) if image.write(str(file)) else None
        if read is None or read.shape != pixels.shape:
            raise InputError(f"JPEG XL: OpenImageIO cannot write it ({image.geterror() or 'another size was read'})")
        return file.stat().st_size, np.asarray(read)


def jpeg_xl_files(pixels: NDArray[np.uint8], distance: float) -> tuple[int, NDArray[np.uint8]]:
    """(bytes of a file for each mip, mip 0 as read) of the sRGB picture `pixels` [H, W, 3]. Raises InputError."""
    files = [jpeg_xl(mip, distance) for mip in mip_chain(pixels, "srgb")]
    return sum(size for size, _ in files), files[0][1]


def measured_files(
    textures: Sequence[SourceTexture],
    encode: Callable[[NDArray[np.uint8]], tuple[int, NDArray[np.uint8]]],
    flip_every: int,
    report: Callable[[int, int], None] = lambda _done, _of: None,
) -> SetQuality:
    """The quality of textures as `encode` stores them: it returns the bytes of all mips, and mip 0 as read. Raises InputError."""
    spent, stored, pictures = 0.0, 0, []
    for number, texture in enumerate(textures):
        began = time.process_time()
        size, shown = encode(texture.pixels)
        spent += time.process_time() - began
        stored += size
        pictures.append(picture_quality(texture.pixels, shown, number % flip_every == 0))
        report(number + 1, len(textures))
    bits = 8.0 * stored / texel_count([texture.size for texture in textures])
    return SetQuality.of(pictures, bits, spent, bits)
