"""What OpenGL 4.1 draws, as macOS has it: the same pictures as 4.3."""

from collections.abc import Iterator
from dataclasses import replace
from typing import Final, get_args

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.support.every_program import CAMERA, packs, scenes
from viewer.gl.context import GraphicsContext
from viewer.render.frames import read_picture
from viewer.render.renderer import Renderer
from viewer.state.view_state import MaterialView, Overlay, Slot, ViewState

pytestmark = pytest.mark.once
SIZE: Final = (60, 40)


def without_compute(graphics: GraphicsContext) -> GraphicsContext:
    """The same context, of which only what OpenGL 4.1 has is used."""
    features = replace(graphics.features, compute=False, weights_in_image=True, half_arithmetic=None)
    return replace(graphics, features=features)


@pytest.fixture(scope="module")
def renderers(graphics: GraphicsContext) -> Iterator[dict[str, tuple[Renderer, Renderer]]]:
    """With and without compute shaders, by scene."""
    made = {}
    for name, scene in scenes().items():
        pair = (Renderer(graphics, scene), Renderer(without_compute(graphics), scene))
        for renderer in pair:
            renderer.set_packs(packs())
        made[name] = pair
    yield made
    for pair in made.values():
        for renderer in pair:
            renderer.release()


def apart(pair: tuple[Renderer, Renderer], view: ViewState) -> NDArray[np.int64]:
    """[H, W] greatest difference of a channel in 255ths."""
    first, second = (read_picture(renderer.render(view, whole=True).image).astype(np.int64) for renderer in pair)
    assert first.std() > 2.0 or view.material_view == "emissive", "nothing to see"
    return np.asarray(np.abs(first - second).max(axis=-1))


@pytest.mark.parametrize("scene", ["plain", "rich"])
@pytest.mark.parametrize("shown", get_args(MaterialView))
def test_original_images_look_the_same(
    renderers: dict[str, tuple[Renderer, Renderer]], scene: str, shown: MaterialView
) -> None:
    view = ViewState(CAMERA, SIZE, Slot(), material_view=shown, anisotropy=8 if scene == "rich" else 1)
    assert (apart(renderers[scene], view) <= 1).mean() >= 0.999


@pytest.mark.parametrize("scene", ["rich", pytest.param("plain", marks=pytest.mark.guards("drawing"))])
def test_packs_look_the_same(renderers: dict[str, tuple[Renderer, Renderer]], scene: str) -> None:
    for source in ("grid", "grid-adapter-output", "block", "block-4x4", "block-sets"):
        view = ViewState(CAMERA, SIZE, Slot(source, "forward"), material_view="lit")
        assert (apart(renderers[scene], view) <= 1).mean() >= 0.999, source


def test_samples_are_averaged_alike(renderers: dict[str, tuple[Renderer, Renderer]]) -> None:
    slot = Slot("grid", "forward", "fp16", filter="stochastic")
    assert (apart(renderers["rich"], ViewState(CAMERA, SIZE, slot)) <= 1).mean() >= 0.999


def test_paths_that_compute_are_drawn_by_forward(renderers: dict[str, tuple[Renderer, Renderer]]) -> None:
    for slot in (Slot("grid", "binned"), Slot("block", "cached")):
        view = ViewState(CAMERA, SIZE, slot)
        assert renderers["plain"][1].render(view).paths == {slot: "forward", Slot(): "deferred"}
    assert (apart(renderers["plain"], ViewState(CAMERA, SIZE, Slot("grid", "binned"))) <= 1).mean() >= 0.999


def test_overlays_look_the_same(renderers: dict[str, tuple[Renderer, Renderer]]) -> None:
    view = ViewState(CAMERA, SIZE, Slot("grid", "forward"), Slot("block", "forward"), compare="wipe")
    for overlay in (Overlay("divergence"), Overlay("error-texture")):
        assert (apart(renderers["plain"], replace(view, overlay=overlay, highlight=(0,))) <= 1).mean() >= 0.999
