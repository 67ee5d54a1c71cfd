"""Grouping by category."""

import numpy as np
import pytest

from ntc.grouping.category import UNKNOWN, category_grouping, guessed_category
from ntc.textures import SourceTexture


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
    grouping = category_grouping(
        [texture("oak_wood"), texture("x1", "brick"), texture("wood_2", "brick"), texture("x2")]
    )
    assert grouping.groups == (0, 1, 1, 2)
    assert grouping.parameters == {"categories": ["wood", "brick", UNKNOWN], "given": 2, "guessed": 1, "unknown": 1}


def test_no_textures_make_no_groups() -> None:
    assert category_grouping([]).groups == ()
