"""Image formats of exported textures: files made from mips, and the pixels that hardware decodes from them."""

import io
import struct
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from importlib.util import find_spec
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from ntc.errors import InputError
from ntc.metrics.block_compression import BlockFormat, block_size, compressed_blocks, decompress
from viewer.export import ImageFormat
from viewer.scene.images import decode_image
from viewer.scene.ktx2 import ASTC_BLOCKS, FIRST_ASTC, SIGNATURE, dds_header

DXGI_FORMATS: Final = {("bc1", False): 71, ("bc1", True): 72, ("bc7", False): 98, ("bc7", True): 99}
"""DXGI_FORMAT (UNORM, UNORM_SRGB) by block format and by whether colours are sRGB."""
ASTC_BYTES: Final = 16
COLOR_MODEL_ASTC: Final = 162
LINEAR, SRGB = 1, 2
"""Transfer functions of a data format descriptor (Khronos Data Format 1.3)."""
UNSPECIFIED, BT709 = 0, 1
"""Colour primaries of a data format descriptor. EXT_texture_astc demands UNSPECIFIED for data that are not colours."""
_INDEX: Final = struct.Struct("<9I4I2Q")
_LEVEL: Final = struct.Struct("<3Q")

Mip = tuple[int, int, bytes]
"""Mip of a file: (width, height, blocks row by row, partial edge blocks included)."""


def dds(mips: Sequence[Mip], block_format: BlockFormat, srgb: bool) -> bytes:
    """Return a DDS file of BC1 or BC7 blocks, the largest mip first."""
    width, height, blocks = mips[0]
    header = dds_header(width, height, len(blocks), DXGI_FORMATS[block_format, srgb], len(mips))
    return b"".join([header, *(data for _, _, data in mips)])


def _descriptor(block: tuple[int, int], srgb: bool) -> bytes:
    """Return the data format descriptor of ASTC: one basic block with one sample (Khronos Data Format 1.3)."""
    sample = struct.pack("<HBB4BII", 0, 127, 0, 0, 0, 0, 0, 0, 0xFFFFFFFF)
    size = 24 + len(sample)
    colors = (COLOR_MODEL_ASTC, BT709, SRGB, 0) if srgb else (COLOR_MODEL_ASTC, UNSPECIFIED, LINEAR, 0)
    basic = struct.pack("<IHH4B4B8B", 0, 2, size, *colors, block[0] - 1, block[1] - 1, 0, 0, ASTC_BYTES, *[0] * 7)
    return struct.pack("<I", 4 + size) + basic + sample


def ktx2_astc(mips: Sequence[Mip], block_format: BlockFormat, srgb: bool) -> bytes:
    """Return a KTX2 file of ASTC blocks after EXT_texture_astc, without supercompression; `mips` from the largest to 1x1."""
    block = block_size(block_format)
    number = FIRST_ASTC + 2 * ASTC_BLOCKS.index(block_format) + int(srgb)
    width, height, _ = mips[0]
    descriptor = _descriptor(block, srgb)
    first = len(SIGNATURE) + _INDEX.size + _LEVEL.size * len(mips)
    place = first + len(descriptor)
    levels: list[bytes] = []
    parts: list[bytes] = []
    # The smallest mip is first in the file (KTX 2.0, Sec. 3.9). Each mip begins at a multiple of the bytes of a block.
    for _, _, data in reversed(mips):
        gap = -place % ASTC_BYTES
        parts += [b"\0" * gap, data]
        levels.insert(0, _LEVEL.pack(place + gap, len(data), len(data)))
        place += gap + len(data)
    index = _INDEX.pack(number, 1, width, height, 0, 0, 1, len(mips), 0, first, len(descriptor), 0, 0, 0, 0)
    return b"".join([SIGNATURE, index, *levels, descriptor, *parts])


ASTC: BlockFormat = "astc-6x6"
"""ASTC format of exports: 3.56 bits per texel, between BC1 and BC7."""
UASTC_EFFORT = 2
WITHOUT_RATE_DISTORTION = 100
"""Quality of UASTC without rate-distortion optimisation, which makes blocks alike: smaller files, but a loss of up to 10 dB."""
ZSTANDARD_LEVEL = 9
Pixels = NDArray[np.uint8]


@dataclass(frozen=True)
class StoredImage:
    """Image as a file of one format."""

    data: bytes
    """Content of the file."""
    read: Pixels
    """[H, W, 3 or 4] largest mip, as hardware decodes it."""


