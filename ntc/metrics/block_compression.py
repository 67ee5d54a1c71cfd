"""What graphics hardware's own texture formats make of a picture: BC1 and BC7, as yardsticks of quality for size."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ntc.errors import InputError
from ntc.features.pixels import as_rgb, check_image

BlockFormat = Literal["bc1", "bc7"]

BLOCK_SIDE = 4
BC1_LEVEL = 18
"""Quicktex's highest."""
BC7_UBER_LEVEL = 4
"""Etcpak's highest."""
_MISSING = "block compression: the packages are not installed ({}); pip install 'ntc-viewer[lab]'"


@dataclass(frozen=True, eq=False)
class BlockCompressed:
    """A picture in blocks of 4x4 texels, and what hardware reads from them."""

    decoded: NDArray[np.uint8]
    """[H, W, C] uint8, coded as the picture was; of BC1 without the picture's alpha, so C is 1 or 3."""
    blocks: bytes
    """As hardware takes them, row by row, those over the edge included."""

    @property
    def bits_per_texel(self) -> float:
        """Bits of all blocks per texel of the picture: 4 (BC1) or 8 (BC7), more where a side is not a multiple of 4."""
        height, width, _ = self.decoded.shape
        return float(8.0 * len(self.blocks) / (height * width))


def _padded_rgba(pixels: NDArray[np.uint8], with_alpha: bool) -> NDArray[np.uint8]:
    """[whole blocks, whole blocks, 4] uint8: grey repeated, alpha 255 where there is none or it is not wanted."""
    height, width, channels = pixels.shape
    rgba = np.full((height, width, 4), 255, np.uint8)
    rgba[..., :3] = as_rgb(pixels)
    if with_alpha and channels % 2 == 0:
        rgba[..., 3] = pixels[..., -1]
    return np.pad(rgba, ((0, -height % BLOCK_SIDE), (0, -width % BLOCK_SIDE), (0, 0)), mode="edge")


def _encode_bc1(rgba: NDArray[np.uint8]) -> bytes:
    try:
        from quicktex import RawTexture
        from quicktex.s3tc.bc1 import BC1Encoder
    except ImportError as error:
        raise InputError(_MISSING.format(error)) from error
    # Three colours may be the better fit of a block; the fourth, black without alpha, is never used.
    encoder = BC1Encoder(BC1_LEVEL, BC1Encoder.ColorMode.ThreeColor)
    return bytes(encoder.encode(RawTexture.frombytes(rgba.tobytes(), rgba.shape[1], rgba.shape[0])))


def _encode_bc7(rgba: NDArray[np.uint8]) -> bytes:
    try:
        import etcpak
    except ImportError as error:
        raise InputError(_MISSING.format(error)) from error
    settings = etcpak.BC7CompressBlockParams()
    # It starts with weights of how colours look, and would lose 0.8 to 1.1 dB of PSNR by them.
    settings.init_linear_weights()
    settings.m_uber_level = BC7_UBER_LEVEL
    settings.m_mode17_partition_estimation_filterbank = False
    return etcpak.compress_bc7(rgba.tobytes(), rgba.shape[1], rgba.shape[0], settings)


def _decode(blocks: bytes, width: int, height: int, number: int) -> NDArray[np.uint8]:
    """[height, width, 4] uint8 of BC`number` blocks; whole blocks only."""
    # By Pillow: etcpak 0.9.15 decodes into memory that it does not own.
    try:
        from PIL import Image
    except ImportError as error:
        raise InputError(_MISSING.format(error)) from error
    return np.asarray(Image.frombytes("RGBA", (width, height), blocks, "bcn", number))


def compress(pixels: NDArray[np.uint8], block_format: BlockFormat) -> BlockCompressed:
    """`pixels` [H, W, C] uint8 in BC1 (4 bits a texel) or BC7 (8 bits), C from 1 to 4; least squared error is sought.

    BC1 is by quicktex 0.3.1 (rgbcx), level 18 of 18; BC7 by etcpak 0.9.15 (bc7enc), uber level 4 of 4 with all 64
    partitions, which knows four of BC7's eight modes (1, 5, 6 and 7), so that the format can do a little better still.
    Of one or two channels the first is grey: repeated, and read from green, which BC1 keeps finest. The second and the
    fourth one are alpha: kept by BC7, left out of BC1. Sides that are not a multiple of 4 are padded with their last
    texels. Raises InputError for another shape, type or format, and where the encoders are not installed.
    """
    check_image(pixels)
    height, width, channels = pixels.shape
    colors = [1] if channels <= 2 else [0, 1, 2]
    if block_format == "bc1":
        rgba = _padded_rgba(pixels, with_alpha=False)
        blocks, number, kept = _encode_bc1(rgba), 1, colors
    elif block_format == "bc7":
        rgba = _padded_rgba(pixels, with_alpha=True)
        blocks, number, kept = _encode_bc7(rgba), 7, colors + [3] * (channels % 2 == 0)
    else:
        raise InputError(f"block format {block_format}: choose bc1 or bc7")
    decoded = _decode(blocks, rgba.shape[1], rgba.shape[0], number)
    return BlockCompressed(np.ascontiguousarray(decoded[:height, :width, kept]), blocks)
