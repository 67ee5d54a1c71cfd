"""BLEND surfaces at rest: pictures are the mean of samples against several patterns of thresholds; ids are those of the first."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from lab.bench.random_pack import random_pack
from ntc.codec.mips import linear_to_srgb
from ntc.codec.model import Pack
from tests.support import noise
from tests.support.noise import words
from tests.support.picture_scenes import QUAD, WHITE, Part, scene_of, texture
from viewer.gl.allocation import GpuMemoryError
from viewer.gl.context import GraphicsContext
from viewer.render.frames import FrameResult, read_picture
from viewer.render.passes.blend_samples import BlendSamplesPass
from viewer.render.renderer import Renderer
from viewer.render.resources.accumulator import SAMPLES
from viewer.render.slot_drawer import dithered_materials
from viewer.scene.model import Camera, Material, Scene
from viewer.state.navigation import turned
from viewer.state.view_state import MaterialView, Overlay, Slot, ViewState

SIZE = (96, 64)
ALPHA = 0.3
FRONT, BACK = np.array([0.9, 0.1, 0.2]), np.array([0.05, 0.6, 0.8])
MIX = ALPHA * FRONT + (1.0 - ALPHA) * BACK
MOST_DEVIATION = 0.06
"""Of the still picture's linear light over a flat area, as a share of that of one sample: 16 thresholds, one in each sixteenth,
miss a share of the samples by less than one."""
ORTHOGRAPHIC = Camera("straight", (0.0, 0.0, 3.0), (0.0, 0.0, 0.0), orthographic_height=2.0, near=0.25, far=9.0)
PERSPECTIVE = Camera("front", (0.3, 0.2, 3.0), (0.0, 0.0, 0.0), fov_degrees=50.0)
PLAIN = ViewState(ORTHOGRAPHIC, SIZE)
TEXTURES = (texture(32, 32, 1), texture(32, 32, 2))
SLOTS = {
    "reference": Slot(),
    "deferred": Slot("p"),
    "forward": Slot("p", "forward"),
    "binned": Slot("p", "binned"),
    "cached": Slot("p", "cached"),
    "stochastic": Slot("p", "deferred", filter="stochastic"),
}


def moved(layer: float) -> NDArray[np.float32]:
    return (QUAD * np.array([4.0, 4.0, 1.0]) + np.array([0.0, 0.0, layer])).astype(np.float32)


def flat_scene(alpha: float = ALPHA) -> Scene:
    """A plain BLEND quad before a plain opaque one; both fill the picture."""
    materials = [
        Material("back", -1, (*BACK, 1.0)),
        Material("front", -1, (*FRONT, alpha), alpha_mode="blend"),
    ]
    return scene_of([Part(0, moved(-1.0)), Part(1, moved(0.0))], materials)


def textured_scene() -> Scene:
    """The same with textures, and the BLEND quad in the middle only."""
    materials = [
        Material("back", 0, WHITE),
        Material("front", 1, (1.0, 1.0, 1.0, ALPHA), alpha_mode="blend"),
    ]
    return scene_of([Part(0, moved(-1.0)), Part(1)], materials, TEXTURES)


def pack() -> Pack:
    return random_pack(((32, 32),) * 2, (0, 1), hashes=[own.pixel_hash for own in TEXTURES])


@pytest.fixture
def flat(graphics: GraphicsContext) -> Iterator[Renderer]:
    made = Renderer(graphics, flat_scene())
    yield made
    made.release()


@pytest.fixture
def textured(graphics: GraphicsContext) -> Iterator[Renderer]:
    made = Renderer(graphics, textured_scene())
    made.set_packs({"p": pack()})
    yield made
    made.release()


def rest(renderer: Renderer, view: ViewState) -> FrameResult:
    """The last frame of a view that rests until nothing is waited for."""
    for _ in range(4 * SAMPLES):
        frame = renderer.render(view)
        if frame.is_complete:
            return frame
    pytest.fail("the view never rests")


def shown(renderer: Renderer, slot: Slot) -> NDArray[np.float64]:
    """[H * W, 3] linear: what is on screen."""
    found = renderer.picture_in(slot, (0, 0, *SIZE))
    assert found is not None
    return found.reshape(-1, 3).astype(np.float64)


def test_a_still_picture_is_the_mix_without_dither(flat: Renderer) -> None:
    moving = flat.render(PLAIN)
    one = shown(flat, Slot())
    np.testing.assert_allclose(one.std(0), np.sqrt(ALPHA * (1.0 - ALPHA)) * np.abs(FRONT - BACK), rtol=0.05)
    assert moving.blend_samples == {Slot(): 1}
    still = rest(flat, PLAIN)
    mean = shown(flat, Slot())
    assert still.blend_samples == {Slot(): SAMPLES}
    assert np.abs(linear_to_srgb(mean.mean(0)) - linear_to_srgb(MIX)).max() <= 2.0 / 255.0
    assert (mean.std(0) <= MOST_DEVIATION * one.std(0)).all()
    picture = read_picture(still.image).reshape(-1, 3) / 255.0
    np.testing.assert_allclose(picture, linear_to_srgb(mean), atol=0.6 / 255.0)


def covered(alpha: float, samples: int) -> NDArray[np.float64]:
    """[H * W] share of the first `samples` samples, 1 or 16, in which a surface covers each pixel, by the twin."""
    rows, columns = np.mgrid[: SIZE[1], : SIZE[0]]
    # OpenGL counts rows from the bottom.
    x, y = words(columns.ravel()), words(SIZE[1] - 1 - rows.ravel())
    alphas = np.full(x.shape, alpha, np.float32)
    # The order of the samples is of no effect on their mean.
    thresholds = [noise.blend_threshold(x, y, np.zeros_like(x), np.full_like(x, number)) for number in range(samples)]
    return np.mean([noise.is_covered(alphas, own) for own in thresholds], axis=0)


@pytest.mark.driver
@pytest.mark.parametrize("alpha", [0.0, 1 / 64, 0.3, 0.77, 1.0])
def test_the_pixels_that_are_covered_are_those_of_the_noise(graphics: GraphicsContext, alpha: float) -> None:
    renderer = Renderer(graphics, flat_scene(alpha))
    for samples, whole in ((1, False), (SAMPLES, True)):
        renderer.render(replace(PLAIN, camera=PERSPECTIVE))
        renderer.render(PLAIN, whole)
        share = (shown(renderer, Slot()) - BACK)[:, 0] / (FRONT - BACK)[0]
        np.testing.assert_allclose(share, covered(alpha, samples), atol=1e-3)
    renderer.release()


def test_a_surface_covers_its_share_of_what_one_before_it_lets_through(graphics: GraphicsContext) -> None:
    scene = flat_scene(0.5)
    middle = Material("middle", -1, (1.0, 1.0, 1.0, 0.5), alpha_mode="blend")
    parts = [Part(0, moved(-1.0)), Part(1, moved(0.0)), Part(2, moved(-0.5))]
    renderer = Renderer(graphics, scene_of(parts, (*scene.materials, middle)))
    for camera in (ORTHOGRAPHIC, PERSPECTIVE):
        renderer.render(replace(PLAIN, camera=camera))
        one = shown(renderer, Slot())
        renderer.render(replace(PLAIN, camera=camera), whole=True)
        mean = shown(renderer, Slot())
        # A sixteenth of the samples is the first one, in which the surface in the middle is hidden.
        np.testing.assert_allclose(mean.mean(0), 0.5 * FRONT + 0.25 + 0.25 * BACK, atol=0.025)
        assert (mean.std(0) <= 0.2 * one.std(0)).all()
    renderer.release()


@pytest.mark.parametrize(
    ("name", "material_view"),
    [(name, "base" if number % 2 else "lit") for number, name in enumerate(SLOTS)],
)
def test_all_samples_at_once_are_those_of_a_view_at_rest(
    textured: Renderer, name: str, material_view: MaterialView
) -> None:
    slot = SLOTS[name]
    view = ViewState(PERSPECTIVE, SIZE, slot, slot, compare="a", material_view=material_view)
    assert rest(textured, view).blend_samples == {slot: SAMPLES}
    gathered = shown(textured, slot)
    assert textured.render(view).timings_ms.keys() <= {"composite"}
    textured.render(replace(view, camera=turned(PERSPECTIVE, 3.0)))
    at_once = textured.render(view, whole=True)
    assert at_once.is_complete
    assert at_once.timings_ms["blend_samples"] > at_once.timings_ms["visibility"]
    np.testing.assert_array_equal(shown(textured, slot), gathered)
    np.testing.assert_array_equal(textured.picture(slot).reshape(-1, 3), gathered)


@pytest.mark.parametrize("path", ["forward", "binned", "cached"])
def test_all_paths_take_the_same_samples(textured: Renderer, path: str) -> None:
    view = ViewState(PERSPECTIVE, SIZE, SLOTS["deferred"], SLOTS[path], compare="difference")
    rest(textured, view)
    off = np.abs(shown(textured, SLOTS["deferred"]) - shown(textured, SLOTS[path])).max(-1)
    # Path cached rounds texels to bytes, and the others decode filtered inputs.
    assert np.median(off) < (0.2 if path == "cached" else 1e-4)
    if path != "cached":
        assert (off < 1e-3).mean() > 0.99


def test_ids_divergence_and_planes_stay_those_of_the_first_sample(textured: Renderer) -> None:
    view = ViewState(PERSPECTIVE, SIZE, SLOTS["deferred"], compare="a", overlay=Overlay("divergence"))
    first = textured.render(view)
    ids, words, statistics = textured.texture_ids(), textured.visibility.words(), first.divergence["p"]
    assert set(np.unique(ids)) == {0, 1}
    for _ in range(SAMPLES):
        frame = textured.render(view)
        assert frame.divergence["p"] == statistics
        np.testing.assert_array_equal(textured.texture_ids(), ids)
    np.testing.assert_array_equal(textured.visibility.words(), words)
    (base,) = textured.planes(SLOTS["deferred"]).values()
    assert not np.array_equal(base[..., :3].reshape(-1, 3), shown(textured, SLOTS["deferred"]))


def test_a_pair_is_complete_once_both_slots_have_all_samples(textured: Renderer) -> None:
    view = ViewState(PERSPECTIVE, SIZE, Slot(), SLOTS["deferred"], compare="wipe")
    keys = set()
    for number in range(1, SAMPLES + 1):
        assert textured.render(view).blend_samples == {Slot(): number, SLOTS["deferred"]: number}
        assert (textured.drawn_pair() is not None) == (number == SAMPLES)
        keys.add(textured.pair_key())
    assert len(keys) == SAMPLES
    # The slot that is not shown is prepared in the same way.
    alone = replace(view, camera=turned(PERSPECTIVE, 1.0), compare="a")
    rest(textured, alone)
    assert textured.drawn_pair() is None
    while textured.prepare_slots():
        pass
    assert textured.drawn_pair() is not None
    assert textured.render(replace(alone, compare="b")).blend_samples == {SLOTS["deferred"]: SAMPLES}


def test_other_views_take_one_sample(graphics: GraphicsContext) -> None:
    away = turned(PERSPECTIVE, 180.0)
    clear = flat_scene(1.0)
    opaque = replace(clear, materials=(clear.materials[0], replace(clear.materials[1], alpha_mode="mask")))
    for scene, camera in ((textured_scene(), away), (clear, PERSPECTIVE), (opaque, PERSPECTIVE)):
        renderer = Renderer(graphics, scene)
        frame = renderer.render(replace(PLAIN, camera=camera))
        assert (frame.blend_samples, frame.is_complete) == ({}, True)
        assert renderer.render(replace(PLAIN, camera=camera)).timings_ms.keys() <= {"composite"}
        assert "blend_samples" not in renderer.render(replace(PLAIN, camera=camera), whole=True).timings_ms
        renderer.release()
    assert dithered_materials(flat_scene(0.0)) == dithered_materials(clear) == frozenset()
    assert dithered_materials(textured_scene()) == {1}


def test_without_memory_for_samples_the_first_stays(textured: Renderer, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object) -> None:
        raise GpuMemoryError("no memory")

    textured.render(PLAIN)
    first = shown(textured, Slot())
    with monkeypatch.context() as patch:
        patch.setattr(BlendSamplesPass, "_add", fail)
        frame = textured.render(PLAIN)
    assert (frame.blend_samples, frame.is_complete) == ({}, True)
    assert textured.render(PLAIN).timings_ms.keys() <= {"composite"}
    np.testing.assert_array_equal(shown(textured, Slot()), first)
    # Another view is tried anew.
    assert rest(textured, replace(PLAIN, camera=PERSPECTIVE)).blend_samples == {Slot(): SAMPLES}
