"""Grouping by category."""

import re
from pathlib import Path

import numpy as np
import pytest

from ntc.codec.textures import SourceTexture
from ntc.errors import InputError
from ntc.grouping.category import UNKNOWN, category_grouping, guessed_category, read_labels


def texture(name: str, category: str | None = None) -> SourceTexture:
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
    textures = [texture("oak_wood"), texture("x1", "brick"), texture("wood_2", "brick"), texture("x2")]
    grouping = category_grouping(textures)
    assert grouping.groups == (0, 1, 1, 2)
    counts = {"listed": 0, "own": 2, "guessed": 1, "unknown": 1}
    assert grouping.parameters == {"categories": ["wood", "brick", UNKNOWN], **counts}
    listed = category_grouping(textures, {1: "wood", 3: "brick"})
    assert listed.groups == (0, 0, 1, 1)
    assert listed.parameters["listed"] == 2


def test_no_textures_make_no_groups() -> None:
    assert category_grouping([]).groups == ()


def labels_of(folder: Path, text: str) -> dict[int, str]:
    path = folder / "labels.csv"
    path.write_text(text, encoding="utf-8")
    return read_labels(path, [texture("a/oak.png"), texture("brick"), texture("x1")])


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
        ("texture,category\nnowhere,wood\n", "names textures that are not there: 'nowhere'"),
        ("texture,category\na,w\nb,w\nc,w\nd,w\n", "'a', 'b', 'c' and 1 more"),
        ("texture,kind\noak,wood\n", "the first line must name the columns texture and category"),
        ("", "the first line must name"),
        ("texture,category\noak,\n", "line 2: needs a texture and a category"),
        (f"texture,category\noak,{'x' * 201}\n", "line 2: a category of more than"),
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
