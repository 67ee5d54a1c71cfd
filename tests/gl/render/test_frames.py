"""Frames of the renderer: what is skipped, what is redrawn, what times are reported, how A and B are put together."""

from collections.abc import Iterator
from dataclasses import replace

import moderngl
import numpy as np
import pytest
from numpy.typing import NDArray

from lab.bench.random_pack import random_pack
from ntc.codec.model import Pack
from tests.support.picture_scenes import WHITE, cube, placed, scene_of, texture
from viewer.gl.context import GraphicsContext
from viewer.gl.program import ShaderLibrary
from viewer.render.frames import FrameResult
from viewer.render.path_choice import drawable_paths
from viewer.render.renderer import Renderer
from viewer.scene.model import Camera, Material
from viewer.state.view_state import Overlay, Slot, ViewState

SIZE = (64, 40)
CAMERA = Camera("front", (0.0, 0.5, 5.0), (0.0, 0.0, 0.0))
ASIDE = Camera("aside", (-3.0, 0.0, 3.0), (-3.0, 0.0, 0.0))
TEXTURES = (texture(32, 32, 1), texture(16, 8, 2))
DEFERRED, FORWARD = Slot("p", "deferred"), Slot("p", "forward")
VIEW = ViewState(CAMERA, SIZE, Slot(), DEFERRED, "wipe", 0.5)
PASSES = {"visibility", "upload", "reference", "decode_deferred", "decode_forward", "composite"}


def pack(seed: int = 0) -> Pack:
    """A pack of both textures."""
    hashes = [image.pixel_hash for image in TEXTURES]
    return random_pack([(32, 32), (16, 8)], (0, 1), hashes=hashes, seed=seed)


@pytest.fixture(scope="module")
def shared(graphics: GraphicsContext) -> Iterator[Renderer]:
    """Two cubes with a texture each, the second one only seen from aside."""
    parts = [cube(0, placed(1.0)), cube(1, placed(-12.0))]
    renderer = Renderer(graphics, scene_of(parts, [Material(f"m{i}", i, WHITE) for i in (0, 1)], TEXTURES))
    yield renderer
    renderer.release()


@pytest.fixture
def renderer(shared: Renderer) -> Renderer:
    """The renderer, its last frame forgotten."""
    shared.set_packs({})
    shared.set_packs({"p": pack()})
    shared.render(ViewState(ASIDE, (8, 8)))
    return shared


def passes(frame: FrameResult) -> set[str]:
    """The passes that ran."""
    return PASSES & frame.timings_ms.keys()


def picture(frame: FrameResult) -> NDArray[np.uint8]:
    """[H, W, 3] uint8, row 0 on top."""
    pixels = np.frombuffer(frame.image.read(), np.uint8).reshape(frame.image.height, frame.image.width, 4)
    return pixels[::-1, :, :3]


@pytest.mark.computes
def test_a_first_frame_runs_what_it_needs_and_says_how_it_was_timed(
    renderer: Renderer, graphics: GraphicsContext
) -> None:
    frame = renderer.render(VIEW)
    assert passes(frame) >= {"visibility", "reference", "decode_deferred", "composite"}
    assert "decode_forward" not in frame.timings_ms
    assert all(0.0 <= time < 60e3 for time in frame.timings_ms.values())
    assert (frame.timer == "wall time around finish") == graphics.info.is_software
    assert frame.drawn["triangles"] == 12
    assert frame.drawn["commands"] == 1


def test_the_same_view_again_runs_no_pass(renderer: Renderer) -> None:
    first = picture(renderer.render(VIEW))
    again = renderer.render(VIEW)
    assert passes(again) == set()
    assert again.skipped["passes"] == 7, "culling, visibility, images, reference, latents, decoding, composite"
    assert np.array_equal(picture(again), first)


@pytest.mark.computes
def test_another_size_draws_all(renderer: Renderer) -> None:
    renderer.render(VIEW)
    frame = renderer.render(replace(VIEW, size=(33, 17)))
    assert passes(frame) >= {"visibility", "reference", "decode_deferred", "composite"}
    assert frame.image.size == (33, 17)


