"""What is in a block."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from viewer.inspect.place_content import BlockPlace, block_content


@pytest.mark.parametrize(
    ("share", "place", "pixels"),
    [
        ((0.0, 0.0), (0, 0), (0, 0, 8, 8)),
        ((0.5, 0.5), (3, 1), (24, 8, 32, 16)),
        ((0.999, 0.999), (6, 3), (48, 24, 50, 30)),
        ((1.0, 1.0), (6, 3), (48, 24, 50, 30)),
        ((-0.5, 2.0), (0, 3), (0, 24, 8, 30)),
    ],
)
def test_a_place_has_a_block(share: Any, place: tuple[int, int], pixels: tuple[int, ...]) -> None:
    found = BlockPlace.at(share, (8, 8), (50, 30))
    assert (found.column, found.row) == place
    assert found.pixels == pixels
    assert found.rectangle == pytest.approx((pixels[0] / 50, pixels[1] / 30, pixels[2] / 50, pixels[3] / 30))


def test_textures_are_counted_most_first_with_their_decoders() -> None:
    scene: Any = SimpleNamespace(textures=[SimpleNamespace(name=name) for name in "abc"])
    ids = np.array([[2, 2, 0], [2, -1, 1]], np.int32)
    place = BlockPlace(1, 2, (3, 2), (9, 9))
    content = block_content(ids, place, scene, {"p": (0, 1, 1), "q": (-1, -1, 5)})
    assert [(texture.name, texture.pixels) for texture in content.textures] == [("c", 3), ("a", 1), ("b", 1)]
    assert (content.decoder_count("p"), content.decoder_count("q"), content.decoder_count("none")) == (2, 1, 0)
    empty = block_content(np.full((2, 3), -1, np.int32), place, scene, {"p": (0, 1, 1)})
    assert (empty.textures, empty.decoder_count("p")) == ((), 0)
