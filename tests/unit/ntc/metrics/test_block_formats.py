"""BC1, BC7 and ASTC: what must survive them, what they cost, and the cache of textures in them."""

import struct
import sys
from pathlib import Path
from unittest.mock import patch

import numpy as np
import OpenImageIO
import pytest
from numpy.typing import NDArray

from ntc.codec.mips import mip_chain
from ntc.codec.quality import psnr_db
from ntc.content_cache import ContentCache
from ntc.errors import InputError
from ntc.metrics import compressed_textures
from ntc.metrics.block_compression import (
    AstcKind,
    BlockFormat,
    Effort,
    block_size,
    compress,
    compressed_blocks,
    compressed_bytes,
    decompress,
)
from ntc.metrics.compressed_textures import (
    CompressedTextures,
    CompressionRequest,
    compress_texture,
    mip_shapes,
)
from tests.support.covering import covering
from tests.support.gltf_builder import noise

pytest.importorskip("quicktex")
pytest.importorskip("etcpak")
pytest.importorskip("astc_encoder")

Image = NDArray[np.uint8]
BC_FORMATS: tuple[BlockFormat, ...] = ("bc1", "bc7")
FORMATS: tuple[BlockFormat, ...] = (*BC_FORMATS, "astc-4x4", "astc-6x5", "astc-12x12")


def waves(width: int, height: int, channels: int) -> Image:
    """[height, width, channels] uint8: slow waves, another in every channel."""
    y, x = np.mgrid[0:height, 0:width]
    return np.stack(
        [128.0 + 100.0 * np.sin(x / (9.0 + 2.0 * i) + y / (17.0 - 3.0 * i)) for i in range(channels)], axis=-1
    ).astype(np.uint8)


def dds(blocks: bytes, width: int, height: int, block_format: BlockFormat) -> bytes:
    """A DDS file of one picture, with the DX10 header."""
    code = {"bc1": 71, "bc7": 98}[block_format]
    header = struct.pack("<7I44x", 124, 0x81007, height, width, len(blocks), 0, 1)
    pixel_format = struct.pack("<2I4s20x", 32, 4, b"DX10")
    return (
        b"DDS " + header + pixel_format + struct.pack("<I16x", 0x1000) + struct.pack("<5I", code, 3, 0, 1, 0) + blocks
    )


@pytest.mark.parametrize("block_format", FORMATS)
@pytest.mark.parametrize("color", [(255, 0, 0), (0, 255, 0), (0, 0, 255), (200, 40, 90), (0, 0, 0), (255, 255, 255)])
def test_a_colour_stays_that_colour(block_format: BlockFormat, color: tuple[int, int, int]) -> None:
    decoded = compress(np.full((8, 12, 3), color, np.uint8), block_format).decoded
    assert decoded.shape == (8, 12, 3)
    assert np.abs(decoded.astype(int) - np.array(color)).max() <= (3 if block_format == "bc1" else 1)


@pytest.mark.parametrize(
    ("block_format", "size", "channels"),
    covering(FORMATS, [(1, 1), (3, 5), (4, 4), (9, 6), (1, 1024), (1024, 1)], [1, 2, 3, 4]),
)
def test_any_shape_is_padded_and_cropped(block_format: BlockFormat, size: tuple[int, int], channels: int) -> None:
    width, height = size
    image = waves(width, height, channels)
    compressed = compress(image, block_format)
    has_alpha = channels in (2, 4)
    kept = channels - 1 if has_alpha and block_format == "bc1" else channels
    assert compressed.decoded.shape == (height, width, kept)
    assert compressed.decoded.dtype == np.uint8
    assert len(compressed.blocks) == compressed_bytes(width, height, block_format)
    assert compressed.bits_per_texel == pytest.approx(8 * len(compressed.blocks) / (width * height))
    assert psnr_db(compressed.decoded, image[..., :kept]) > (18.0 if block_format == "astc-12x12" else 25.0)
    # Padding repeats the edge.
    across, down = block_size(block_format)
    padded = np.pad(image, ((0, -height % down), (0, -width % across), (0, 0)), mode="edge")
    assert compress(padded, block_format).blocks == compressed.blocks


def test_alpha_is_kept_but_by_bc1() -> None:
    for channels in (2, 4):
        image = waves(32, 32, channels)
        image[..., -1] = np.arange(32, dtype=np.uint8)[None, :] * 8
        decoded = compress(image, "astc-4x4").decoded
        assert decoded.shape == image.shape
        assert psnr_db(decoded[..., -1], image[..., -1]) > 30.0
    image = waves(32, 32, 4)
    image[..., 3] = np.arange(32, dtype=np.uint8)[None, :] * 8
    other = image.copy()
    other[..., 3] = 0
    assert compress(image, "bc1").blocks == compress(other, "bc1").blocks
    decoded = compress(image, "bc7").decoded
    assert psnr_db(decoded[..., 3], image[..., 3]) > 35.0
    assert (compress(other, "bc7").decoded[..., 3] <= 1).all()


def test_bc1_blocks_are_read_as_opaque() -> None:
    """A block of three colours has a fourth one, transparent black, which must not be used."""
    image = noise(64, 64, 3)
    image[::2] //= 16
    values = np.frombuffer(compress(image, "bc1").blocks, np.dtype([("ends", "<u2", 2), ("selectors", "<u4")]))
    three = values["ends"][:, 0] <= values["ends"][:, 1]
    selectors = (values["selectors"][:, None] >> np.arange(0, 32, 2)) & 3
    assert three.any()
    assert not (selectors[three] == 3).any()


