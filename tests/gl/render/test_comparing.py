"""How two slots come together in one picture, pixel by pixel against NumPy; and that it costs one pass."""

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from ntc.codec.mips import linear_to_srgb
from tests.gl.small_scenes import FRONT, objects, pack_of
from viewer.gl.context import GraphicsContext
from viewer.render.compositor import ComparisonErrors
from viewer.render.frames import read_picture
from viewer.render.passes.composite import DIMMED, FLIP_PALETTE, LEAST_LIGHT
from viewer.render.renderer import Renderer
from viewer.state.palettes import palette_colors
from viewer.state.view_state import CompareMode, Difference, DifferenceKind, Overlay, Slot, ViewState, Zoom

SIZE = (120, 72)
VIEW = ViewState(FRONT, SIZE, Slot("p"), Slot())
Values = NDArray[np.float64]


@pytest.fixture(scope="module")
def renderer(graphics: GraphicsContext) -> Iterator[Renderer]:
    scene = objects()
    made = Renderer(graphics, scene)
    made.set_packs({"p": pack_of(scene)})
    yield made
    made.release()


def shown(renderer: Renderer, view: ViewState) -> NDArray[np.uint8]:
    return read_picture(renderer.render(view).image)


def linear(renderer: Renderer) -> tuple[Values, Values]:
    """What A and B are."""
    renderer.render(VIEW)
    a, b = (renderer.picture(slot).astype(np.float64) for slot in (VIEW.slot_a, VIEW.slot_b))
    assert np.abs(a - b).max() > 0.1
    return a, b


def assert_shows(picture: NDArray[np.uint8], expected: Values) -> None:
    """`expected` in [0, 1], sRGB; within rounding."""
    assert np.abs(picture - 255.0 * np.clip(expected, 0.0, 1.0)).max() <= 0.51 + 0.02


@pytest.mark.parametrize("kind", ["raw", "amplified", "relative"])
@pytest.mark.parametrize("gain", [1.0, 4.5])
def test_differences(renderer: Renderer, kind: DifferenceKind, gain: float) -> None:
    a, b = linear(renderer)
    picture = shown(renderer, replace(VIEW, compare="difference", difference=Difference(kind, gain)))
    expected = np.abs(linear_to_srgb(np.clip(a, 0.0, 1.0)) - linear_to_srgb(np.clip(b, 0.0, 1.0)))
    if kind == "relative":
        expected = np.abs(a - b) / np.maximum(a, LEAST_LIGHT)
    elif kind == "amplified":
        expected = expected * gain
    # Where a difference is amplified, so is the rounding of the transfer function.
    assert np.abs(picture - 255.0 * np.clip(expected, 0.0, 1.0)).max() <= 1.0
    assert picture.std() > 5.0


def test_the_flip_map_is_shown_on_its_palette_and_only_for_its_picture(renderer: Renderer) -> None:
    view = replace(VIEW, compare="difference", difference=Difference("flip"))
    unknown = shown(renderer, view)
    pair = renderer.drawn_pair()
    assert pair is not None
    errors = np.random.default_rng(3).random((SIZE[1], SIZE[0]), dtype=np.float32)
    renderer.errors.set_flip(errors, pair.key)
    steps = np.round(palette_colors(FLIP_PALETTE, np.linspace(0.0, 1.0, 32)), 7)
    expected = np.stack([np.interp(errors, np.linspace(0.0, 1.0, 32), steps[:, c]) for c in range(3)], axis=-1)
    assert_shows(shown(renderer, view), expected)
    turned = replace(view, camera=replace(FRONT, fov_degrees=40.0))
    assert (shown(renderer, turned) == shown(renderer, turned)[..., :1]).all()
    renderer.errors.set_flip(None, None)
    np.testing.assert_array_equal(shown(renderer, view), unknown)


