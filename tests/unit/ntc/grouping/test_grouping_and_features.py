"""Groupings, and the features that clusters are found by."""

import warnings
from collections import Counter
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from ntc.codec.config import GroupingConfig
from ntc.codec.maps import MapName
from ntc.codec.textures import SourceTexture, hash_pixels
from ntc.errors import InputError
from ntc.features import feature_matrix
from ntc.features.statistics import low_level_features
from ntc.grouping import GroupingInputs, make_grouping


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
    assert make_grouping(GroupingConfig("baseline", 5, seed=0), textures).groups == tuple(range(count))
    assert make_grouping(GroupingConfig("single", 5, seed=0), textures).groups == (0,) * count


def test_clusters_find_what_is_alike() -> None:
    grouping = make_grouping(GroupingConfig("clustered", 3, seed=0), three_kinds())
    assert grouping.groups == (0, 1, 2) * 3
    assert grouping.parameters["seed"] == 0


@pytest.mark.parametrize("seed", [0, 1, 7])
def test_random_has_the_sizes_of_clustered(seed: int) -> None:
    textures = three_kinds()[:8]
    clustered, shuffled = (
        make_grouping(GroupingConfig(name, 3, seed=seed), textures) for name in ("clustered", "random")
    )
    assert sorted(Counter(clustered.groups).values()) == sorted(Counter(shuffled.groups).values())
    assert shuffled.group_count == clustered.group_count


@pytest.mark.parametrize("name", ["clustered", "random"])
def test_the_seed_decides(name: Any) -> None:
    textures = three_kinds()
    first, again = (make_grouping(GroupingConfig(name, 3, seed=4), textures) for _ in range(2))
    assert first == again
    if name == "random":
        assert len({make_grouping(GroupingConfig(name, 3, seed=seed), textures).groups for seed in range(6)}) > 1


@pytest.mark.parametrize("name", ["clustered", "random"])
@pytest.mark.parametrize("clusters", [1, 2, 4, 9])
def test_groups_are_numbered_by_first_appearance_without_gaps(name: Any, clusters: int) -> None:
    groups = make_grouping(GroupingConfig(name, clusters, seed=0), three_kinds()).groups
    assert list(dict.fromkeys(groups)) == list(range(clusters))


@pytest.mark.parametrize("name", ["clustered", "random", "covisible"])
def test_more_clusters_than_textures_is_bad_input(name: Any) -> None:
    with pytest.raises(InputError, match="--clusters 5: there are only 4 textures; at most 4 groups"):
        make_grouping(GroupingConfig(name, 5), three_kinds()[:4])


@pytest.mark.parametrize("name", ["clustered", "random"])
def test_without_a_number_few_textures_have_a_group_each(name: Any) -> None:
    assert make_grouping(GroupingConfig(name), three_kinds()[:4]).groups == (0, 1, 2, 3)


@pytest.mark.parametrize("share", [0.0, 1.1, float("nan")])
def test_a_share_out_of_range_is_bad_input(share: float) -> None:
    with pytest.raises(InputError, match="--largest-share"):
        make_grouping(GroupingConfig("covisible", largest_share=share), three_kinds())


@pytest.mark.parametrize("weight", [-0.1, float("inf"), float("nan")])
def test_a_weight_out_of_range_is_bad_input(weight: float) -> None:
    with pytest.raises(InputError, match="--spread-weight"):
        make_grouping(GroupingConfig("covisible", spread_weight=weight), three_kinds())


def test_views_that_see_nothing_are_bad_input() -> None:
    nothing = GroupingInputs(views=[np.full((16, 16), -1, np.int32)])
    with pytest.raises(InputError, match="no block of any view shows two textures"):
        make_grouping(GroupingConfig("covisible", 3), three_kinds(), nothing)


@pytest.mark.parametrize("features", ["low_level", "spectral"])
def test_covisible_says_how_it_was_found(features: Any) -> None:
    views = GroupingInputs(views=[np.random.default_rng(0).integers(-1, 9, (64, 64)).astype(np.int32)])
    grouping = make_grouping(GroupingConfig("covisible", 3, features), three_kinds(), views)
    assert grouping.group_count == 3
    assert grouping.parameters["features"] == features
    assert grouping.parameters["excess"] <= grouping.parameters["baseline_excess"]


@pytest.mark.parametrize("name", ["baseline", "single", "category", "clustered", "random", "covisible"])
def test_no_texture_makes_no_group(name: Any) -> None:
    grouping = make_grouping(GroupingConfig(name, 3, seed=0), [])
    assert grouping.groups == ()
    assert grouping.group_count == 0


def test_equal_textures_share_a_group_without_a_warning() -> None:
    textures = [three_kinds()[0]] * 4
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert make_grouping(GroupingConfig("clustered", 3, seed=0), textures).groups == (0, 0, 0, 0)


@pytest.mark.parametrize("clusters", [0, -1])
def test_less_than_one_cluster_is_bad_input(clusters: int) -> None:
    with pytest.raises(InputError, match=rf"--clusters {clusters}: "):
        make_grouping(GroupingConfig("clustered", clusters, seed=0), three_kinds())


@pytest.mark.parametrize("seed", [-1, 2**32])
def test_a_seed_that_is_out_of_range_is_bad_input(seed: int) -> None:
    with pytest.raises(InputError, match=f"--seed {seed}: "):
        make_grouping(GroupingConfig("clustered", 3, seed=seed), three_kinds())


def test_covisible_without_views_is_bad_input() -> None:
    with pytest.raises(InputError, match="covisible: needs views"):
        make_grouping(GroupingConfig("covisible", 3, seed=0), three_kinds())


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
    matrix = feature_matrix("low_level", three_kinds())
    np.testing.assert_allclose(matrix.mean(axis=0), 0.0, atol=1e-9)
    deviation = matrix.std(axis=0)
    assert ((np.abs(deviation - 1.0) < 1e-9) | (deviation < 1e-9)).all()
    assert (feature_matrix("low_level", [three_kinds()[0]] * 2) == 0.0).all()


def with_maps(source: SourceTexture, maps: tuple[MapName, ...], channels: int) -> SourceTexture:
    """`source` as a set: its first channel again and again."""
    return replace(source, pixels=np.repeat(source.pixels[..., :1], channels, axis=2), maps=maps)


@pytest.mark.parametrize("name", ["clustered", "random", "covisible"])
def test_textures_with_other_maps_share_no_group(name: Any) -> None:
    kinds: list[tuple[tuple[MapName, ...], int]] = [(("base",), 3), (("base", "normal"), 5), (("normal",), 2)]
    sources = [with_maps(source, *kinds[index % 3]) for index, source in enumerate(three_kinds() * 2)]
    view = np.arange(64, dtype=np.int32).reshape(8, 8) % len(sources)
    inputs = GroupingInputs(views=(view,))
    grouping = make_grouping(GroupingConfig(name, clusters=5), sources, inputs)
    assert grouping.name == name
    assert grouping.group_count <= 5
    for group in range(grouping.group_count):
        members = {sources[index].maps for index, own in enumerate(grouping.groups) if own == group}
        assert len(members) == 1
    assert grouping.parameters["kinds"] == 3
    # Fewer groups than kinds: there is no choice.
    assert make_grouping(GroupingConfig(name, clusters=2), sources, inputs).group_count <= 2


def test_features_of_a_set_are_those_of_its_first_map() -> None:
    sources = three_kinds()
    sets = [replace(source, pixels=np.tile(source.pixels, 2)[..., :5], maps=("base", "normal")) for source in sources]
    np.testing.assert_array_equal(feature_matrix("low_level", sources), feature_matrix("low_level", sets))
