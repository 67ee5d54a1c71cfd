"""Reader of KTX2 files (Khronos KTX 2.0): mip 0 of a single picture.

A KTX2 file is a header, an index of levels and the levels, each compressed as a whole by the header's scheme (Zstandard or ZLIB) or
not. The VkFormat in the header says what mip 0 holds, and so who decodes it:

- none (VK_FORMAT_UNDEFINED): Basis Universal, ETC1S or UASTC, transcoded to RGBA by opengl_basisu;
- 8-bit pixels: read as they are;
- BC1, BC3, BC4, BC5, BC7: put behind a DDS header, which OpenImageIO decodes;
- ASTC: decoded by `ntc.metrics.block_compression`.

Sizes in the header are checked against the length of the file before anything is allocated.
"""

import struct
import zlib
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from ntc.errors import InputError
from ntc.metrics.block_compression import BlockFormat, compressed_bytes, decompress

SIGNATURE: Final = b"\xabKTX 20\xbb\r\n\x1a\n"
_HEADER: Final = struct.Struct("<12s9I4I2Q")
"""Signature; format, size of its type, width, height, depth, layers, faces, levels, supercompression; offsets and lengths of the data
format descriptor, of the key/value data and of the supercompression's global data."""
_LEVEL: Final = struct.Struct("<3Q")
"""Offset, length, length without supercompression."""
NO_FORMAT: Final = 0
"""VK_FORMAT_UNDEFINED: for Basis Universal the data format descriptor names the kind of blocks."""
CHANNELS: Final = {9: 1, 15: 1, 16: 2, 22: 2, 23: 3, 29: 3, 37: 4, 43: 4}
"""Number of channels of 8-bit formats, by VkFormat: R8, R8G8, R8G8B8 and R8G8B8A8, each UNORM and SRGB."""
BLOCKS: Final = {
    131: (8, 71, "BC1"),
    132: (8, 72, "BC1"),
    133: (8, 71, "BC1"),
    134: (8, 72, "BC1"),
    137: (16, 77, "BC3"),
    138: (16, 78, "BC3"),
    139: (8, 80, "BC4"),
    141: (16, 83, "BC5"),
    145: (16, 98, "BC7"),
    146: (16, 99, "BC7"),
}
"""Block formats by VkFormat: bytes of a block of 4 x 4 texels, the DXGI_FORMAT of the same format, its name."""
OTHERS: Final = (
    (1, 8, "packed bits"),
    (70, 122, "more than 8 bits a channel"),
    (135, 136, "BC2"),
    (140, 140, "signed BC4"),
    (142, 142, "signed BC5"),
    (143, 144, "BC6H"),
    (147, 156, "ETC2 or EAC"),
)
"""First and last VkFormat of formats that are not read."""
FIRST_ASTC: Final = 157
"""VK_FORMAT_ASTC_4x4_UNORM_BLOCK; the sRGB format of each block size follows it, then the next size."""
ASTC_BLOCKS: Final[tuple[BlockFormat, ...]] = (
    "astc-4x4", "astc-5x4", "astc-5x5", "astc-6x5", "astc-6x6", "astc-8x5", "astc-8x6",
    "astc-8x8", "astc-10x5", "astc-10x6", "astc-10x8", "astc-10x10", "astc-12x10", "astc-12x12",
)  # fmt: skip
"""Block sizes of ASTC in the order of their VkFormats."""
SCHEMES: Final = {0: "none", 1: "BasisLZ", 2: "Zstandard", 3: "ZLIB"}
"""Names of the supercompression schemes, by their number in the header."""
_DDS: Final = struct.Struct("<4s7I44x8I5I5I")


@dataclass(frozen=True)
class _Container:
    """Checked header of a file with one picture."""

    name: str
    format: int
    width: int
    height: int
    scheme: int
    offset: int
    length: int
    """Bytes of mip 0."""


def is_ktx(data: bytes) -> bool:
    """Return whether `data` starts with the signature of a KTX file, of any version."""
    return data.startswith(SIGNATURE[:4])


