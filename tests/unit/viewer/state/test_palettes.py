"""Colours of the divergence map."""

import numpy as np
import pytest

from viewer.capture.overlay_picture import with_color_bar
from viewer.state.palettes import PALETTES, PaletteName, palette_colors, share_of_most


def test_green_red_has_the_colours_of_the_paper() -> None:
    expected = [(0.0, 1.0, 0.0), (1.0, 1.0, 0.0), (1.0, 0.0, 0.0)]
    np.testing.assert_allclose(palette_colors("green-red", np.array([0.0, 0.5, 1.0])), expected)


def test_the_other_palette_grows_brighter_all_the_way() -> None:
    # Whoever cannot tell hues apart still sees which block has more decoders.
    colors = palette_colors("viridis", np.linspace(0.0, 1.0, 50))
    brightness = colors @ np.array([0.2126, 0.7152, 0.0722])
    assert (np.diff(brightness) > 0.0).all()


@pytest.mark.parametrize(
    ("decoders", "most", "share"), [(1, 5, 0.0), (5, 5, 1.0), (3, 5, 0.5), (1, 1, 0.0), (9, 5, 1.0)]
)
def test_one_decoder_is_the_near_end(decoders: int, most: int, share: float) -> None:
    assert share_of_most(decoders, most) == share


@pytest.mark.parametrize("palette", list(PALETTES))
@pytest.mark.parametrize("most", [2, 7, 40])
def test_the_bar_shows_every_number_in_its_colour(palette: PaletteName, most: int) -> None:
    picture = np.full((200, 500, 3), 90, np.uint8)
    drawn = with_color_bar(picture, palette, most)
    assert drawn.shape == picture.shape
    np.testing.assert_array_equal(drawn[:100], picture[:100])
    shares = np.array([share_of_most(decoders, most) for decoders in range(1, most + 1)])
    colors = {tuple(color) for color in np.rint(palette_colors(palette, shares) * 255.0).astype(int).tolist()}
    seen = {tuple(pixel) for pixel in drawn.reshape(-1, 3).astype(int).tolist()}
    assert colors <= seen
    # White digits below.
    assert (drawn == 255).all(axis=2).any() or (drawn.min(axis=2) > 200).any()


@pytest.mark.parametrize("size", [(5, 5), (40, 300), (300, 60)])
def test_small_pictures_have_no_bar(size: tuple[int, int]) -> None:
    picture = np.zeros((*size, 3), np.uint8)
    np.testing.assert_array_equal(with_color_bar(picture, "viridis", 4), picture)
