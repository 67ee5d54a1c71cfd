"""The cache on disk: what is kept, what damage costs, and how it is bounded."""

import os
from pathlib import Path

import numpy as np
import pytest

from ntc.content_cache import DIGEST_BYTES, ContentCache
from ntc.io import PARTIAL_MARK


def file_of(cache: ContentCache, key: str) -> Path:
    path = cache.path(key)
    assert path is not None
    return path


def test_what_was_written_is_read_by_another_process(tmp_path: Path) -> None:
    cache = ContentCache(tmp_path / "new" / "cache")
    assert cache.read("a") is None
    cache.write("a", b"1234")
    cache.write("../../etc/x\0", b"")
    cache.write_value("value", {"a": [1, 2]})
    again = ContentCache(tmp_path / "new" / "cache")
    assert (again.read("a"), again.read("b"), again.read("../../etc/x\0")) == (b"1234", None, b"")
    assert again.read_value("value", dict[str, list[int]]) == {"a": [1, 2]}
    assert again.read_value("value", list[int]) is None
    assert len(list((tmp_path / "new" / "cache").iterdir())) == 3


def test_no_folder_keeps_nothing() -> None:
    cache = ContentCache(None)
    cache.write("a", b"1234")
    assert cache.read("a") is None


def test_any_changed_byte_counts_as_absent_and_is_written_again(tmp_path: Path) -> None:
    cache = ContentCache(tmp_path)
    cache.write("a", b"12345678")
    path = file_of(cache, "a")
    good, random = path.read_bytes(), np.random.default_rng(0)
    changed = [good[:at] + bytes([good[at] ^ int(random.integers(1, 256))]) + good[at + 1 :] for at in range(len(good))]
    for data in (b"", good[:5], good[:DIGEST_BYTES], good[:-1], good + b"\0", *changed):
        path.write_bytes(data)
        assert cache.read("a") is None
    cache.write("a", b"12345678")
    assert path.read_bytes() == good


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs pipes")
def test_things_that_are_no_files_are_not_read(tmp_path: Path) -> None:
    cache = ContentCache(tmp_path)
    path = file_of(cache, "a")
    os.mkfifo(path)
    assert cache.read("a") is None
    path.unlink()
    path.mkdir()
    assert cache.read("a") is None
    cache.write("a", b"1")


def test_a_folder_that_cannot_be_written_is_no_error(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("no folder")
    cache = ContentCache(tmp_path / "file")
    cache.write("a", b"1")
    assert cache.read("a") is None


def test_the_oldest_files_go_first(tmp_path: Path) -> None:
    cache = ContentCache(tmp_path)
    for age, key in enumerate("abc"):
        cache.write(key, b"12345678")
        os.utime(file_of(cache, key), (1000 + age, 1000 + age))
    partial = tmp_path / f".x{PARTIAL_MARK}.cached"
    for other in (partial, tmp_path / "other.txt"):
        other.write_text("not of the cache")
    bounded = ContentCache(tmp_path, most_bytes=3 * file_of(cache, "a").stat().st_size)
    bounded.write("d", b"12345678")
    assert [bounded.read(key) is not None for key in "abcd"] == [False, True, True, True]
    assert partial.exists()
    assert (tmp_path / "other.txt").exists()
