"""Image files with mips in blocks of graphics hardware: DDS for BC1 and BC7, KTX2 for ASTC."""

import struct
from collections.abc import Sequence
from typing import Final

from ntc.metrics.block_compression import BlockFormat, block_size
from viewer.scene.ktx2 import ASTC_BLOCKS, FIRST_ASTC, SIGNATURE, dds_header

DXGI_FORMATS: Final = {("bc1", False): 71, ("bc1", True): 72, ("bc7", False): 98, ("bc7", True): 99}
"""By format, and whether colours are sRGB: DXGI_FORMAT of the same name, UNORM or UNORM_SRGB."""
ASTC_BYTES: Final = 16
COLOR_MODEL_ASTC: Final = 162
LINEAR, SRGB = 1, 2
"""Transfer functions of a data format descriptor (Khronos Data Format 1.3)."""
UNSPECIFIED, BT709 = 0, 1
"""Colour primaries of a data format descriptor. EXT_texture_astc demands UNSPECIFIED of data that are not colours."""
_INDEX: Final = struct.Struct("<9I4I2Q")
_LEVEL: Final = struct.Struct("<3Q")

Mip = tuple[int, int, bytes]
"""(width, height, blocks row by row, those over the edge included)."""


def dds(mips: Sequence[Mip], block_format: BlockFormat, srgb: bool) -> bytes:
    """A DDS file of BC1 or BC7 blocks, the largest mip first."""
    width, height, blocks = mips[0]
    header = dds_header(width, height, len(blocks), DXGI_FORMATS[block_format, srgb], len(mips))
    return b"".join([header, *(data for _, _, data in mips)])


def _descriptor(block: tuple[int, int], srgb: bool) -> bytes:
    """Data format descriptor of ASTC: one basic block with one sample, as the specification's table has it."""
    sample = struct.pack("<HBB4BII", 0, 127, 0, 0, 0, 0, 0, 0, 0xFFFFFFFF)
    size = 24 + len(sample)
    colors = (COLOR_MODEL_ASTC, BT709, SRGB, 0) if srgb else (COLOR_MODEL_ASTC, UNSPECIFIED, LINEAR, 0)
    basic = struct.pack("<IHH4B4B8B", 0, 2, size, *colors, block[0] - 1, block[1] - 1, 0, 0, ASTC_BYTES, *[0] * 7)
    return struct.pack("<I", 4 + size) + basic + sample


def ktx2_astc(mips: Sequence[Mip], block_format: BlockFormat, srgb: bool) -> bytes:
    """Return a KTX2 file of ASTC blocks as EXT_texture_astc demands it, without supercompression; `mips` from the largest to 1x1."""
    block = block_size(block_format)
    number = FIRST_ASTC + 2 * ASTC_BLOCKS.index(block_format) + int(srgb)
    width, height, _ = mips[0]
    descriptor = _descriptor(block, srgb)
    first = len(SIGNATURE) + _INDEX.size + _LEVEL.size * len(mips)
    place = first + len(descriptor)
    levels: list[bytes] = []
    parts: list[bytes] = []
    # The smallest lies first in the file (KTX 2.0, Sec. 3.9), each at a multiple of its block's bytes.
    for _, _, data in reversed(mips):
        gap = -place % ASTC_BYTES
        parts += [b"\0" * gap, data]
        levels.insert(0, _LEVEL.pack(place + gap, len(data), len(data)))
        place += gap + len(data)
    index = _INDEX.pack(number, 1, width, height, 0, 0, 1, len(mips), 0, first, len(descriptor), 0, 0, 0, 0)
    return b"".join([SIGNATURE, index, *levels, descriptor, *parts])
