"""Groupings by name, and by category."""

import re
import warnings
from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from ntc.codec.config import GroupingConfig, GroupingName
from ntc.codec.maps import MapName
from ntc.codec.textures import SourceTexture, hash_pixels
from ntc.errors import InputError
from ntc.features import feature_matrix
from ntc.grouping import GroupingInputs, make_grouping
from ntc.grouping.category import UNKNOWN, category_grouping, guessed_category, read_labels

SEARCHED: tuple[GroupingName, ...] = ("clustered", "random", "covisible")


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


@pytest.mark.parametrize("name", ["baseline", "single", "category", "clustered", "random", "covisible"])
def test_no_texture_makes_no_group(name: Any) -> None:
    grouping = make_grouping(GroupingConfig(name, 3, seed=0), [])
    assert (grouping.groups, grouping.group_count) == ((), 0)


@pytest.mark.parametrize("name", ["clustered", "random"])
def test_groups_are_decided_by_the_seed_and_numbered_by_first_appearance(name: Any) -> None:
    textures = three_kinds()
    first, again = (make_grouping(GroupingConfig(name, 3, seed=4), textures) for _ in range(2))
    assert first == again
    for clusters in (1, 2, 4, 9):
        groups = make_grouping(GroupingConfig(name, clusters, seed=0), textures).groups
        assert list(dict.fromkeys(groups)) == list(range(clusters))
    # Without a number few textures have a group each.
    assert make_grouping(GroupingConfig(name), textures[:4]).groups == (0, 1, 2, 3)


def test_clusters_find_what_is_alike_without_a_warning() -> None:
    grouping = make_grouping(GroupingConfig("clustered", 3, seed=0), three_kinds())
    assert grouping.groups == (0, 1, 2) * 3
    assert grouping.parameters["seed"] == 0
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert make_grouping(GroupingConfig("clustered", 3, seed=0), three_kinds()[:1] * 4).groups == (0, 0, 0, 0)


def test_random_has_the_sizes_of_clustered_and_differs_by_seed() -> None:
    textures = three_kinds()[:8]
    found = set()
    for seed in range(6):
        clustered, shuffled = (
            make_grouping(GroupingConfig(n, 3, seed=seed), textures) for n in ("clustered", "random")
        )
        assert sorted(Counter(clustered.groups).values()) == sorted(Counter(shuffled.groups).values())
        assert shuffled.group_count == clustered.group_count
        found.add(shuffled.groups)
    assert len(found) > 1


@pytest.mark.parametrize(
    ("config", "words"),
    [
        *((GroupingConfig("covisible", largest_share=share), "--largest-share") for share in (0.0, 1.1, float("nan"))),
        *(
            (GroupingConfig("covisible", spread_weight=w), "--spread-weight")
            for w in (-0.1, float("inf"), float("nan"))
        ),
        *((GroupingConfig("clustered", clusters, seed=0), rf"--clusters {clusters}: ") for clusters in (0, -1)),
        *((GroupingConfig("clustered", 3, seed=seed), f"--seed {seed}: ") for seed in (-1, 2**32)),
        *((GroupingConfig(n, 10), "--clusters 10: there are only 9 textures; at most 9 groups") for n in SEARCHED),
        (GroupingConfig("covisible", 3, seed=0), "covisible: needs views"),
    ],
)
def test_settings_out_of_range_are_bad_input(config: GroupingConfig, words: str) -> None:
    with pytest.raises(InputError, match=words):
        make_grouping(config, three_kinds())


def test_views_that_see_nothing_are_bad_input() -> None:
    nothing = GroupingInputs(views=[np.full((16, 16), -1, np.int32)])
    with pytest.raises(InputError, match="no block of any view shows two textures"):
        make_grouping(GroupingConfig("covisible", 3), three_kinds(), nothing)


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


def named(name: str, category: str | None = None) -> SourceTexture:
    return SourceTexture(name, np.zeros((4, 4, 3), np.uint8), name, category=category)


@pytest.mark.parametrize(
    ("name", "category"),
    [
        ("red_brick_03_diff", "brick"),
        ("MASTER_Wood_Painted_White_BaseColor", "wood"),
        ("Antenna_Metal_BaseColor", "metal"),
        ("PavingStones070", "floor"),
        ("roof-tiles", "roofing"),
        ("GrassField", "terrain"),
        ("dandelion", UNKNOWN),
        ("bricklayer", UNKNOWN),
    ],
)
def test_names_are_guessed_by_whole_words(name: str, category: str) -> None:
    assert guessed_category(name) == category


def test_labels_come_before_guesses_and_are_counted() -> None:
    textures = [named("oak_wood"), named("x1", "brick"), named("wood_2", "brick"), named("x2")]
    grouping = category_grouping(textures)
    assert grouping.groups == (0, 1, 1, 2)
    counts = {"listed": 0, "own": 2, "guessed": 1, "unknown": 1}
    assert grouping.parameters == {"categories": ["wood", "brick", UNKNOWN], **counts}
    listed = category_grouping(textures, {1: "wood", 3: "brick"})
    assert listed.groups == (0, 0, 1, 1)
    assert listed.parameters["listed"] == 2


def labels_of(folder: Path, text: str) -> dict[int, str]:
    path = folder / "labels.csv"
    path.write_text(text, encoding="utf-8")
    return read_labels(path, [named("a/oak.png"), named("brick"), named("x1")])


@pytest.mark.parametrize(
    "text",
    [
        "texture,category\na/oak.png,wood\nbrick,wall\n",
        "file,category,licence\nelsewhere/oak.jpg,wood,CC0\nbrick.png,wall,CC0\n",
        "\ufeffcategory,name\nwood,oak\nwall,brick\n",
    ],
)
def test_a_csv_names_textures_with_or_without_folder_and_ending(tmp_path: Path, text: str) -> None:
    assert labels_of(tmp_path, text) == {0: "wood", 1: "wall"}


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("texture,category\nnowhere,wood\n", "names unknown textures: 'nowhere'"),
        ("texture,category\na,w\nb,w\nc,w\nd,w\n", "'a', 'b', 'c' and 1 more"),
        ("texture,kind\noak,wood\n", "the first line must name the columns texture and category"),
        ("", "the first line must name"),
        ("texture,category\noak,\n", "line 2: needs a texture and a category"),
        (f"texture,category\noak,{'x' * 201}\n", "line 2: the category has more than"),
        ('texture,category\n"oak,wood\n' + "x" * 200_000, "line"),
    ],
)
def test_a_csv_that_does_not_fit_is_refused_in_one_line(tmp_path: Path, text: str, complaint: str) -> None:
    with pytest.raises(InputError, match=re.escape(complaint)) as refused:
        labels_of(tmp_path, text)
    assert "\n" not in str(refused.value)


def test_files_that_are_no_text_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="cannot be read"):
        read_labels(tmp_path / "none.csv", [])
    (tmp_path / "bytes.csv").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InputError, match="not UTF-8"):
        read_labels(tmp_path / "bytes.csv", [])