@pytest.mark.computes
def test_a_replaced_pack_is_drawn_again(renderer: Renderer) -> None:
    before = picture(renderer.render(VIEW))
    renderer.set_packs({"p": pack(seed=5)})
    frame = renderer.render(VIEW)
    assert passes(frame) == {"decode_deferred", "composite"}
    changed = (picture(frame) != before).any(axis=2)
    assert not changed[:, : SIZE[0] // 2].any()
    assert changed[:, SIZE[0] // 2 :].mean() > 0.1


def test_packs_of_one_codec_share_their_programs(renderer: Renderer, monkeypatch: pytest.MonkeyPatch) -> None:
    renderer.render(VIEW)
    monkeypatch.setattr(ShaderLibrary, "assemble", lambda *arguments: pytest.fail("compiles again"))
    renderer.set_packs({"p": pack(seed=6), "q": pack(seed=7)})
    renderer.render(VIEW)
    renderer.render(replace(VIEW, slot_b=Slot("q")))


def test_the_reference_is_one_picture_whatever_the_path(renderer: Renderer) -> None:
    reference = Slot("reference", "forward", "fp16")
    frame = renderer.render(replace(VIEW, slot_b=reference))
    assert passes(frame) == {"visibility", "upload", "reference", "composite"}
    assert np.array_equal(renderer.picture(reference), renderer.picture(Slot()))
    assert passes(renderer.render(replace(VIEW, slot_a=reference, slot_b=Slot()))) == set()


@pytest.mark.computes
def test_the_time_of_a_slot_is_that_of_drawing_it_again_and_no_frame_draws_more_for_it(
    renderer: Renderer, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = picture(renderer.render(VIEW))
    spent = iter((40.0, 2.0, 3.0, 200.0, 600.0))
    monkeypatch.setattr(renderer._timer, "take_owned", lambda: {"plane": next(spent)})
    assert renderer.drawing_ms(DEFERRED) == 3.0, "the median of three: one may have been disturbed"
    assert renderer.drawing_ms(DEFERRED) == 400.0, "a slow machine draws fewer"
    monkeypatch.undo()
    assert renderer.drawing_ms(DEFERRED) > 0.0
    assert renderer.drawing_ms(Slot()) > 0.0
    frame = renderer.render(VIEW)
    assert passes(frame) == set()
    assert np.array_equal(picture(frame), before)


def test_divergence_is_counted_only_while_it_is_shown(renderer: Renderer) -> None:
    hidden = renderer.render(VIEW)
    assert "divergence" not in hidden.timings_ms
    assert hidden.skipped["divergence_passes"] == 1
    shown = renderer.render(replace(VIEW, overlay=Overlay("divergence")))
    assert shown.divergence["p"].maximum == 1
    assert passes(shown) == {"composite"}
    for overlay in (Overlay("divergence", opacity=0.3), Overlay("divergence", palette="viridis")):
        again = renderer.render(replace(VIEW, overlay=overlay))
        assert "divergence" not in again.timings_ms
        assert passes(again) == {"composite"}
    other_blocks = renderer.render(replace(VIEW, overlay=Overlay("divergence", block="4x4")))
    assert "divergence" in other_blocks.timings_ms


def test_what_was_prepared_compiles_nothing_and_changes_no_picture(
    graphics: GraphicsContext, renderer: Renderer, monkeypatch: pytest.MonkeyPatch
) -> None:
    renderer.render(VIEW)
    before = renderer.picture(VIEW.slot_a)
    modes = [Slot("p", path, "fp16") for path in drawable_paths(graphics)]
    assert all(renderer.prepare(mode) for mode in modes)
    assert not any(renderer.prepare(mode) for mode in (*modes, VIEW.slot_a, Slot(), Slot("absent")))
    assert passes(renderer.render(VIEW)) == set()
    np.testing.assert_array_equal(renderer.picture(VIEW.slot_a), before)
    compiled: list[str] = []
    for name in ("compute_shader", "program"):
        monkeypatch.setattr(moderngl.Context, name, lambda *given, name=name, **named: compiled.append(name))
    for mode in modes:
        renderer.render(replace(VIEW, slot_b=mode, compare="wipe"))
    assert compiled == []
