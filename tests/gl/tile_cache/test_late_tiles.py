"""Path `cached` where frames do not wait for the list of missing tiles: it comes to the same picture, whatever is in its way."""

from dataclasses import replace

import numpy as np
import pytest

from tests.gl.small_scenes import FRONT, objects, pack_of
from viewer.gl.context import GraphicsContext
from viewer.gl.read_back import Fence
from viewer.render.frames import FrameResult, read_picture
from viewer.render.renderer import Renderer
from viewer.render.resources.tile_cache import cache
from viewer.render.resources.tile_cache.budget import TileCacheConfig
from viewer.render.resources.tile_cache.cache import PAGE_BYTES
from viewer.state.navigation import turned
from viewer.state.view_state import Slot, ViewState

SIZE = (120, 72)
SLOT = Slot("p", "cached")
VIEW = ViewState(FRONT, SIZE, SLOT)
ASIDE = replace(VIEW, camera=turned(FRONT, 25.0))


def renderer(graphics: GraphicsContext, tiles: TileCacheConfig | None = None, waits: bool = False) -> Renderer:
    made = Renderer(replace(graphics, waits=waits), objects(), tile_cache=tiles)
    made.set_packs({"p": pack_of(objects(), 256)})
    return made


def settled(made: Renderer, view: ViewState) -> FrameResult:
    """The last frame of a view, once nothing is to come."""
    for _ in range(2000):
        made.tile_budget.note_frame(50.0)
        frame = made.render(view)
        if frame.is_complete:
            return frame
    raise AssertionError("the view does not come to rest")


def assert_same(made: Renderer, truth: Renderer, view: ViewState) -> FrameResult:
    frame = settled(made, view)
    expected = truth.render(view, whole=True)
    # Tiles lie on other pages, whose coordinates the hardware rounds.
    np.testing.assert_allclose(read_picture(frame.image), read_picture(expected.image), rtol=0, atol=1)
    return frame


def test_a_frame_with_little_time_and_a_list_with_little_room(
    graphics: GraphicsContext, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(cache, "LATE_TILE_REQUESTS", 3)
    made, truth = renderer(graphics, TileCacheConfig(milliseconds=1.0, least_tiles=1)), renderer(graphics, waits=True)
    for view in (VIEW, ASIDE, VIEW):
        assert_same(made, truth, view)
    made.release()
    truth.release()


def test_tiles_that_were_evicted_come_back(graphics: GraphicsContext) -> None:
    truth = renderer(graphics, waits=True)
    near = [replace(VIEW, camera=replace(turned(FRONT, degrees), fov_degrees=10.0)) for degrees in (-8.0, 0.0, 8.0)]
    needed = []
    for view in near:
        alone = renderer(graphics, waits=True)
        needed.append(alone.render(view, whole=True).tiles[SLOT].resident)
        alone.release()
    made = renderer(graphics, TileCacheConfig((max(needed) + 2) * PAGE_BYTES, 1.0, 2))
    for view in near:
        settled(made, view)
    # Once more, with answers under way when the view changes.
    for view in near:
        for _ in range(3):
            made.render(view)
    frame = assert_same(made, truth, near[1])
    counts = frame.tiles[SLOT]
    assert counts.evicted > 0
    assert counts.starved == 0
    made.release()
    truth.release()


def test_an_answer_that_is_late_holds_nothing_up(graphics: GraphicsContext, monkeypatch: pytest.MonkeyPatch) -> None:
    made, truth = renderer(graphics), renderer(graphics, waits=True)
    reached = Fence._wait
    monkeypatch.setattr(Fence, "_wait", lambda fence, nanoseconds: nanoseconds > 0 and reached(fence, nanoseconds))
    before = graphics.memory.blocking.count
    for number in range(5):
        frame = made.render(replace(VIEW, camera=turned(FRONT, 3.0 * number)))
        assert not frame.is_complete
    assert graphics.memory.blocking.count == before
    monkeypatch.undo()
    assert_same(made, truth, ASIDE)
    # A whole picture waits for the answer that is under way.
    made.render(VIEW)
    frame = made.render(replace(VIEW, camera=turned(FRONT, 9.0)), whole=True)
    assert frame.is_complete
    made.release()
    truth.release()