def read_ktx2(data: bytes, name: str, largest_side: int, most_values: int) -> NDArray[np.uint8] | bytes:
    """Return mip 0 of the KTX2 file in `data`: pixels [H, W, 1 to 4] uint8, row 0 on top, or a DDS file with its blocks.

    `name` is for messages, `largest_side` in texels; `most_values` limits width x height x 4. Raises InputError for broken files,
    for cube maps, arrays and volumes, and for formats that are not in this module's tables.
    """
    container = _container(data, name)
    if max(container.width, container.height) > largest_side:
        raise InputError(
            f"{name}: image of {container.width} x {container.height}; sides are 1 to {largest_side} texels"
        )
    if container.width * container.height * 4 > most_values:
        raise InputError(
            f"{name}: {container.width} x {container.height} texels in {len(data)} bytes; the image is broken"
        )
    if container.format == NO_FORMAT:
        return _basis_pixels(data, name, container)
    if container.format in CHANNELS:
        channels = CHANNELS[container.format]
        level = _level(data, container, container.width * container.height * channels)
        return np.frombuffer(level, np.uint8).reshape(container.height, container.width, channels)
    if container.format in BLOCKS:
        block_bytes, format_number, _ = BLOCKS[container.format]
        blocks = -(-container.width // 4) * -(-container.height // 4)
        level = _level(data, container, blocks * block_bytes)
        return dds_header(container.width, container.height, len(level), format_number) + level
    if FIRST_ASTC <= container.format < FIRST_ASTC + 2 * len(ASTC_BLOCKS):
        return _astc_pixels(data, container)
    other = next((f" ({what})" for first, last, what in OTHERS if first <= container.format <= last), "")
    known = ", ".join(sorted({block[2] for block in BLOCKS.values()}))
    raise InputError(
        f"{name}: KTX2 of VkFormat {container.format}{other} is not read; give Basis Universal, ASTC, {known} or 8-bit pixels"
    )


def _container(data: bytes, name: str) -> _Container:
    if not data.startswith(SIGNATURE):
        raise InputError(f"{name}: KTX of another version than 2 is not read; convert it to KTX2 or PNG")
    if len(data) < _HEADER.size + _LEVEL.size:
        raise InputError(f"{name}: truncated KTX2 file ({len(data)} bytes); copy or export it again")
    _, vk_format, _, width, height, depth, layers, faces, _, scheme, *_ = _HEADER.unpack_from(data)
    for wrong, what in (
        (faces == 6, "a cube map"),
        (layers > 0, "an array of pictures"),
        (depth > 0, "a volume"),
        (height == 0, "a row of texels"),
    ):
        if wrong:
            raise InputError(f"{name}: {what} in KTX2 is not read; give one picture")
    if width == 0 or faces != 1 or scheme not in SCHEMES:
        raise InputError(f"{name}: the KTX2 header is broken; copy or export it again")
    offset, length, _ = _LEVEL.unpack_from(data, _HEADER.size)
    if offset + length > len(data):
        raise InputError(
            f"{name}: truncated KTX2 file ({len(data)} of {offset + length} bytes); copy or export it again"
        )
    return _Container(name, vk_format, width, height, scheme, offset, length)


def _level(data: bytes, container: _Container, size: int) -> bytes:
    """Return the `size` bytes of mip 0, decompressed. Raises InputError where mip 0 has another size."""
    packed = data[container.offset : container.offset + container.length]
    if container.scheme == 0:
        level = packed
    elif container.scheme == 2:
        level = _unpacked_zstandard(packed, size)
    elif container.scheme == 3:
        level = _unpacked_zlib(packed, size)
    else:
        raise InputError(
            f"{container.name}: {SCHEMES[container.scheme]} with VkFormat {container.format}; the KTX2 file is broken"
        )
    if len(level) != size:
        raise InputError(f"{container.name}: mip 0 does not hold the {size} bytes it should; the KTX2 file is broken")
    return level


def _unpacked_zstandard(packed: bytes, size: int) -> bytes:
    """Return the Zstandard data `packed` decompressed, at most `size` + 1 bytes; b"" where it is broken."""
    import zstandard

    try:
        with zstandard.ZstdDecompressor(max_window_size=1 << 27).stream_reader(packed) as reader:
            return bytes(reader.read(size + 1))
    except zstandard.ZstdError:
        return b""


def _unpacked_zlib(packed: bytes, size: int) -> bytes:
    """Return the ZLIB data `packed` decompressed, at most `size` + 1 bytes; b"" where it is broken."""
    try:
        return zlib.decompressobj().decompress(packed, size + 1)
    except zlib.error:
        return b""


def _basis_pixels(data: bytes, name: str, container: _Container) -> NDArray[np.uint8]:
    try:
        import opengl_basisu
    except ImportError as error:
        raise InputError(
            f"{name}: Basis Universal needs opengl-basisu, which has no wheel for this system; give a PNG beside it"
        ) from error
    try:
        texture = opengl_basisu.open(data)
        if (texture.width, texture.height) != (container.width, container.height):
            raise InputError(f"{name}: the KTX2 header is broken; copy or export it again")
        image = texture.transcode("rgba8")
    except (opengl_basisu.BasisuError, ValueError, IndexError, MemoryError) as error:
        raise InputError(f"{name}: the image does not decode ({error}); replace it") from error
    pixels = np.asarray(image.data, np.uint8)
    return pixels if texture.has_alpha else pixels[..., :3]


def _astc_pixels(data: bytes, container: _Container) -> NDArray[np.uint8]:
    """Return the pixels [H, W, 4] of mip 0 in ASTC blocks. Raises InputError where the decoder is not installed."""
    number, is_srgb = divmod(container.format - FIRST_ASTC, 2)
    kind: Literal["srgb", "linear"] = "srgb" if is_srgb else "linear"
    block_format = ASTC_BLOCKS[number]
    level = _level(data, container, compressed_bytes(container.width, container.height, block_format))
    try:
        return decompress(level, (container.height, container.width, 4), block_format, kind)
    except InputError as error:
        raise InputError(f"{container.name}: ASTC: {error}") from error


def dds_header(width: int, height: int, size: int, format_number: int, mips: int = 1) -> bytes:
    """Return the header of a DDS file of `mips` mips in the DXGI_FORMAT `format_number`. `size`: bytes of the largest mip."""
    flags, pixel_format, texture = 0x81007, (32, 4, 0x30315844, 0, 0, 0, 0, 0), 0x1000
    if mips > 1:
        flags, texture = flags | 0x20000, texture | 0x400008
    extended = (format_number, 3, 0, 1, 0)
    return _DDS.pack(b"DDS ", 124, flags, height, width, size, 0, mips, *pixel_format, texture, 0, 0, 0, 0, *extended)
