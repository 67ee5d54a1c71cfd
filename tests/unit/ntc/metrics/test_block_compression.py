"""BC1 and BC7: what must survive them, what they must cost, and OpenImageIO's decoder of the same blocks."""

import struct
import sys
from pathlib import Path

import numpy as np
import OpenImageIO
import pytest
from numpy.typing import NDArray

from ntc.errors import InputError
from ntc.metrics.block_compression import BlockFormat, compress
from ntc.metrics.metrics import psnr_db

pytest.importorskip("quicktex")
pytest.importorskip("etcpak")

Image = NDArray[np.uint8]
FORMATS: tuple[BlockFormat, ...] = ("bc1", "bc7")
BITS = {"bc1": 4.0, "bc7": 8.0}


def noise(width: int, height: int, channels: int, seed: int = 0) -> Image:
    """[height, width, channels] uint8 random pixels."""
    return np.random.default_rng(seed).integers(0, 256, (height, width, channels), np.uint8)


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


@pytest.mark.parametrize("block_format", FORMATS)
@pytest.mark.parametrize("size", [(1, 1), (3, 5), (4, 4), (9, 6), (1, 4096), (4096, 1)])
@pytest.mark.parametrize("channels", [1, 2, 3, 4])
def test_any_shape_is_padded_and_cropped(block_format: BlockFormat, size: tuple[int, int], channels: int) -> None:
    width, height = size
    image = waves(width, height, channels)
    compressed = compress(image, block_format)
    has_alpha = channels in (2, 4)
    kept = channels - 1 if has_alpha and block_format == "bc1" else channels
    assert compressed.decoded.shape == (height, width, kept)
    assert compressed.decoded.dtype == np.uint8
    blocks = -(-width // 4) * -(-height // 4)
    assert compressed.bits_per_texel == pytest.approx(BITS[block_format] * 16 * blocks / (width * height))
    assert psnr_db(compressed.decoded, image[..., :kept]) > 25.0


@pytest.mark.parametrize("block_format", FORMATS)
def test_padding_repeats_the_edge(block_format: BlockFormat) -> None:
    image = waves(10, 7, 3)
    padded = np.pad(image, ((0, 1), (0, 2), (0, 0)), mode="edge")
    assert compress(image, block_format).blocks == compress(padded, block_format).blocks


@pytest.mark.parametrize(("image", "gain_db"), [(waves(64, 64, 3), 5.0), (noise(64, 64, 3), 1.0)])
def test_bc7_is_better_than_bc1(image: Image, gain_db: float) -> None:
    bc1, bc7 = (psnr_db(compress(image, block_format).decoded, image) for block_format in FORMATS)
    assert bc7 > bc1 + gain_db


def test_alpha_is_kept_by_bc7_and_left_out_of_bc1() -> None:
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


@pytest.mark.parametrize("block_format", FORMATS)
@pytest.mark.parametrize("channels", [3, 4])
def test_openimageio_reads_the_same_blocks(tmp_path: Path, block_format: BlockFormat, channels: int) -> None:
    image = np.concatenate([waves(64, 32, channels), noise(64, 32, channels)])
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


def test_an_unknown_format_is_one_line() -> None:
    with pytest.raises(InputError, match="choose bc1 or bc7"):
        compress(noise(4, 4, 3), "bc2")  # type: ignore[arg-type]


@pytest.mark.parametrize(("block_format", "package"), [("bc1", "quicktex"), ("bc7", "etcpak"), ("bc7", "PIL")])
def test_missing_packages_are_one_line(
    monkeypatch: pytest.MonkeyPatch, block_format: BlockFormat, package: str
) -> None:
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(InputError, match=r"ntc-viewer\[lab\]"):
        compress(noise(4, 4, 3), block_format)
