"""Scenes and pictures at the edges: nothing to draw, no textures, no match, one pixel, vertex colours, all id bits."""

import numpy as np
import pytest

from lab.bench.random_pack import random_pack
from tests.support.picture_scenes import (
    WHITE,
    Part,
    PixelMap,
    scene_of,
    straight_camera,
    texture,
    texture_of,
)
from viewer.gl.context import GraphicsContext
from viewer.render.renderer import Renderer
from viewer.scene.model import Material, Scene
from viewer.state.view_state import EXACT_PATHS, Slot, ViewState

PATHS = EXACT_PATHS
MAP = PixelMap((0.0, 1.0), (1 / 16, 0.0), (0.0, -1 / 16))
SLOTS = (Slot(), *(Slot("p", path) for path in PATHS))


def drawn(graphics: GraphicsContext, scene: Scene, size: tuple[int, int], slots: tuple[Slot, ...] = (Slot(),)) -> list:
    """Linear pictures of the slots, looking straight at layer 0; the packs hold nothing of the scene."""
    renderer = Renderer(graphics, scene)
    renderer.set_packs({"p": random_pack([(8, 8)], (0,))})
    renderer.render(ViewState(straight_camera(), size, slots[0]))
    pictures = [renderer.picture(slot) for slot in slots]
    renderer.release()
    return pictures


def test_a_scene_without_anything(graphics: GraphicsContext) -> None:
    renderer = Renderer(graphics, scene_of([], []))
    frame = renderer.render(ViewState(straight_camera(), (33, 17)))
    assert frame.drawn["triangles"] == 0
    assert not renderer.covered().any()
    assert (renderer.texture_ids() == -1).all()
    assert not renderer.picture(Slot()).any()
    assert not np.frombuffer(frame.image.read(), np.uint8).reshape(-1, 4)[:, :3].any()
    renderer.release()


def test_a_scene_without_textures_shows_its_factors(graphics: GraphicsContext) -> None:
    scene = scene_of([MAP.quad((16, 16))], [Material("m", -1, (0.5, 0.25, 0.75, 1.0))])
    for picture in drawn(graphics, scene, (16, 16), SLOTS):
        assert np.allclose(picture, [0.5, 0.25, 0.75], atol=1e-6)


@pytest.mark.parametrize("size", [(1, 1), (33, 17), (9, 1), (1, 9)])
def test_pictures_of_odd_sizes_are_filled_to_the_edge(graphics: GraphicsContext, size: tuple[int, int]) -> None:
    scene = scene_of([MAP.quad(size)], [Material("m", 0, WHITE)], [texture(8, 8, 3)])
    for picture in drawn(graphics, scene, size, (Slot(), Slot("p"))):
        assert picture.shape == (size[1], size[0], 3)
        assert np.isfinite(picture).all()
        assert (picture.max(axis=2) > 0.0).all()


def test_what_the_pack_does_not_hold_shows_its_factor(graphics: GraphicsContext) -> None:
    images = [texture(8, 8, seed) for seed in (1, 2)]
    materials = [Material("absent", 0, (0.1, 0.2, 0.3, 1.0)), Material("there", 1, WHITE)]
    scene = scene_of([MAP.quad((16, 16), 0, 0), MAP.quad((16, 16), 1, 1)], materials, images)
    renderer = Renderer(graphics, scene)
    renderer.set_packs({"p": random_pack([(8, 8)], (0,), hashes=[images[1].pixel_hash])})
    assert renderer.matches["p"].texture_index == (-1, 0)
    for path in PATHS:
        slot = Slot("p", path)
        renderer.render(ViewState(straight_camera(0), (16, 16), slot))
        assert np.allclose(renderer.picture(slot), [0.1, 0.2, 0.3], atol=1e-6)
        renderer.render(ViewState(straight_camera(1), (16, 16), slot))
        assert renderer.picture(slot).std() > 0.05
        assert (renderer.texture_ids() == 1).all()
    renderer.release()


def test_vertex_colours_multiply_in_linear_light_on_all_paths(graphics: GraphicsContext) -> None:
    size = (32, 32)
    ramp = np.array([[0, 1, 0.5, 1], [1, 1, 0.5, 1], [1, 0, 0.5, 1], [0, 0, 0.5, 1]], np.float32)
    quad = MAP.quad(size)
    part = Part(0, quad.positions, quad.uvs, colors=ramp)
    scene = scene_of([part], [Material("m", -1, (1.0, 0.5, 1.0, 1.0))])
    at = (np.arange(32) + 0.5) / 32
    expected = np.stack(np.broadcast_arrays(at[None, :], 0.5 * at[:, None], 0.5), axis=-1)
    for picture in drawn(graphics, scene, size, SLOTS):
        # 10 bits a channel, evenly spaced under a square root.
        assert np.abs(picture - expected).max() <= 1.1e-3


def test_large_material_and_texture_numbers_are_kept_apart(graphics: GraphicsContext) -> None:
    images = [texture_of(np.full((2, 2, 3), index % 256, np.uint8)) for index in range(300)]
    materials = [Material(f"m{index}", index % 300, WHITE) for index in range(700)]
    scene = scene_of([MAP.quad((4, 4), 699)], materials, images)
    renderer = Renderer(graphics, scene)
    renderer.render(ViewState(straight_camera(), (4, 4)))
    assert (renderer.texture_ids() == 99).all()
    assert np.allclose(renderer.picture(Slot()), (((99 / 255 + 0.055) / 1.055) ** 2.4), atol=2e-3)
    renderer.release()