@pytest.mark.parametrize(
    "change",
    [
        {},
        {"wipe_position": 0.25, "flipped": True},
        {"wipe_position": 0.9, "overlay": Overlay("divergence", opacity=0.5)},
        {"zoom": Zoom(4.0, (0.4, 0.55))},
    ],
    ids=["plain", "flipped", "divergence", "zoomed"],
)
def test_layouts_are_made_of_the_parts_of_both_pictures(renderer: Renderer, change: dict[str, Any]) -> None:
    view = replace(VIEW, **change)
    modes: tuple[CompareMode, ...] = ("b", "a") if view.flipped else ("a", "b")
    first, second = (shown(renderer, replace(view, compare=mode)) for mode in modes)
    column, row = (round(view.wipe_position * side) for side in SIZE)
    middle = slice(SIZE[0] // 4, SIZE[0] // 4 + SIZE[0] // 2)
    layouts: dict[CompareMode, NDArray[np.uint8]] = {
        "wipe": np.concatenate([first[:, :column], second[:, column:]], axis=1),
        "wipe-horizontal": np.concatenate([first[:row], second[row:]]),
        "side-by-side": np.concatenate([first[:, middle], second[:, middle]], axis=1),
    }
    for mode, expected in layouts.items():
        np.testing.assert_array_equal(shown(renderer, replace(view, compare=mode)), expected, mode)


@pytest.mark.parametrize("kind", ["error-texture", "error-decoder"])
def test_errors_colour_textures(renderer: Renderer, kind: str) -> None:
    plain = shown(renderer, replace(VIEW, compare="a"))
    count = len(renderer.scene.textures)
    by_texture = np.linspace(1.0, 9.0, count, dtype=np.float32)
    by_texture[0] = np.nan
    by_decoder = by_texture[::-1].copy()
    overlay = Overlay(
        "error-texture" if kind == "error-texture" else "error-decoder", opacity=0.75, palette="green-red"
    )
    renderer.errors.set_errors(ComparisonErrors(by_texture, by_decoder))
    picture = shown(renderer, replace(VIEW, compare="a", overlay=overlay))
    values = by_texture if kind == "error-texture" else by_decoder
    shares = np.append(values / np.nanmax(values), np.nan)[renderer.texture_ids()]
    known = np.isfinite(shares)
    steps = palette_colors("green-red", np.linspace(0.0, 1.0, 32))
    places = np.linspace(0.0, 1.0, 32)
    heat = np.stack([np.interp(shares[known], places, steps[:, c]) for c in range(3)], axis=-1)
    a, _ = linear(renderer)
    expected = 0.25 * linear_to_srgb(np.clip(a, 0.0, 1.0))[known] + 0.75 * heat
    assert np.abs(picture[known] - 255.0 * expected).max() <= 1.0
    assert known.mean() > 0.1
    np.testing.assert_array_equal(picture[~known], plain[~known])
    renderer.errors.set_errors(None)
    np.testing.assert_array_equal(shown(renderer, replace(VIEW, compare="a", overlay=overlay)), plain)


def test_a_highlight_dims_everything_else(renderer: Renderer) -> None:
    plain = shown(renderer, replace(VIEW, compare="a")).astype(np.float64)
    ids = renderer.texture_ids()
    seen = np.unique(ids[ids >= 0])
    lit = int(seen[0])
    picture = shown(renderer, replace(VIEW, compare="a", highlight=(lit,)))
    np.testing.assert_array_equal(picture[ids == lit], plain[ids == lit])
    assert np.abs(picture[ids != lit] - DIMMED * plain[ids != lit]).max() <= 1.0
    np.testing.assert_array_equal(shown(renderer, replace(VIEW, compare="a")), plain)


def test_changing_the_comparison_composes_and_does_nothing_else(renderer: Renderer) -> None:
    """Flicker, flips, wipes and differences of two slots that are drawn: one pass each, and none for what is shown already."""
    overlaid = replace(VIEW, overlay=Overlay("divergence"))
    for start in (VIEW, overlaid):
        for mode in ("a", "b"):
            renderer.render(replace(start, compare=mode))
        for number in range(6):
            flipped = renderer.render(replace(start, compare="ab"[number % 2]))  # type: ignore[arg-type]
            assert list(flipped.timings_ms) == ["composite"]
        for mode in ("wipe", "wipe-horizontal", "side-by-side", "difference"):
            for other in (False, True) if mode != "difference" else (False,):
                frame = renderer.render(replace(start, compare=mode, flipped=other))  # type: ignore[arg-type]
                assert list(frame.timings_ms) == ["composite"], mode
                assert not renderer.render(replace(start, compare=mode, flipped=other)).timings_ms  # type: ignore[arg-type]


def test_what_rests_is_prepared(graphics: GraphicsContext) -> None:
    scene = objects()
    made = Renderer(graphics, scene)
    made.set_packs({"p": pack_of(scene, groups=(0,) * len(scene.textures))})
    before = shown(made, replace(VIEW, compare="a"))
    assert made.drawn_pair() is None
    assert not made.prepare_comparison()
    assert made.prepare_slots()
    assert not made.prepare_slots()
    pair = made.drawn_pair()
    assert pair is not None
    looks = 0
    while made.prepare_comparison():
        looks += 1
    assert looks >= 4
    frame = made.render(replace(VIEW, compare="b"))
    assert list(frame.timings_ms) == ["composite"]
    again = made.drawn_pair()
    assert again is not None
    assert again.key == pair.key
    np.testing.assert_array_equal(shown(made, replace(VIEW, compare="a")), before)
    made.release()


def test_parts_are_read_back_as_the_whole_is(renderer: Renderer) -> None:
    a, b = linear(renderer)
    part = (17, 20, 40, 31)
    for slot, whole in ((VIEW.slot_a, a), (VIEW.slot_b, b)):
        read = renderer.picture_in(slot, part)
        assert read is not None
        np.testing.assert_array_equal(read, whole[20:31, 17:40])
    ids = renderer.texture_ids()
    for x, y in ((17, 20), (60, 36), (0, 0), (119, 71)):
        word = int(renderer.visibility.words_in((x, y, x + 1, y + 1)).read()[0, 0, 0])
        assert (word & 0xFFFF) - 1 == ids[y, x]
    assert renderer.picture_in(Slot("p", "cached"), part) is None
