"""Alpha of MASK and BLEND materials: sampled with the material's own wrap modes and filters."""

from collections.abc import Iterator
from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from numpy.typing import NDArray

from ntc.api import encode, material
from ntc.codec.config import WrapMode
from ntc.codec.encoding import BitsTarget
from tests.support.picture_scenes import WHITE, PixelMap, scene_of, straight_camera, texture
from tests.support.sampling import fetch
from viewer.gl.context import GraphicsContext
from viewer.render.renderer import Renderer
from viewer.scene.model import Material, Sampler
from viewer.state.view_state import ViewState

pytestmark = pytest.mark.driver

SIZE = (48, 32)
MAP = PixelMap((-0.253, -0.261), (1 / 32 + 1e-4, 0.0), (0.0, 1 / 20 + 1e-4))
"""Magnified, with more than one image and no pixel centre on an edge."""
WRAPS: tuple[WrapMode, ...] = ("repeat", "mirror", "clamp")
EDGES = np.zeros((4, 8), np.uint8)
EDGES[1:, :3] = 255
EDGES[0, 5:] = 180


MASKS = {
    f"{wrap[0]}-{wrap[1]}-{'linear' if linear else 'nearest'}": Sampler(wrap, linear, linear)
    for wrap in product(WRAPS, WRAPS)
    for linear in (True, False)
}


@pytest.fixture(scope="module")
def masked(graphics: GraphicsContext) -> Iterator[Renderer]:
    """One image under all samplers, one quad behind the other."""
    materials = [Material("m", 0, WHITE, sampler, "mask", 0.5) for sampler in MASKS.values()]
    quads = [MAP.quad(SIZE, layer, layer) for layer in range(len(MASKS))]
    renderer = Renderer(graphics, scene_of(quads, materials, [texture(8, 4, 1, EDGES)]))
    yield renderer
    renderer.release()


@pytest.mark.parametrize("name", MASKS)
def test_holes_are_where_the_sampled_alpha_is_low(masked: Renderer, name: str) -> None:
    masked.render(ViewState(straight_camera(list(MASKS).index(name)), SIZE))
    sampler = MASKS[name]
    alpha = fetch(EDGES[..., None] / 255.0, MAP.uv(SIZE), sampler, sampler.magnify_linear)[:, 0].reshape(SIZE[::-1])
    certain = np.abs(alpha - 0.5) > 0.01
    assert certain.mean() > 0.9
    assert (masked.covered() == (alpha >= 0.5))[certain].all()


@pytest.mark.once
def test_a_pack_with_alpha_says_what_is_covered(graphics: GraphicsContext) -> None:
    original, other = np.full((32, 32), 255, np.uint8), np.full((32, 32), 255, np.uint8)
    original[:16, :16], other[:, 16:] = 0, 0
    scene = scene_of(
        [MAP.quad(SIZE, 0, 0)], [Material("m", 0, WHITE, alpha_mode="mask")], [texture(32, 32, 1, original)]
    )
    own = material({"base": scene.textures[0].pixels, "alpha": other[..., None]}, cutoff=0.5)
    pack = encode([replace(own, pixel_hash=scene.textures[0].pixel_hash)], target=BitsTarget(8.0))
    renderer = Renderer(graphics, scene)
    seen = []
    for packs in ({}, {"pack": pack}, {}):
        renderer.set_packs(packs)
        renderer.render(ViewState(straight_camera(0), SIZE))
        seen.append(renderer.covered())
    renderer.release()
    sampler = Sampler()
    for alpha, found in ((original, seen[0]), (other, seen[1]), (original, seen[2])):
        shown = fetch(alpha[..., None] / 255.0, MAP.uv(SIZE), sampler, True)[:, 0].reshape(SIZE[::-1])
        certain = np.abs(shown - 0.5) > 0.2
        assert certain.mean() > 0.9
        assert (found == (shown >= 0.5))[certain].all()


BLENDS = (0.0, 0.2, 0.5, 0.9, 1.0)


@pytest.fixture(scope="module")
def plain(graphics: GraphicsContext) -> Iterator[Renderer]:
    """BLEND quads, two MASK quads without a texture, and one that is opaque with an alpha of 0."""
    materials = [Material("b", -1, (1.0, 1.0, 1.0, share), alpha_mode="blend") for share in BLENDS]
    materials += [Material("m", -1, (1.0, 1.0, 1.0, alpha), alpha_mode="mask") for alpha in (0.4, 0.6)]
    materials += [Material("o", 0, (1.0, 1.0, 1.0, 0.0))]
    quads = [MAP.quad(SIZE, layer, layer) for layer in range(len(materials))]
    renderer = Renderer(graphics, scene_of(quads, materials, [texture(8, 4, 1, EDGES)]))
    yield renderer
    renderer.release()


def covered(renderer: Renderer, layer: int) -> NDArray[np.bool_]:
    """[H, W] where the quad of a layer is seen."""
    renderer.render(ViewState(straight_camera(layer), SIZE))
    return renderer.covered()


@pytest.mark.parametrize("layer", range(len(BLENDS)))
def test_blend_covers_its_share_of_the_pixels(plain: Renderer, layer: int) -> None:
    assert covered(plain, layer).mean() == pytest.approx(BLENDS[layer], abs=0.03)


def test_a_mask_without_a_texture_goes_by_its_factor(plain: Renderer) -> None:
    assert not covered(plain, len(BLENDS)).any()
    assert covered(plain, len(BLENDS) + 1).all()


def test_an_opaque_material_ignores_alpha(plain: Renderer) -> None:
    assert covered(plain, len(BLENDS) + 2).all()
