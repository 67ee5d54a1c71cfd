"""A renderer that does not wait for the GPU: nothing is read back in motion that is not there, and at rest it shows the same."""

import time
from collections.abc import Iterator
from dataclasses import replace
from typing import get_args

import numpy as np
import pytest

from tests.gl.small_scenes import FRONT, objects, pack_of
from tests.support.blocking_watch import watched_calls
from viewer.gl.context import GraphicsContext
from viewer.render.frames import FrameResult, read_picture
from viewer.render.renderer import Renderer
from viewer.state.navigation import turned
from viewer.state.view_state import EXACT_PATHS, DecodePath, Overlay, Slot, TexelFilter, ViewState

SIZE = (120, 72)
SIDE = 256
"""Of the pack's textures: larger than what is seen of them, so that not all of their latents are needed."""
MOVES = 12


def renderer_of(graphics: GraphicsContext, waits: bool) -> Renderer:
    scene = objects()
    made = Renderer(replace(graphics, waits=waits), scene)
    made.set_packs({"p": pack_of(scene, SIDE)})
    return made


def settled(renderer: Renderer, view: ViewState) -> FrameResult:
    """The last frame of a view, once nothing is to come."""
    for _ in range(1000):
        frame = renderer.render(view)
        if frame.is_complete:
            return frame
    raise AssertionError("the view does not come to rest")


@pytest.fixture
def late(graphics: GraphicsContext) -> Iterator[Renderer]:
    made = renderer_of(graphics, waits=False)
    yield made
    made.release()


@pytest.fixture
def exact(graphics: GraphicsContext) -> Iterator[Renderer]:
    made = renderer_of(graphics, waits=True)
    yield made
    made.release()


@pytest.mark.parametrize(("path", "texel_filter"), zip(EXACT_PATHS, get_args(TexelFilter) * 2, strict=True))
def test_a_view_at_rest_is_the_same_picture(
    late: Renderer,
    exact: Renderer,
    path: DecodePath,
    texel_filter: TexelFilter,
) -> None:
    slot = Slot("p", path, filter=texel_filter)
    for number in range(3):
        view = ViewState(turned(FRONT, 20.0 * number), SIZE, slot, overlay=Overlay("divergence", opacity=0.3))
        frame, expected = settled(late, view), settled(exact, view)
        # Tiles lie on other pages, and so at other places of the atlas, whose coordinates the hardware rounds.
        step = int(path == "cached")
        np.testing.assert_allclose(read_picture(frame.image), read_picture(expected.image), rtol=0, atol=step)
        np.testing.assert_allclose(late.picture(slot), exact.picture(slot), rtol=0, atol=step / 256)
        assert frame.divergence == expected.divergence


@pytest.mark.parametrize("path", EXACT_PATHS)
def test_nothing_waits_while_the_camera_moves(graphics: GraphicsContext, path: DecodePath) -> None:
    with watched_calls() as calls:
        renderer = renderer_of(graphics, waits=False)
        view = ViewState(FRONT, SIZE, Slot("p", path), overlay=Overlay("divergence"))
        settled(renderer, view)
        calls.clear()
        frames = [renderer.render(replace(view, camera=turned(FRONT, 2.0 * (n + 1)))) for n in range(MOVES)]
        assert calls == []
        assert [frame.blocking_calls for frame in frames] == [0] * MOVES
        known = [frame.timings_ms for frame in frames]
        end = time.monotonic() + 20.0
        while not any(known) and time.monotonic() < end:
            known.append(renderer.take_times())
        assert any(f"decode_{path}" in times for times in known)
        renderer.release()
