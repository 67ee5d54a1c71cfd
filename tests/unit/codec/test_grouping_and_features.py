"""Groupings, and the features that clusters are found by."""

import warnings
from collections import Counter
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from ntc.errors import InputError
from ntc.features.low_level import feature_matrix, low_level_features
from ntc.grouping import make_grouping
from ntc.textures import SourceTexture, hash_pixels


def texture(pixels: NDArray[np.uint8], name: str = "t") -> SourceTexture:
    """A texture with these pixels."""
    return SourceTexture(name, pixels, hash_pixels(pixels))


def three_kinds() -> list[SourceTexture]:
    """Nine textures: smooth dark red, noisy grey and bright blue, by turns."""
    random = np.random.default_rng(0)
    textures = []
    for number in range(9):
        kind = number % 3
        pixels = random.integers(0, (4, 200, 4)[kind], (16, 16, 1)).repeat(3, axis=2)
        pixels = pixels + np.array([(40, 0, 0), (0, 0, 0), (60, 60, 240)][kind]) + number
        textures.append(texture(np.clip(pixels, 0, 255).astype(np.uint8), f"t{number}"))
    return textures


@pytest.mark.parametrize("count", [0, 1, 9])
def test_baseline_and_single(count: int) -> None:
    textures = three_kinds()[:count]
    assert make_grouping("baseline", textures, 5, 0).groups == tuple(range(count))
    assert make_grouping("single", textures, 5, 0).groups == (0,) * count


def test_clusters_find_what_is_alike() -> None:
    grouping = make_grouping("clustered", three_kinds(), 3, 0)
    assert grouping.groups == (0, 1, 2) * 3
    assert grouping.parameters["seed"] == 0


@pytest.mark.parametrize("seed", [0, 1, 7])
def test_random_has_the_sizes_of_clustered(seed: int) -> None:
    textures = three_kinds()[:8]
    clustered, shuffled = (make_grouping(name, textures, 3, seed) for name in ("clustered", "random"))
    assert sorted(Counter(clustered.groups).values()) == sorted(Counter(shuffled.groups).values())
    assert shuffled.group_count == clustered.group_count


@pytest.mark.parametrize("name", ["clustered", "random"])
def test_the_seed_decides(name: Any) -> None:
    textures = three_kinds()
    first, again = (make_grouping(name, textures, 3, 4) for _ in range(2))
    assert first == again
    if name == "random":
        assert len({make_grouping(name, textures, 3, seed).groups for seed in range(6)}) > 1


@pytest.mark.parametrize("name", ["clustered", "random"])
@pytest.mark.parametrize("clusters", [1, 2, 4, 9])
def test_groups_are_numbered_by_first_appearance_without_gaps(name: Any, clusters: int) -> None:
    groups = make_grouping(name, three_kinds(), clusters, 0).groups
    assert list(dict.fromkeys(groups)) == list(range(clusters))


@pytest.mark.parametrize("name", ["clustered", "random"])
def test_more_clusters_than_textures_gives_each_its_own(name: Any) -> None:
    assert make_grouping(name, three_kinds()[:4], 100, 0).groups == (0, 1, 2, 3)


@pytest.mark.parametrize("name", ["baseline", "single", "clustered", "random"])
def test_no_texture_makes_no_group(name: Any) -> None:
    grouping = make_grouping(name, [], 3, 0)
    assert grouping.groups == ()
    assert grouping.group_count == 0


def test_equal_textures_share_a_group_without_a_warning() -> None:
    textures = [three_kinds()[0]] * 4
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert make_grouping("clustered", textures, 3, 0).groups == (0, 0, 0, 0)


@pytest.mark.parametrize("clusters", [0, -1])
def test_less_than_one_cluster_is_bad_input(clusters: int) -> None:
    with pytest.raises(InputError, match=rf"--clusters {clusters}: "):
        make_grouping("clustered", three_kinds(), clusters, 0)


@pytest.mark.parametrize("seed", [-1, 2**32])
def test_a_seed_that_is_out_of_range_is_bad_input(seed: int) -> None:
    with pytest.raises(InputError, match=f"--seed {seed}: "):
        make_grouping("clustered", three_kinds(), 3, seed)


def test_covisible_without_views_is_bad_input() -> None:
    with pytest.raises(InputError, match="covisible: needs views"):
        make_grouping("covisible", three_kinds(), 3, 0)


@pytest.mark.parametrize("channels", [1, 2, 3, 4])
@pytest.mark.parametrize("size", [(1, 1), (1, 300), (2, 2), (17, 33), (300, 4)])
def test_features_are_finite(size: tuple[int, int], channels: int) -> None:
    random = np.random.default_rng(0)
    for pixels in (
        random.integers(0, 256, (*size, channels), np.uint8),
        np.full((*size, channels), 255, np.uint8),
        np.zeros((*size, channels), np.uint8),
    ):
        features = low_level_features(texture(pixels))
        assert features.shape == (17,)
        assert np.isfinite(features).all()


def test_a_nearly_constant_texture_is_finite_and_has_no_detail() -> None:
    pixels = np.full((8, 8, 3), 100, np.uint8)
    pixels[0, 0, 0] = 101
    features = low_level_features(texture(pixels))
    assert np.isfinite(features).all()
    assert features[9:].max() < 0.01


def test_matrix_columns_are_standardised() -> None:
    matrix = feature_matrix(three_kinds())
    np.testing.assert_allclose(matrix.mean(axis=0), 0.0, atol=1e-9)
    deviation = matrix.std(axis=0)
    assert ((np.abs(deviation - 1.0) < 1e-9) | (deviation < 1e-9)).all()
    assert (feature_matrix([three_kinds()[0]] * 2) == 0.0).all()
