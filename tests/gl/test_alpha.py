"""Alpha of MASK and BLEND materials: sampled with the material's own wrap modes and filters."""

from itertools import product

import numpy as np
import pytest
from numpy.typing import NDArray

from ntc.config import WrapMode
from tests.support.picture_scenes import WHITE, PixelMap, scene_of, straight_camera, texture
from tests.support.sampling import fetch
from viewer.gl.context import GraphicsContext
from viewer.renderer import Renderer
from viewer.scene.model import Material, Sampler, Scene
from viewer.view_state import ViewState

SIZE = (48, 32)
MAP = PixelMap((-0.253, -0.261), (1 / 32 + 1e-4, 0.0), (0.0, 1 / 20 + 1e-4))
"""Magnified, with more than one image and no pixel centre on an edge."""
WRAPS: tuple[WrapMode, ...] = ("repeat", "mirror", "clamp")
EDGES = np.zeros((4, 8), np.uint8)
EDGES[1:, :3] = 255
EDGES[0, 5:] = 180


def covered(graphics: GraphicsContext, scene: Scene, layer: int = 0) -> NDArray[np.bool_]:
    """[H, W] where the quad of a layer is seen."""
    renderer = Renderer(graphics, scene)
    renderer.render(ViewState(straight_camera(layer), SIZE))
    seen = renderer.covered()
    renderer.release()
    return seen


@pytest.mark.parametrize("linear", [True, False], ids=["linear", "nearest"])
@pytest.mark.parametrize("wrap", list(product(WRAPS, WRAPS)), ids="-".join)
def test_holes_are_where_the_sampled_alpha_is_low(
    graphics: GraphicsContext, wrap: tuple[WrapMode, WrapMode], linear: bool
) -> None:
    sampler = Sampler(wrap, linear, linear)
    material = Material("m", 0, WHITE, sampler, "mask", 0.5)
    # The same image under another sampler, seen by no camera here: it must not lend its state.
    other = Material("o", 0, WHITE, Sampler(("clamp", "repeat"), not linear, not linear), "mask", 0.5)
    quads = [MAP.quad(SIZE, 0, 0), MAP.quad(SIZE, 1, 0)]
    quads[1].positions[:, 0] += 100.0
    seen = covered(graphics, scene_of(quads, [material, other], [texture(8, 4, 1, EDGES)]))
    alpha = fetch(EDGES[..., None] / 255.0, MAP.uv(SIZE), sampler, linear)[:, 0].reshape(SIZE[::-1])
    certain = np.abs(alpha - 0.5) > 0.01
    assert certain.mean() > 0.9
    assert (seen == (alpha >= 0.5))[certain].all()


def test_an_opaque_material_ignores_alpha(graphics: GraphicsContext) -> None:
    scene = scene_of([MAP.quad(SIZE)], [Material("m", 0, (1.0, 1.0, 1.0, 0.0))], [texture(8, 4, 1, EDGES)])
    assert covered(graphics, scene).all()


@pytest.mark.parametrize("share", [0.0, 0.2, 0.5, 0.9, 1.0])
def test_blend_covers_its_share_of_the_pixels(graphics: GraphicsContext, share: float) -> None:
    scene = scene_of([MAP.quad(SIZE)], [Material("m", -1, (1.0, 1.0, 1.0, share), alpha_mode="blend")])
    assert covered(graphics, scene).mean() == pytest.approx(share, abs=0.03)


def test_a_mask_without_a_texture_goes_by_its_factor(graphics: GraphicsContext) -> None:
    for alpha, seen in ((0.4, False), (0.6, True)):
        scene = scene_of([MAP.quad(SIZE)], [Material("m", -1, (1.0, 1.0, 1.0, alpha), alpha_mode="mask")])
        assert covered(graphics, scene).all() == seen
        assert covered(graphics, scene).any() == seen
