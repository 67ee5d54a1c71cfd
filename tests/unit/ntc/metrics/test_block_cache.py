"""Kept blocks: the same as new ones, whatever lies in the folder, and no more than the folder may hold."""

import os
from pathlib import Path

import numpy as np
import pytest

from ntc.errors import InputError
from ntc.metrics import block_cache
from ntc.metrics.block_cache import BlockCache
from ntc.metrics.block_compression import BlockFormat, compress, compressed_blocks

pytest.importorskip("quicktex")
PIXELS = np.random.default_rng(1).integers(0, 256, (12, 20, 3), np.uint8)


@pytest.fixture
def encodings(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Formats in which something was encoded, in turn."""
    found: list[str] = []

    def counted(pixels: np.ndarray, block_format: BlockFormat, effort: str) -> bytes:
        found.append(f"{block_format} {effort}")
        return compressed_blocks(pixels, block_format, effort)  # type: ignore[arg-type]

    monkeypatch.setattr(block_cache, "compressed_blocks", counted)
    return found


def test_what_was_encoded_once_is_read_again(tmp_path: Path, encodings: list[str]) -> None:
    cache = BlockCache(tmp_path / "blocks")
    first, second = (cache.compress(PIXELS, "bc1", "medium") for _ in range(2))
    fresh = compress(PIXELS, "bc1", "medium")
    assert first.blocks == second.blocks == fresh.blocks
    assert np.array_equal(second.decoded, fresh.decoded)
    assert encodings == ["bc1 medium"]


def test_other_pixels_formats_and_efforts_are_other_entries(tmp_path: Path, encodings: list[str]) -> None:
    cache = BlockCache(tmp_path)
    paths = {
        cache.path(PIXELS, "bc1", "medium"),
        cache.path(PIXELS, "bc1", "thorough"),
        cache.path(PIXELS, "bc7", "medium"),
        cache.path(255 - PIXELS, "bc1", "medium"),
        cache.path(PIXELS.reshape(20, 12, 3), "bc1", "medium"),
    }
    assert len(paths) == 5
    cache.blocks(PIXELS, "bc1", "medium")
    cache.blocks(255 - PIXELS, "bc1", "medium")
    assert len(encodings) == 2


@pytest.mark.parametrize("damage", [b"", b"short", None])
def test_a_damaged_file_is_encoded_again(tmp_path: Path, encodings: list[str], damage: bytes | None) -> None:
    cache = BlockCache(tmp_path)
    blocks = cache.blocks(PIXELS, "bc1", "medium")
    path = cache.path(PIXELS, "bc1", "medium")
    data = path.read_bytes()
    path.write_bytes(data[:-1] + bytes([data[-1] ^ 1]) if damage is None else damage)
    assert cache.blocks(PIXELS, "bc1", "medium") == blocks
    assert len(encodings) == 2
    assert path.read_bytes() == data


def test_a_folder_that_cannot_be_written_costs_only_time(tmp_path: Path, encodings: list[str]) -> None:
    (tmp_path / "file").write_text("no folder")
    cache = BlockCache(tmp_path / "file")
    assert cache.blocks(PIXELS, "bc1", "medium") == cache.blocks(PIXELS, "bc1", "medium")
    assert len(encodings) == 2
    cache.trim()


def test_the_oldest_files_go_first(tmp_path: Path) -> None:
    cache = BlockCache(tmp_path)
    pictures = [PIXELS + np.uint8(add) for add in range(3)]
    for age, pixels in enumerate(pictures):
        cache.blocks(pixels, "bc1", "medium")
        os.utime(cache.path(pixels, "bc1", "medium"), (1000 + age, 1000 + age))
    size = cache.path(PIXELS, "bc1", "medium").stat().st_size
    (tmp_path / "other.txt").write_text("not of the cache")
    BlockCache(tmp_path, largest_bytes=2 * size).trim()
    assert [cache.path(pixels, "bc1", "medium").exists() for pixels in pictures] == [False, True, True]
    assert (tmp_path / "other.txt").exists()


def test_errors_of_the_encoder_are_passed_on(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="choose bc1"):
        BlockCache(tmp_path).blocks(PIXELS, "bc9", "medium")  # type: ignore[arg-type]
