"""The cache of features: hits, broken files, folders that cannot be written."""

import io
import os
import pickle
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from ntc.codec.textures import SourceTexture, hash_pixels
from ntc.features import FeatureOptions, feature_matrix, statistics
from ntc.features.extractor import cache_path, read_features, write_features
from ntc.features.statistics import spectral_extractor

LENGTH = statistics.LENGTH


def textures(count: int = 4) -> list[SourceTexture]:
    """Different noisy textures."""
    random = np.random.default_rng(0)
    pixels = [random.integers(0, 40 * (index + 1), (16, 16, 3), dtype=np.uint8) for index in range(count)]
    return [SourceTexture(f"t{index}", image, hash_pixels(image)) for index, image in enumerate(pixels)]


@pytest.fixture
def computed(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Names of the textures whose features were computed, in order."""
    names: list[str] = []
    original = statistics.spectral_features

    def counted(texture: SourceTexture) -> NDArray[np.float64]:
        names.append(texture.name)
        return original(texture)

    monkeypatch.setattr(statistics, "spectral_features", counted)
    return names


def npy(array: NDArray[np.generic] | Sequence[object], **options: bool) -> bytes:
    """The bytes of a .npy file."""
    stream = io.BytesIO()
    np.save(stream, np.asarray(array), **options)
    return stream.getvalue()


def with_header(header: str) -> bytes:
    """A .npy file with this header and few numbers."""
    text = header.ljust(117).encode() + b"\n"
    return b"\x93NUMPY\x01\x00" + len(text).to_bytes(2, "little") + text + bytes(8 * LENGTH)


def test_a_hit_computes_nothing_and_gives_the_same(tmp_path: Path, computed: list[str]) -> None:
    options = FeatureOptions(cache=tmp_path / "new" / "cache")
    given = textures()
    first = feature_matrix("spectral", given, options)
    assert computed == ["t0", "t1", "t2", "t3"]
    np.testing.assert_array_equal(first, feature_matrix("spectral", given, options))
    other_order = feature_matrix("spectral", [given[index] for index in (2, 0, 1, 3)], options)
    np.testing.assert_allclose(first[[2, 0, 1, 3]], other_order, atol=1e-9)
    assert len(computed) == 4
    np.testing.assert_array_equal(first, feature_matrix("spectral", given))
    assert len(computed) == 8
    assert len(list((tmp_path / "new" / "cache").iterdir())) == 4


def test_what_is_kept_is_raw(tmp_path: Path, computed: list[str]) -> None:
    given = textures()
    feature_matrix("spectral", given[:2], FeatureOptions(cache=tmp_path))
    mixed = feature_matrix("spectral", given, FeatureOptions(cache=tmp_path))
    assert computed == ["t0", "t1", "t2", "t3"]
    np.testing.assert_array_equal(mixed, feature_matrix("spectral", given))


def test_the_key_is_all_that_features_depend_on(tmp_path: Path) -> None:
    extractor, texture = spectral_extractor(), textures(1)[0]
    others = [
        (replace(extractor, version="2"), texture),
        (replace(extractor, name="low_level"), texture),
        (extractor, replace(texture, pixel_hash="0" * 32)),
        (extractor, replace(texture, pixels=texture.pixels[:8])),
        (extractor, replace(texture, pixels=texture.pixels[:, :8])),
        (extractor, replace(texture, pixels=texture.pixels[..., :1])),
        (extractor, replace(texture, color_space="linear")),
    ]
    paths = {cache_path(tmp_path, *other) for other in others} | {cache_path(tmp_path, extractor, texture)}
    assert len(paths) == len(others) + 1
    assert cache_path(tmp_path, extractor, replace(texture, name="other", category="c")) in paths
    hostile = cache_path(tmp_path, extractor, replace(texture, pixel_hash="../../../etc/x\0"))
    assert hostile.parent == tmp_path


BROKEN: dict[str, Callable[[bytes], bytes]] = {
    "empty": lambda good: b"",
    "cut": lambda good: good[:-1],
    "cut in the header": lambda good: good[:50],
    "longer": lambda good: good + b"\0",
    "much longer": lambda good: good + bytes(1 << 20),
    "no npy": lambda good: b"x" * len(good),
    "another version": lambda good: good[:6] + b"\x02" + good[7:],
    "fewer numbers": lambda good: npy(np.zeros(LENGTH - 1)),
    "another shape": lambda good: npy(np.zeros((1, LENGTH))),
    "another type": lambda good: npy(np.zeros(LENGTH, np.int64)),
    "big endian": lambda good: npy(np.zeros(LENGTH, ">f8")),
    "objects": lambda good: npy(np.array([None] * LENGTH, object), allow_pickle=True),
    "pickle": lambda good: pickle.dumps([0.0] * LENGTH),
    "not finite": lambda good: npy(np.full(LENGTH, np.nan)),
    "infinite": lambda good: npy(np.full(LENGTH, np.inf)),
    "claims gigabytes": lambda good: with_header("{'descr': '<f8', 'fortran_order': False, 'shape': (99999999999,), }"),
    "code in the header": lambda good: with_header("__import__('os').abort()"),
    "deep header": lambda good: with_header("(" * 110),
    "zero bytes in the header": lambda good: with_header("{'descr': '<f8\0'}"),
}


@pytest.mark.parametrize("fault", BROKEN)
def test_a_broken_file_is_computed_again_and_replaced(tmp_path: Path, computed: list[str], fault: str) -> None:
    given, options = textures(2), FeatureOptions(cache=tmp_path)
    expected = feature_matrix("spectral", given, options)
    path = cache_path(tmp_path, spectral_extractor(), given[1])
    good = path.read_bytes()
    path.write_bytes(BROKEN[fault](good))
    assert read_features(path, LENGTH) is None
    np.testing.assert_array_equal(expected, feature_matrix("spectral", given, options))
    assert computed == ["t0", "t1", "t1"]
    assert path.read_bytes() == good


def test_any_changed_byte_is_survived(tmp_path: Path) -> None:
    path = tmp_path / "f.npy"
    write_features(path, np.arange(4.0))
    good = path.read_bytes()
    random = np.random.default_rng(0)
    for place in range(len(good)):
        path.write_bytes(good[:place] + bytes([int(random.integers(256))]) + good[place + 1 :])
        found = read_features(path, 4)
        assert found is None or (found.shape == (4,) and np.isfinite(found).all())


def test_things_that_are_no_files_are_not_read(tmp_path: Path, computed: list[str]) -> None:
    given = textures(1)
    path = cache_path(tmp_path, spectral_extractor(), given[0])
    os.mkfifo(path)
    assert read_features(path, LENGTH) is None
    path.unlink()
    path.mkdir()
    feature_matrix("spectral", given, FeatureOptions(cache=tmp_path))
    assert computed == ["t0"]


@pytest.mark.parametrize("place", ["a file", "read-only"])
def test_a_folder_that_cannot_be_written_is_no_error(tmp_path: Path, place: str) -> None:
    folder = tmp_path / "folder"
    if place == "a file":
        folder.write_text("not a folder")
    else:
        folder.mkdir()
        folder.chmod(0o500)
    given = textures()
    found = feature_matrix("spectral", given, FeatureOptions(cache=folder))
    np.testing.assert_array_equal(found, feature_matrix("spectral", given))


def test_progress_counts_what_is_kept_too(tmp_path: Path) -> None:
    seen: list[tuple[int, int]] = []
    options = FeatureOptions(cache=tmp_path, progress=lambda done, count: seen.append((done, count)))
    feature_matrix("spectral", textures(2), options)
    assert seen == [(1, 2), (2, 2)]
    seen.clear()
    feature_matrix("spectral", textures(4), options)
    assert seen == [(2, 4), (3, 4), (4, 4)]
