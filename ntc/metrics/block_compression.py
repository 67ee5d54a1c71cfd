"""Block compression of pictures in the formats of graphics hardware (BC1, BC7, ASTC), to compare quality and size with.

Encoders and decoders are packages of the extra `lab`. They work on whole blocks of RGBA.
"""

from dataclasses import dataclass
from functools import cache, lru_cache
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from threading import get_ident
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from ntc.errors import InputError
from ntc.features.pixels import as_rgb, check_image

Effort = Literal["medium", "thorough"]
"""Effort of encoders: `thorough` takes 4 (ASTC), 15 (BC1) or 2 (BC7) times as long as `medium`."""

AstcKind = Literal["srgb", "linear", "normal"]
"""Kind of the data to encode: colours, linear data, or normals, as two channels in astcenc's normal mode."""

BC1_LEVELS: dict[Effort, int] = {"medium": 8, "thorough": 18}
"""Level of quicktex, up to 18."""
BC7_UBER_LEVELS: dict[Effort, int] = {"medium": 1, "thorough": 4}
"""Level of etcpak, up to 4."""
ASTC_QUALITIES: dict[Effort, float] = {"medium": 60.0, "thorough": 98.0}
"""Quality of astcenc, up to 100."""
CACHED_CONTEXTS = 16
"""Contexts of astcenc that stay in memory."""
_CHECKOUT = Path(__file__).resolve().parents[2] / "pyproject.toml"
INSTALL_HINT = f"pip install '{'.' if _CHECKOUT.is_file() else 'ntc-viewer'}[lab]'"
"""Command that installs the packages: from this checkout, or from the package index."""
_MISSING = "block compression: the packages are not installed ({}); " + INSTALL_HINT


def _package(name: str) -> Any:
    """Import a package of the extra `lab`. Raises InputError where it is not installed."""
    try:
        import_module(name.partition(".")[0])
        return import_module(name)
    except ImportError as error:
        raise InputError(_MISSING.format(error)) from error


def encode_bc1(rgba: NDArray[np.uint8], effort: Effort) -> bytes:
    """Return BC1 blocks of `rgba` [H, W, 4], whole blocks. Raises InputError where quicktex is not installed."""
    quicktex, bc1 = _package("quicktex"), _package("quicktex.s3tc.bc1")
    # A palette of three colours may fit a block better; its fourth entry, transparent black, is never used.
    encoder = bc1.BC1Encoder(BC1_LEVELS[effort], bc1.BC1Encoder.ColorMode.ThreeColor)
    return bytes(encoder.encode(quicktex.RawTexture.frombytes(rgba.tobytes(), rgba.shape[1], rgba.shape[0])))


def encode_bc7(rgba: NDArray[np.uint8], effort: Effort) -> bytes:
    """Return BC7 blocks of `rgba` [H, W, 4], whole blocks. Raises InputError where etcpak is not installed."""
    etcpak = _package("etcpak")
    settings = etcpak.BC7CompressBlockParams()
    # Its default weights are perceptual and lose 0.8 to 1.1 dB of PSNR.
    settings.init_linear_weights()
    settings.m_uber_level = BC7_UBER_LEVELS[effort]
    settings.m_mode17_partition_estimation_filterbank = False
    blocks: bytes = etcpak.compress_bc7(rgba.tobytes(), rgba.shape[1], rgba.shape[0], settings)
    return blocks


def decode_bc(blocks: bytes, width: int, height: int, number: int) -> NDArray[np.uint8]:
    """Return [height, width, 4] uint8 of BC`number` blocks, whole blocks. Raises InputError where Pillow is not installed."""
    # Pillow decodes, because etcpak 0.9.15 writes beyond its memory.
    image = _package("PIL.Image")
    return np.asarray(image.frombytes("RGBA", (width, height), blocks, "bcn", number))


def encode_bc5(rgba: NDArray[np.uint8]) -> bytes:
    """Return BC5 blocks of red and green of `rgba` [H, W, 4], whole blocks. Raises InputError where quicktex is not installed."""
    quicktex, bc5 = _package("quicktex"), _package("quicktex.s3tc.bc5")
    return bytes(
        bc5.BC5Encoder(0, 1).encode(quicktex.RawTexture.frombytes(rgba.tobytes(), rgba.shape[1], rgba.shape[0]))
    )


def decode_bc5(blocks: bytes, width: int, height: int) -> NDArray[np.uint8]:
    """Return [height, width, 2] uint8 of BC5 blocks, whole blocks. Raises InputError where Pillow is not installed."""
    image = _package("PIL.Image")
    return np.asarray(image.frombytes("RGB", (width, height), blocks, "bcn", 5))[..., :2]


