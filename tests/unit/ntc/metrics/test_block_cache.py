"""Textures in blocks with all mips, and the cache of them: kept is as new, whatever lies in the folder."""

import os
from pathlib import Path

import numpy as np
import pytest

from ntc.codec.mips import mip_chain
from ntc.errors import InputError
from ntc.metrics import compressed_textures
from ntc.metrics.block_compression import AstcKind, BlockFormat, Effort, compress, compressed_blocks
from ntc.metrics.compressed_textures import (
    BlockCache,
    CompressedTextures,
    CompressionRequest,
    compress_texture,
    mip_shapes,
)

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
    # 15 + 6 + 2 + 1 + 1 blocks of 8 bytes for 240 + 60 + 15 + 2 + 1 texels.
    assert (found.stored_bytes, found.texels) == (25 * 8, 318)
    both = CompressedTextures("bc1", (found, found))
    assert both.bits_per_texel == pytest.approx(25 * 64 / 318)
    assert both.psnr is not None
    assert both.psnr.mean_db == pytest.approx(found.psnr_db)


def test_what_was_encoded_once_is_read_again(tmp_path: Path, encodings: list[str]) -> None:
    request = CompressionRequest(PIXELS, "bc1", tmp_path / "blocks")
    first, second = (compress_texture(request) for _ in range(2))
    assert first == second == compress_texture(CompressionRequest(PIXELS, "bc1"))
    assert encodings == ["bc1 medium"] * 10


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


@pytest.mark.parametrize("damage", [b"", b"short", None])
def test_a_damaged_file_is_encoded_again(tmp_path: Path, encodings: list[str], damage: bytes | None) -> None:
    request = CompressionRequest(PIXELS, "bc1", tmp_path)
    first = compress_texture(request)
    (path,) = tmp_path.iterdir()
    data = path.read_bytes()
    path.write_bytes(data[:-1] + bytes([data[-1] ^ 1]) if damage is None else damage)
    assert compress_texture(request) == first
    assert len(encodings) == 10
    assert path.read_bytes() == data


def test_a_folder_that_cannot_be_written_costs_only_time(tmp_path: Path, encodings: list[str]) -> None:
    (tmp_path / "file").write_text("no folder")
    request = CompressionRequest(PIXELS, "bc1", tmp_path / "file")
    assert compress_texture(request) == compress_texture(request)
    assert len(encodings) == 10


def test_the_oldest_files_go_first(tmp_path: Path) -> None:
    cache = BlockCache(tmp_path)
    paths = [cache.path(str(number), "bc1", "medium") for number in range(3)]
    for age, path in enumerate(paths):
        cache.write(path, b"12345678")
        os.utime(path, (1000 + age, 1000 + age))
    (tmp_path / "other.txt").write_text("not of the cache")
    BlockCache(tmp_path, largest_bytes=2 * paths[0].stat().st_size).trim()
    assert [path.exists() for path in paths] == [False, True, True]
    assert (tmp_path / "other.txt").exists()


def test_errors_of_the_encoder_are_passed_on(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="choose bc1"):
        compress_texture(CompressionRequest(PIXELS, "bc9", tmp_path))  # type: ignore[arg-type]
