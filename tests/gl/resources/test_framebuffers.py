"""Framebuffers are made once, not for every frame."""

from typing import Any
from unittest.mock import patch

import moderngl
import pytest

from lab.bench.random_pack import random_pack
from tests.gl.small_scenes import FRONT, objects
from viewer.gl.context import GraphicsContext
from viewer.render.renderer import Renderer
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
