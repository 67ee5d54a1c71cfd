"""Measurement of file formats: JPEG (Pillow), Basis Universal's XUASTC and ETC1S in KTX2 (alktx2), and JPEG XL (OpenImageIO).

JPEG XL is a bound without random access, and is measured if the build of OpenImageIO has it.
"""

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
"""Effort of alktx2, 0 to 10."""
DISTANCES = (0.1, 0.25, 0.5, 1.0, 2.0, 3.0, 5.0)
"""Distances of JPEG XL, from nearly exact to coarse; 1 is just invisible."""
JPEG_XL_EFFORT = 7
"""Effort of JPEG XL, 1 to 9; the encoder's default."""
SUBSAMPLING_420 = 2
"""Number of 4:2:0 in Pillow."""


def _jpeg(pixels: NDArray[np.uint8], quality: int) -> tuple[int, NDArray[np.uint8]]:
    """Return (bytes of the JPEG file, its decoded pixels) of `pixels` [H, W, 3]."""
    file = io.BytesIO()
    Image.fromarray(pixels).save(file, "jpeg", quality=quality, subsampling=SUBSAMPLING_420, optimize=True)
    return len(file.getvalue()), np.asarray(Image.open(file))


def _basis(pixels: NDArray[np.uint8], name: DiskFormat, quality: int) -> tuple[int, NDArray[np.uint8]]:
    """Return (bytes of the KTX2 file with all mips, decoded mip 0) of `pixels` [H, W, 3]."""
    height, width = pixels.shape[:2]
    rgba = np.dstack([pixels, np.full((height, width), 255, np.uint8)]).tobytes()
    codec = {"codec": "xuastc_ldr", "xuastc_syntax": "arith"} if name == "xuastc" else {"codec": "etc1s"}
    file = alktx2.encode_raw_rgba_to_ktx2(
        rgba, width, height, False, quality=quality, effort=EFFORT, mipmaps=True, threads=1, **codec
    )
    shown = Image.open(io.BytesIO(alktx2.decode_ktx2_to_bytes(file)[0])).convert("RGB")
    return len(file), np.asarray(shown)[:height, :width]


def side_by_side(mips: Sequence[NDArray[np.uint8]]) -> NDArray[np.uint8]:
    """Return a picture [height, width, C] uint8 with mip 0 on the left and all others on the right; gaps have the mean colour."""
    first, others = mips[0], mips[1:]
    height = max(first.shape[0], sum(mip.shape[0] for mip in others))
    width = first.shape[1] + max((mip.shape[1] for mip in others), default=0)
    sheet = np.empty((height, width, first.shape[2]), np.uint8)
    sheet[:] = np.rint(first.mean((0, 1)))
    sheet[: first.shape[0], : first.shape[1]] = first
    row = 0
    for mip in others:
        sheet[row : row + mip.shape[0], first.shape[1] : first.shape[1] + mip.shape[1]] = mip
        row += mip.shape[0]
    return sheet


def disk_file(pixels: NDArray[np.uint8], name: DiskFormat, quality: int) -> tuple[int, NDArray[np.uint8]]:
    """Return (bytes with all mips, decoded mip 0) of the sRGB picture `pixels` [H, W, 3] in a format.

    A JPEG file has all mips side by side. Raises InputError where the encoder is not installed.
    """
    if name == "jpeg":
        size, shown = _jpeg(side_by_side(mip_chain(pixels, "srgb")), quality)
        return size, shown[: pixels.shape[0], : pixels.shape[1]]
    if alktx2 is None:
        raise InputError(f"{TITLES[name]} needs the extra `export`: pip install 'ntc-viewer[export]'")
    return _basis(pixels, name, quality)


def has_jpeg_xl() -> bool:
    """Return whether this build of OpenImageIO writes JPEG XL."""
    return "jpegxl" in str(OpenImageIO.get_string_attribute("format_list")).split(",")


def jpeg_xl(pixels: NDArray[np.uint8], distance: float) -> tuple[int, NDArray[np.uint8]]:
    """Return (bytes of the JPEG XL file, its decoded pixels) of `pixels` [H, W, C] uint8. Raises InputError."""
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
    """Return (bytes of one JPEG XL file per mip, decoded mip 0) of the sRGB picture `pixels` [H, W, 3]. Raises InputError."""
    files = [jpeg_xl(mip, distance) for mip in mip_chain(pixels, "srgb")]
    return sum(size for size, _ in files), files[0][1]


def measured_files(
    textures: Sequence[SourceTexture],
    encode: Callable[[NDArray[np.uint8]], tuple[int, NDArray[np.uint8]]],
    flip_every: int,
    report: Callable[[int, int], None] = lambda _done, _of: None,
) -> SetQuality:
    """Return the quality of textures in the format of `encode`, which returns (bytes of all mips, decoded mip 0).

    Raises InputError.
    """
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
