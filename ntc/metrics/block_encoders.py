"""Encoders and decoders of BC1, BC7 and ASTC that the extra `lab` installs. Pictures are whole blocks of RGBA."""

from functools import lru_cache
from importlib import import_module
from threading import get_ident
from types import ModuleType
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from ntc.errors import InputError

Effort = Literal["medium", "thorough"]
"""How long encoders search: `thorough` takes 4 (ASTC), 15 (BC1) or 2 (BC7) times as long as `medium`."""

AstcKind = Literal["srgb", "linear", "normal"]
"""What is encoded: colours, linear data, or normals, as two channels in astcenc's normal mode."""

BC1_LEVELS: dict[Effort, int] = {"medium": 8, "thorough": 18}
"""Quicktex's, up to 18."""
BC7_UBER_LEVELS: dict[Effort, int] = {"medium": 1, "thorough": 4}
"""Etcpak's, up to 4."""
ASTC_QUALITIES: dict[Effort, float] = {"medium": 60.0, "thorough": 98.0}
"""Astcenc's, up to 100."""
CONTEXTS_KEPT = 16
_MISSING = "block compression: the packages are not installed ({}); pip install 'ntc-viewer[lab]'"


def encode_bc1(rgba: NDArray[np.uint8], effort: Effort) -> bytes:
    """BC1 blocks of `rgba` [H, W, 4], whole blocks. Raises InputError where quicktex is not installed."""
    try:
        from quicktex import RawTexture
        from quicktex.s3tc.bc1 import BC1Encoder
    except ImportError as error:
        raise InputError(_MISSING.format(error)) from error
    # Three colours may be the better fit of a block; the fourth, black without alpha, is never used.
    encoder = BC1Encoder(BC1_LEVELS[effort], BC1Encoder.ColorMode.ThreeColor)
    return bytes(encoder.encode(RawTexture.frombytes(rgba.tobytes(), rgba.shape[1], rgba.shape[0])))


def encode_bc7(rgba: NDArray[np.uint8], effort: Effort) -> bytes:
    """BC7 blocks of `rgba` [H, W, 4], whole blocks. Raises InputError where etcpak is not installed."""
    try:
        import etcpak
    except ImportError as error:
        raise InputError(_MISSING.format(error)) from error
    settings = etcpak.BC7CompressBlockParams()
    # It starts with weights of how colours look, and would lose 0.8 to 1.1 dB of PSNR by them.
    settings.init_linear_weights()
    settings.m_uber_level = BC7_UBER_LEVELS[effort]
    settings.m_mode17_partition_estimation_filterbank = False
    blocks: bytes = etcpak.compress_bc7(rgba.tobytes(), rgba.shape[1], rgba.shape[0], settings)
    return blocks


def decode_bc(blocks: bytes, width: int, height: int, number: int) -> NDArray[np.uint8]:
    """[height, width, 4] uint8 of BC`number` blocks, whole blocks. Raises InputError where Pillow is not installed."""
    # By Pillow: etcpak 0.9.15 decodes into memory that it does not own.
    try:
        from PIL import Image
    except ImportError as error:
        raise InputError(_MISSING.format(error)) from error
    return np.asarray(Image.frombytes("RGBA", (width, height), blocks, "bcn", number))


def encode_bc5(rgba: NDArray[np.uint8]) -> bytes:
    """BC5 blocks of red and green of `rgba` [H, W, 4], whole blocks. Raises InputError where quicktex is not installed."""
    try:
        from quicktex import RawTexture
        from quicktex.s3tc.bc5 import BC5Encoder
    except ImportError as error:
        raise InputError(_MISSING.format(error)) from error
    return bytes(BC5Encoder(0, 1).encode(RawTexture.frombytes(rgba.tobytes(), rgba.shape[1], rgba.shape[0])))


def decode_bc5(blocks: bytes, width: int, height: int) -> NDArray[np.uint8]:
    """[height, width, 2] uint8 of BC5 blocks, whole blocks. Raises InputError where Pillow is not installed."""
    try:
        from PIL import Image
    except ImportError as error:
        raise InputError(_MISSING.format(error)) from error
    return np.asarray(Image.frombytes("RGB", (width, height), blocks, "bcn", 5))[..., :2]


def _astc_package() -> ModuleType:
    try:
        return import_module("astc_encoder")
    except ImportError as error:
        raise InputError(_MISSING.format(error)) from error


@lru_cache(maxsize=CONTEXTS_KEPT)
def _astc_context(block: tuple[int, int], effort: Effort, kind: AstcKind, _thread: int) -> Any:
    """A context of astcenc, whose tables take longer to make than a small mip to encode. Each thread has its own."""
    astc = _astc_package()
    profile = astc.ASTCProfile.LDR_SRGB if kind == "srgb" else astc.ASTCProfile.LDR
    flags = astc.ASTCConfigFlags.MAP_NORMAL if kind == "normal" else astc.ASTCConfigFlags(0)
    return astc.ASTCContext(astc.ASTCConfig(profile, *block, 1, ASTC_QUALITIES[effort], flags))


def encode_astc(rgba: NDArray[np.uint8], block: tuple[int, int], effort: Effort, kind: AstcKind = "srgb") -> bytes:
    """ASTC LDR blocks of (width, height) `block` of `rgba` [H, W, 4], of normals the xy in red and green. Raises InputError without
    astc-encoder-py."""
    astc, context = _astc_package(), _astc_context(block, effort, kind, get_ident())
    image = astc.ASTCImage(astc.ASTCType.U8, rgba.shape[1], rgba.shape[0], 1, rgba.tobytes())
    return bytes(context.compress(image, astc.ASTCSwizzle.from_str("RRRG" if kind == "normal" else "RGBA")))


def decode_astc(
    blocks: bytes, width: int, height: int, block: tuple[int, int], kind: AstcKind = "srgb"
) -> NDArray[np.uint8]:
    """[height, width, 4] uint8 of ASTC LDR blocks, whole blocks; of normals x in red and y in alpha. Raises InputError without
    astc-encoder-py."""
    astc, context = _astc_package(), _astc_context(block, "medium", kind, get_ident())
    image = astc.ASTCImage(astc.ASTCType.U8, width, height, 1)
    context.decompress(blocks, image, astc.ASTCSwizzle.from_str("RGBA"))
    if image.data is None or len(image.data) != 4 * width * height:
        raise InputError(f"ASTC {block[0]}x{block[1]}: astc-encoder-py decoded nothing; install it again")
    return np.frombuffer(image.data, np.uint8).reshape(height, width, 4)
