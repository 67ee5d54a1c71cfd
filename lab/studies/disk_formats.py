"""Textures as files that are small on disk: JPEG, and Basis Universal's XUASTC and ETC1S in KTX2, by Pillow and alktx2."""

import io
import time
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from lab.studies.set_quality import PictureQuality, SetQuality, picture_quality, texel_count
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


def measured_disk_format(
    textures: Sequence[SourceTexture],
    name: DiskFormat,
    quality: int,
    flip_every: int,
    report: Callable[[int, int], None] = lambda _done, _of: None,
) -> tuple[tuple[PictureQuality, ...], SetQuality]:
    """Each texture's quality and the set's; bits are those of the files, all mips. Raises InputError."""
    spent, stored, pictures = 0.0, 0, []
    for number, texture in enumerate(textures):
        began = time.process_time()
        size, shown = disk_file(texture.pixels, name, quality)
        spent += time.process_time() - began
        stored += size
        pictures.append(picture_quality(texture.pixels, shown, number % flip_every == 0))
        report(number + 1, len(textures))
    bits = 8.0 * stored / texel_count([texture.size for texture in textures])
    return tuple(pictures), SetQuality.of(pictures, bits, spent, bits)