@lru_cache(maxsize=CACHED_CONTEXTS)
def _astc_context(block: tuple[int, int], effort: Effort, kind: AstcKind, _thread: int) -> Any:
    """Return a context of astcenc for the calling thread. Contexts are cached: making one takes longer than encoding a small mip."""
    astc = _package("astc_encoder")
    profile = astc.ASTCProfile.LDR_SRGB if kind == "srgb" else astc.ASTCProfile.LDR
    flags = astc.ASTCConfigFlags.MAP_NORMAL if kind == "normal" else astc.ASTCConfigFlags(0)
    return astc.ASTCContext(astc.ASTCConfig(profile, *block, 1, ASTC_QUALITIES[effort], flags))


def encode_astc(rgba: NDArray[np.uint8], block: tuple[int, int], effort: Effort, kind: AstcKind = "srgb") -> bytes:
    """Return ASTC LDR blocks of (width, height) `block` of `rgba` [H, W, 4]; normals have x in red and y in green.

    Raises InputError without astc-encoder-py.
    """
    astc, context = _package("astc_encoder"), _astc_context(block, effort, kind, get_ident())
    image = astc.ASTCImage(astc.ASTCType.U8, rgba.shape[1], rgba.shape[0], 1, rgba.tobytes())
    return bytes(context.compress(image, astc.ASTCSwizzle.from_str("RRRG" if kind == "normal" else "RGBA")))


def decode_astc(
    blocks: bytes, width: int, height: int, block: tuple[int, int], kind: AstcKind = "srgb"
) -> NDArray[np.uint8]:
    """Return [height, width, 4] uint8 of ASTC LDR blocks, whole blocks; normals have x in red and y in alpha.

    Raises InputError without astc-encoder-py.
    """
    astc, context = _package("astc_encoder"), _astc_context(block, "medium", kind, get_ident())
    image = astc.ASTCImage(astc.ASTCType.U8, width, height, 1)
    context.decompress(blocks, image, astc.ASTCSwizzle.from_str("RGBA"))
    if image.data is None or len(image.data) != 4 * width * height:
        raise InputError(f"ASTC {block[0]}x{block[1]}: astc-encoder-py decoded nothing; install it again")
    return np.frombuffer(image.data, np.uint8).reshape(height, width, 4)


BlockFormat = Literal[
    "bc1",
    "bc7",
    "astc-4x4",
    "astc-5x4",
    "astc-5x5",
    "astc-6x5",
    "astc-6x6",
    "astc-8x5",
    "astc-8x6",
    "astc-10x5",
    "astc-10x6",
    "astc-8x8",
    "astc-10x8",
    "astc-10x10",
    "astc-12x10",
    "astc-12x12",
]
BLOCK_FORMATS: tuple[BlockFormat, ...] = get_args(BlockFormat)
"""All formats: BC, then ASTC from most to fewest bits per texel."""


def named_format(name: str | None) -> BlockFormat | None:
    """Return the block format called `name`, or None if there is none."""
    return next((block_format for block_format in BLOCK_FORMATS if block_format == name), None)


@cache
def missing_packages(block_format: BlockFormat) -> str:
    """Return a line that says which packages of a format are missing and how to install them; "" if none is."""
    needed = ("astc_encoder",) if block_format.startswith("astc") else ("quicktex", "etcpak", "PIL")
    absent = [name for name in needed if find_spec(name) is None]
    return f"{', '.join(absent)} not installed: {INSTALL_HINT}" if absent else ""


def block_size(block_format: BlockFormat) -> tuple[int, int]:
    """Return (width, height) of a block in texels. Raises InputError for an unknown format."""
    if block_format not in BLOCK_FORMATS:
        raise InputError(f"block format {block_format}: choose {', '.join(BLOCK_FORMATS[:-1])} or {BLOCK_FORMATS[-1]}")
    if block_format in ("bc1", "bc7"):
        return 4, 4
    width, height = block_format.removeprefix("astc-").split("x")
    return int(width), int(height)


def block_bytes(block_format: BlockFormat) -> int:
    """Return the size of a block in bytes: 8 (BC1) or 16."""
    return 8 if block_format == "bc1" else 16


