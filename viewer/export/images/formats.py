"""What decoded mips are stored as, and what is read from that."""

import io
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from ntc.errors import InputError
from ntc.metrics.block_compression import BlockFormat, compressed_blocks, decompress
from viewer.export import ImageFormat
from viewer.export.images.containers import dds, ktx2_astc
from viewer.scene.images import decode_image

ASTC: BlockFormat = "astc-6x6"
"""3.56 bits a texel: between BC1 and BC7."""
UASTC_EFFORT = 2
WITHOUT_RATE_DISTORTION = 100
"""Of UASTC: below it blocks are made alike, so that they compress better, at a loss of up to 10 dB."""
ZSTANDARD_LEVEL = 9
Pixels = NDArray[np.uint8]


@dataclass(frozen=True)
class StoredImage:
    """An image in a format."""

    data: bytes
    """The file."""
    read: Pixels
    """[H, W, 3 or 4]: what hardware reads of its largest mip."""


@dataclass(frozen=True)
class StoredFormat:
    """A format of images, and how a glTF texture names one."""

    suffix: str
    mime_type: str
    extension: str
    """Of the glTF texture; "" where `source` names the image."""
    has_mips: bool
    store: Callable[[Sequence[Pixels], bool], StoredImage]
    """(mips [H, W, 3 or 4] from the largest on, whether colours are sRGB) -> file. Raises InputError without an encoder."""


def _png(mips: Sequence[Pixels], srgb: bool) -> StoredImage:
    del srgb  # PNGs of glTF tell nothing of it.
    buffer = io.BytesIO()
    Image.fromarray(mips[0]).save(buffer, "PNG")
    return StoredImage(buffer.getvalue(), mips[0])


def _basis(mips: Sequence[Pixels], srgb: bool) -> StoredImage:
    try:
        import alktx2
    except ImportError as error:
        raise InputError(
            f"--as ktx2: Basis Universal is encoded by alktx2 ({error}); pip install 'ntc-viewer[export]'"
        ) from error
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


def _blocks(wanted: BlockFormat) -> Callable[[Sequence[Pixels], bool], StoredImage]:
    def store(mips: Sequence[Pixels], srgb: bool) -> StoredImage:
        # BC1 would lose coverage.
        block_format: BlockFormat = "bc7" if wanted == "bc1" and mips[0].shape[2] == 4 else wanted
        kind: Literal["srgb", "linear"] = "srgb" if srgb else "linear"
        stored = [(mip.shape[1], mip.shape[0], compressed_blocks(mip, block_format, "medium", kind)) for mip in mips]
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