@dataclass(frozen=True)
class StoredFormat:
    """Format of images, and the way in which a glTF texture names such an image."""

    suffix: str
    mime_type: str
    extension: str
    """Extension of the glTF texture; "" where `source` names the image."""
    has_mips: bool
    store: Callable[[Sequence[Pixels], bool], StoredImage]
    """Function: (mips [H, W, 3 or 4], the largest first; whether colours are sRGB) -> image. Raises InputError without an encoder."""


def _png(mips: Sequence[Pixels], srgb: bool) -> StoredImage:
    del srgb  # glTF ignores the colour space of a PNG.
    buffer = io.BytesIO()
    Image.fromarray(mips[0]).save(buffer, "PNG")
    return StoredImage(buffer.getvalue(), mips[0])


def missing_ktx2() -> str:
    """Return the line that installs the encoder of KTX2; "" where it is installed."""
    return "" if find_spec("alktx2") is not None else "alktx2 is not installed: pip install 'ntc-viewer[export]'"


def _basis(mips: Sequence[Pixels], srgb: bool) -> StoredImage:
    if missing := missing_ktx2():
        raise InputError(f"--as ktx2: {missing}")
    import alktx2

    with_alpha = mips[0].shape[2] == 4
    levels = [(_rgba(mip).tobytes(), mip.shape[1], mip.shape[0]) for mip in mips]
    data = bytes(
        alktx2.encode_raw_mips_to_ktx2(
            levels,
            with_alpha,
            codec="uastc",
            quality=WITHOUT_RATE_DISTORTION,
            effort=UASTC_EFFORT,
            srgb=srgb,
            linear=not srgb,
            zstd_supercompression_level=ZSTANDARD_LEVEL,
        )
    )
    return StoredImage(data, decode_image(data, "KTX2")[..., : mips[0].shape[2]])


def _rgba(pixels: Pixels) -> Pixels:
    if pixels.shape[2] == 4:
        return np.ascontiguousarray(pixels)
    return np.dstack([pixels, np.full(pixels.shape[:2], 255, np.uint8)])


Compressor = Callable[[Pixels], bytes]
"""Function: pixels [H, W, 4] -> BC7 blocks; partial edge blocks repeat the last texels."""


def _blocks(
    wanted: BlockFormat, compressor: Compressor | None = None
) -> Callable[[Sequence[Pixels], bool], StoredImage]:
    def store(mips: Sequence[Pixels], srgb: bool) -> StoredImage:
        # BC1 has no alpha: images with coverage become BC7.
        block_format: BlockFormat = "bc7" if wanted == "bc1" and mips[0].shape[2] == 4 else wanted
        kind: Literal["srgb", "linear"] = "srgb" if srgb else "linear"

        def blocks_of(mip: Pixels) -> bytes:
            if compressor is not None and block_format == "bc7":
                return compressor(_rgba(mip))
            return compressed_blocks(mip, block_format, "medium", kind)

        stored = [(mip.shape[1], mip.shape[0], blocks_of(mip)) for mip in mips]
        height, width, channels = mips[0].shape
        read = decompress(stored[0][2], (height, width, channels), block_format, kind)
        container = ktx2_astc if block_format.startswith("astc") else dds
        return StoredImage(container(stored, block_format, srgb), read)

    return store


FORMATS: Mapping[ImageFormat, StoredFormat] = {
    "png": StoredFormat(".png", "image/png", "", False, _png),
    "ktx2": StoredFormat(".ktx2", "image/ktx2", "KHR_texture_basisu", True, _basis),
    "bc7": StoredFormat(".dds", "image/vnd-ms.dds", "MSFT_texture_dds", True, _blocks("bc7")),
    "bc1": StoredFormat(".dds", "image/vnd-ms.dds", "MSFT_texture_dds", True, _blocks("bc1")),
    "astc": StoredFormat(".ktx2", "image/ktx2", "EXT_texture_astc", True, _blocks(ASTC)),
}


def stored_format(image_format: ImageFormat, compressor: Compressor | None = None) -> StoredFormat:
    """Return a format of FORMATS. `compressor` encodes its BC7 blocks; without one, the encoder of the extra `lab` does."""
    unchanged = FORMATS[image_format]
    if compressor is None or image_format not in ("bc7", "bc1"):
        return unchanged
    return replace(unchanged, store=_blocks(image_format, compressor))
