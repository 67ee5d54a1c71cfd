"""`auto` times every path and takes the fastest; what it cannot run it leaves out."""

from dataclasses import replace

import numpy as np

from lab.bench.random_pack import random_block_pack
from tests.gl.small_scenes import FRONT, objects, pack_of
from viewer.gl.context import GraphicsContext
from viewer.gl.program import ShaderError
from viewer.render.path_choice import COMPUTING, PathTimes, time_paths
from viewer.render.renderer import Renderer
from viewer.state.view_state import EXACT_PATHS, Slot, ViewState

SLOT = Slot("p", "auto")
VIEW = ViewState(FRONT, (120, 72), SLOT)


def test_the_fastest_is_taken_on_small_pictures_of_a_turning_camera() -> None:
    seen: list[ViewState] = []
    cost: dict[str, float] = {"forward": 4.0, "deferred": 3.0, "binned": 1.0, "cached": 2.0}

    def slot_ms(view: ViewState) -> float:
        # The first picture of a path compiles, and says nothing.
        first = all(view.slot_a.path != other.slot_a.path for other in seen)
        seen.append(view)
        return 1000.0 / cost[view.slot_a.path] if first else cost[view.slot_a.path]

    times = time_paths(slot_ms, VIEW, SLOT)
    # A small picture's time counts for all pixels.
    assert dict(times.milliseconds) == {path: ms * (1 if path == "cached" else 16) for path, ms in cost.items()}
    assert times.fastest == "cached"
    assert {view.size for view in seen if view.slot_a.path != "cached"} == {(30, 18)}
    assert {view.size for view in seen if view.slot_a.path == "cached"} == {(120, 72)}
    assert len({(view.slot_a.path, view.camera) for view in seen}) == len(seen)


def test_a_path_that_does_not_run_is_left_out() -> None:
    def slot_ms(view: ViewState) -> float:
        if view.slot_a.path != "forward":
            raise ShaderError("too large")
        return 1.0

    assert time_paths(slot_ms, VIEW, SLOT).fastest == "forward"
    assert PathTimes({}).fastest == "deferred"


def test_pixels_are_not_sorted_where_they_share_no_weights(graphics: GraphicsContext) -> None:
    scene = objects()
    renderer = Renderer(graphics, scene)
    sizes = [(t.pixels.shape[1], t.pixels.shape[0]) for t in scene.textures]
    renderer.set_packs({"p": random_block_pack(sizes, (0, 1, 0, 1), hashes=[t.pixel_hash for t in scene.textures])})
    renderer.render(VIEW)
    times = renderer.paths.times(SLOT)
    assert times is not None
    assert "binned" not in times.milliseconds
    assert "forward" in times.milliseconds
    renderer.release()


def test_a_frame_is_drawn_by_the_path_that_was_chosen(graphics: GraphicsContext) -> None:
    scene = objects()
    renderer = Renderer(graphics, scene)
    renderer.set_packs({"p": pack_of(scene)})
    frame = renderer.render(VIEW)
    times = renderer.paths.times(SLOT)
    assert times is not None
    left_out = () if graphics.features.compute else COMPUTING
    assert set(times.milliseconds) == set(EXACT_PATHS) - set(left_out)
    assert frame.slot_ms[SLOT] > 0.0
    shown = renderer.picture(SLOT)
    np.testing.assert_array_equal(shown, renderer.picture(replace(SLOT, path=times.fastest)))
    again = renderer.render(VIEW)
    assert dict(again.timings_ms) == {}
    renderer.release()