@pytest.mark.parametrize("block_format", BC_FORMATS)
@pytest.mark.parametrize("channels", [3, 4])
def test_openimageio_reads_the_same_blocks(tmp_path: Path, block_format: BlockFormat, channels: int) -> None:
    image = np.concatenate([waves(64, 32, channels), noise(32, 64, channels)])
    compressed = compress(image, block_format)
    file = tmp_path / "picture.dds"
    file.write_bytes(dds(compressed.blocks, 64, 64, block_format))
    read = OpenImageIO.ImageBuf(str(file)).get_pixels(OpenImageIO.UINT8)
    assert read is not None, OpenImageIO.geterror()
    kept = compressed.decoded.shape[2]
    tolerance = 1 if block_format == "bc1" else 0  # BC1 leaves its blends' rounding to the decoder.
    assert np.abs(read[..., :kept].astype(int) - compressed.decoded).max() <= tolerance


@pytest.mark.parametrize("block_format", FORMATS)
@pytest.mark.parametrize("image", [noise(4, 4, 3)[..., 0], noise(4, 4, 5), noise(0, 4, 3), noise(4, 4, 3) / 255.0])
def test_bad_pictures_are_one_line(block_format: BlockFormat, image: Image) -> None:
    with pytest.raises(InputError, match="image: has shape"):
        compress(image, block_format)
    with pytest.raises(InputError, match="are not the blocks of 8x8 texels"):
        decompress(b"\0" * 24, (8, 8, 3), block_format)


def test_an_unknown_format_is_one_line(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"choose bc1, bc7, .* or astc-12x12"):
        compress(noise(4, 4, 3), "bc2")  # type: ignore[arg-type]
    with pytest.raises(InputError, match="choose bc1"):
        compress_texture(CompressionRequest(PIXELS, "bc9", tmp_path))  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("block_format", "package"), [("bc1", "quicktex"), ("bc7", "etcpak"), ("bc7", "PIL"), ("astc-8x8", "astc_encoder")]
)
def test_missing_packages_are_one_line(
    monkeypatch: pytest.MonkeyPatch, block_format: BlockFormat, package: str
) -> None:
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(InputError, match=r"\[lab\]"):
        compress(noise(4, 4, 3), block_format)


pytest.importorskip("quicktex")
PIXELS = np.random.default_rng(1).integers(0, 256, (12, 20, 3), np.uint8)


@pytest.fixture
def encodings(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Formats in which a mip was encoded, in turn."""
    found: list[str] = []

    def counted(pixels: np.ndarray, block_format: BlockFormat, effort: Effort, kind: AstcKind) -> bytes:
        found.append(f"{block_format} {effort}")
        return compressed_blocks(pixels, block_format, effort, kind)

    monkeypatch.setattr(compressed_textures, "compressed_blocks", counted)
    return found


def test_every_mip_is_what_the_format_makes_of_it() -> None:
    found = compress_texture(CompressionRequest(PIXELS, "bc1"))
    chain = mip_chain(PIXELS, "srgb")
    assert [mip.shape for mip in found.mips()] == [mip.shape for mip in chain] == list(mip_shapes((12, 20, 3)))
    for decoded, mip in zip(found.mips(), chain, strict=True):
        assert np.array_equal(decoded, compress(mip, "bc1", "medium").decoded)
    # 15 + 6 + 2 + 1 + 1 blocks of 8 bytes for 240 texels of mip 0.
    assert (found.stored_bytes, found.texels) == (25 * 8, 240)
    both = CompressedTextures("bc1", (found, found))
    assert both.bits_per_texel == pytest.approx(25 * 64 / 240)
    assert both.psnr is not None
    assert both.psnr.mean_db == pytest.approx(found.psnr_db)


def test_what_was_encoded_once_is_read_again(tmp_path: Path, encodings: list[str]) -> None:
    request = CompressionRequest(PIXELS, "bc1", tmp_path / "blocks")
    first, second = (compress_texture(request) for _ in range(2))
    assert first == second == compress_texture(CompressionRequest(PIXELS, "bc1"))
    assert encodings == ["bc1 medium"] * 10


def test_kept_blocks_of_another_size_are_encoded_again(tmp_path: Path, encodings: list[str]) -> None:
    request = CompressionRequest(PIXELS, "bc1", tmp_path)
    first = compress_texture(request)
    with patch.object(ContentCache, "read", return_value=b"short"):
        assert compress_texture(request) == first
    assert len(encodings) == 10


def test_other_pixels_formats_efforts_and_colour_spaces_are_other_entries(tmp_path: Path, encodings: list[str]) -> None:
    requests = (
        CompressionRequest(PIXELS, "bc1", tmp_path),
        CompressionRequest(PIXELS, "bc1", tmp_path, "thorough"),
        CompressionRequest(PIXELS, "bc1", tmp_path, color_space="linear"),
        CompressionRequest(255 - PIXELS, "bc1", tmp_path),
        CompressionRequest(PIXELS.reshape(20, 12, 3), "bc1", tmp_path),
        CompressionRequest(PIXELS, "bc7", tmp_path),
    )
    for request in requests:
        compress_texture(request)
    assert len(encodings) == 6 * 5
    assert len(list(tmp_path.iterdir())) == 6
