"""Framebuffers are made once, not for every frame."""

from typing import Any
from unittest.mock import patch

import moderngl
import numpy as np
import pytest

from lab.bench.random_pack import random_pack
from tests.gl.small_scenes import FRONT, objects
from viewer.gl.context import GraphicsContext
from viewer.render.renderer import Renderer
from viewer.render.resources.color_target import ColorTarget
from viewer.state.navigation import turned
from viewer.state.view_state import REFERENCE, DecodePath, MaterialView, Slot, ViewState

SIZE = (60, 36)


@pytest.mark.parametrize("shown", ["base", "lit"])
@pytest.mark.parametrize(("source", "path"), [("p", "forward"), (REFERENCE, "deferred")])
def test_a_moving_view_makes_no_framebuffers(
    graphics: GraphicsContext, source: str, path: DecodePath, shown: MaterialView
) -> None:
    scene = objects()
    sizes = [(t.pixels.shape[1], t.pixels.shape[0]) for t in scene.textures]
    renderer = Renderer(graphics, scene)
    renderer.set_packs({"p": random_pack(sizes, (0, 1, 0, 1), hashes=[t.pixel_hash for t in scene.textures])})
    slot, made = Slot(source, path), list[object]()
    renderer.render(ViewState(FRONT, SIZE, slot, material_view=shown))

    def counted(own: moderngl.Context, *arguments: Any, **named: Any) -> moderngl.Framebuffer:
        made.append(arguments)
        return framebuffer(own, *arguments, **named)

    framebuffer = moderngl.Context.framebuffer
    with patch.object(moderngl.Context, "framebuffer", counted):
        for step in range(1, 4):
            renderer.render(ViewState(turned(FRONT, 0.01 * step), SIZE, slot, material_view=shown))
    assert not made
    renderer.release()


def test_another_depth_texture_gets_a_framebuffer_of_its_own(graphics: GraphicsContext) -> None:
    target, depths = ColorTarget(graphics, SIZE), [graphics.memory.depth_texture("depth", SIZE) for _ in range(2)]
    made = [target.framebuffer_with_depth(depth) for depth in (*depths, depths[1])]
    assert made[0] is not made[1]
    assert made[1] is made[2]
    made[2].clear(1.0, 0.5, 0.25, 1.0)
    np.testing.assert_array_equal(target.read()[0, 0], [1.0, 0.5, 0.25])
    target.release()
    for depth in depths:
        depth.release()