def compressed_bytes(width: int, height: int, block_format: BlockFormat, kind: AstcKind = "srgb") -> int:
    """Return the size in bytes of all blocks of a picture, partial ones at its edges included. For BC1 and BC7, normals are in BC5."""
    across, down = block_size(block_format)
    return -(-width // across) * -(-height // down) * (16 if kind == "normal" else block_bytes(block_format))


@dataclass(frozen=True, eq=False)
class BlockCompressed:
    """A block-compressed picture: its blocks, and the texels that hardware reads from them."""

    decoded: NDArray[np.uint8]
    """[H, W, C] uint8, coded as the picture. BC1 has no alpha, so C is 1 or 3."""
    blocks: bytes
    """Blocks row by row, as hardware reads them, partial ones at the edges included."""

    @property
    def bits_per_texel(self) -> float:
        """Bits of all blocks per texel of the picture; more than the format's bitrate if blocks reach over the edge."""
        height, width, _ = self.decoded.shape
        return float(8.0 * len(self.blocks) / (height * width))


def _padded_rgba(pixels: NDArray[np.uint8], block: tuple[int, int], with_alpha: bool) -> NDArray[np.uint8]:
    """Return RGBA padded to whole blocks, [H, W, 4] uint8: grey repeated, alpha 255 if there is none or without `with_alpha`."""
    height, width, channels = pixels.shape
    rgba = np.full((height, width, 4), 255, np.uint8)
    rgba[..., :3] = as_rgb(pixels)
    if with_alpha and channels % 2 == 0:
        rgba[..., 3] = pixels[..., -1]
    return np.pad(rgba, ((0, -height % block[1]), (0, -width % block[0]), (0, 0)), mode="edge")


def compressed_blocks(
    pixels: NDArray[np.uint8], block_format: BlockFormat, effort: Effort = "thorough", kind: AstcKind = "srgb"
) -> bytes:
    """Return the blocks of `pixels`. Parameters and errors are those of `compress`.

    With `kind` normal, `pixels` [H, W, 2] are the xy of normals: BC5 for formats BC1 and BC7, else ASTC in its normal mode.
    """
    check_image(pixels)
    block = block_size(block_format)
    if kind == "normal":
        padded = np.pad(
            pixels, ((0, -pixels.shape[0] % block[1]), (0, -pixels.shape[1] % block[0]), (0, 0)), mode="edge"
        )
        opaque = np.full((*padded.shape[:2], 2), 255, np.uint8)
        rgba = np.ascontiguousarray(np.concatenate([padded, opaque], axis=2))
        is_bc = block_format in ("bc1", "bc7")
        return encode_bc5(rgba) if is_bc else encode_astc(rgba, block, effort, kind)
    rgba = _padded_rgba(pixels, block, with_alpha=block_format != "bc1")
    if block_format == "bc1":
        return encode_bc1(rgba, effort)
    if block_format == "bc7":
        return encode_bc7(rgba, effort)
    return encode_astc(rgba, block, effort, kind)


def decompress(
    blocks: bytes, shape: tuple[int, int, int], block_format: BlockFormat, kind: AstcKind = "srgb"
) -> NDArray[np.uint8]:
    """Return [H, W, C] uint8: the texels that hardware reads from the blocks of a picture of `shape` (H, W, C). BC1 has no alpha.

    Raises InputError for a wrong number of blocks, and if the decoder is not installed.
    """
    height, width, channels = shape
    block = block_size(block_format)
    if len(blocks) != compressed_bytes(width, height, block_format, kind):
        raise InputError(f"{block_format}: {len(blocks)} bytes are not the blocks of {width}x{height} texels")
    whole = (width + -width % block[0], height + -height % block[1])
    if kind == "normal":
        if block_format in ("bc1", "bc7"):
            normals = decode_bc5(blocks, *whole)
        else:
            normals = decode_astc(blocks, *whole, block, kind)[..., [0, 3]]
        return np.ascontiguousarray(normals[:height, :width])
    read_channels = [1] if channels <= 2 else [0, 1, 2]
    if block_format == "bc1":
        decoded = decode_bc(blocks, *whole, 1)
    else:
        is_bc7 = block_format == "bc7"
        decoded = decode_bc(blocks, *whole, 7) if is_bc7 else decode_astc(blocks, *whole, block, kind)
        read_channels = read_channels + [3] * (channels % 2 == 0)
    return np.ascontiguousarray(decoded[:height, :width, read_channels])


def compress(pixels: NDArray[np.uint8], block_format: BlockFormat, effort: Effort = "thorough") -> BlockCompressed:
    """Compress `pixels` [H, W, C] uint8 to BC1 (4 bits per texel), BC7 (8 bits) or ASTC (128 bits per block); C from 1 to 4.

    The encoders minimise squared error. `thorough`: BC1 by quicktex 0.3.1 (rgbcx) at level 18 of 18, BC7 by etcpak 0.9.15 (bc7enc)
    at uber level 4 of 4 with all 64 partitions, ASTC LDR sRGB by astcenc at quality 98 (`-thorough`). `medium` (levels 8 and 1,
    quality 60) is 0.1 to 0.2 dB below on photographs. The encoder of BC7 uses four of its eight modes (1, 5, 6
    and 7), so the format can be a little better than measured here.
    With one or two channels, the first is grey: it is repeated, and read from green, which BC1 stores with most bits. The second or
    fourth channel is alpha: stored by BC7 and ASTC, left out of BC1. Blocks at the edge are padded with the last texels.
    Raises InputError for another shape, type or format, and if the encoders are not installed.
    """
    blocks = compressed_blocks(pixels, block_format, effort)
    height, width, channels = pixels.shape
    return BlockCompressed(decompress(blocks, (height, width, channels), block_format), blocks)
