"""Path on-load: what it shows, over several frames or at once, after a training, and what it leaves out."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from lab.bench.random_pack import random_pack
from ntc.codec.maps import MAPS
from ntc.codec.model import Pack
from ntc.errors import InputError
from tests.gl.small_scenes import FRONT, objects
from viewer.gl.context import GraphicsContext
from viewer.render.frames import FrameResult
from viewer.render.path_choice import unsupported_paths
from viewer.render.renderer import Renderer
from viewer.render.resources.load_plan import PIECE_TILES, LoadPlan, StoredPart, stored_parts
from viewer.render.resources.tile_cache.budget import TileCacheConfig
from viewer.scene.model import Camera
from viewer.state.view_state import Anisotropy, Slot, ViewState

pytestmark = pytest.mark.gl
SIZE = (96, 64)
SLOT = Slot("p", "on-load")
VIEW = ViewState(FRONT, SIZE, SLOT)
SIDES = ((64, 64), (72, 40), (33, 70), (64, 64))
"""Sizes in texels of the pack's textures: some have blocks and tiles over the edge."""
LEAST = TileCacheConfig(milliseconds=0.001, least_tiles=1)
"""Budget of a frame: one piece."""


def pack_of(seed: int = 0) -> Pack:
    hashes = [own.pixel_hash for own in objects().textures]
    return random_pack(SIDES, (0, 1, 0, 1), hashes=hashes, seed=seed)


def renderer_of(graphics: GraphicsContext, waits: bool = True, tiles: TileCacheConfig | None = None) -> Renderer:
    made = Renderer(replace(graphics, waits=waits), objects(), tile_cache=tiles)
    made.set_packs({"p": pack_of()})
    return made


@pytest.fixture(scope="module")
def renderer(graphics: GraphicsContext) -> Iterator[Renderer]:
    made = renderer_of(graphics)
    yield made
    made.release()


def settled(renderer: Renderer, view: ViewState = VIEW) -> list[FrameResult]:
    """The frames of a view, until nothing is to come."""
    frames = []
    for _ in range(200):
        frames.append(renderer.render(view))
        if frames[-1].is_complete:
            return frames
    raise AssertionError("the view does not come to rest")


def test_maps_are_stored_in_the_formats_that_suit_them() -> None:
    assert stored_parts("base", MAPS, 11) == (StoredPart("bc7", range(4)),)
    assert stored_parts("surface", MAPS, 11) == (StoredPart("bc5", range(2)), StoredPart("bc5", range(2, 4)))
    assert stored_parts("emission", MAPS, 11) == (StoredPart("bc7", range(3)), StoredPart("bc4", range(3, 4)))
    assert stored_parts("surface", ("base", "metalness"), 4) == (StoredPart("bc4", range(3, 4)),)
    assert stored_parts("emission", ("base", "normal"), 5) == ()


@pytest.mark.computes
def test_pieces_cover_each_mip_once_and_coarse_ones_come_first(renderer: Renderer) -> None:
    pack = random_pack([(2048, 1100), *SIDES[1:]], (0, 1, 0, 1), hashes=[own.pixel_hash for own in objects().textures])
    plan = LoadPlan.of(renderer.scene.materials, pack, renderer.matches["p"], "base")
    key = plan.keys[0]
    pieces = plan.pieces(key)
    assert [piece.level for piece in pieces] == sorted((piece.level for piece in pieces), reverse=True)
    for number, level in enumerate(plan.levels[key.texture]):
        own = [piece for piece in pieces if piece.level == number]
        assert sum(piece.texels for piece in own) == level.texel_width * level.texel_height
        assert all(piece.tiles <= PIECE_TILES for piece in own)
        assert [piece.top for piece in own] == list(np.cumsum([0, *(piece.rows for piece in own)])[:-1])


@pytest.mark.driver
@pytest.mark.computes
@pytest.mark.parametrize(("anisotropy", "most"), [(1, 0.035), (8, 0.1)])
def test_it_shows_what_path_cached_shows_but_for_the_loss_of_compression(
    renderer: Renderer, anisotropy: Anisotropy, most: float
) -> None:
    """The texels are noise. Anisotropic filters are the driver's own."""
    frame = renderer.render(replace(VIEW, anisotropy=anisotropy))
    cached, found = renderer.picture(replace(SLOT, path="cached")), renderer.picture(SLOT)
    assert found.std() > 0.05
    assert np.abs(found - cached).mean() < most
    counts = frame.loads[SLOT]
    assert counts.waiting == 0
    assert counts.texels > sum(width * height for width, height in SIDES)
    assert counts.bytes >= counts.texels
    assert counts.psnr_db is not None
    assert counts.psnr_db > 18.0
    assert frame.skipped["textures_not_compressed"] == frame.skipped["mips_not_compressed"] == 0
    memory = renderer.memory(SLOT)
    assert memory is not None
    assert memory.parts["compressed textures"] == counts.bytes
    assert memory.idle > 0


@pytest.mark.computes
def test_a_frame_compresses_a_share_and_the_coarse_mips_of_all_textures_first(
    graphics: GraphicsContext, renderer: Renderer
) -> None:
    late = renderer_of(graphics, waits=False, tiles=LEAST)
    frames = settled(late)
    assert len(frames) > 3
    assert not frames[0].is_complete
    assert any("being compressed" in item.line for item in frames[0].pending)
    waiting = [frame.loads[SLOT].waiting for frame in frames]
    assert waiting == sorted(waiting, reverse=True)
    renderer.render(VIEW)
    np.testing.assert_array_equal(late.picture(SLOT), renderer.picture(SLOT))
    late.release()
    # The first frame shows all textures, blurred.
    coarse = renderer_of(graphics, waits=False, tiles=LEAST)
    coarse.render(VIEW)
    first = coarse._packs.on_gpu(SLOT).loads
    assert first is not None
    assert first.textures == 4
    assert first.mips_left_out < 4 * 3
    whole = coarse.render(VIEW, whole=True)
    assert whole.is_complete
    np.testing.assert_array_equal(coarse.picture(SLOT), renderer.picture(SLOT))
    coarse.release()


@pytest.mark.computes
def test_a_trained_pack_is_compressed_anew(graphics: GraphicsContext) -> None:
    renderer, fresh = renderer_of(graphics), renderer_of(graphics)
    renderer.render(VIEW)
    before = renderer.picture(SLOT)
    old, other = pack_of(), pack_of(5)
    newer = replace(
        old,
        textures=tuple(other.textures[i] if i % 2 else own for i, own in enumerate(old.textures)),
        decoders=(old.decoders[0], other.decoders[1]),
    )
    renderer.update_pack("p", newer)
    frame = renderer.render(VIEW, whole=True)
    assert frame.timings_ms["compress"] > 0.0
    fresh.set_packs({"p": newer})
    fresh.render(VIEW)
    np.testing.assert_array_equal(renderer.picture(SLOT), fresh.picture(SLOT))
    assert np.abs(renderer.picture(SLOT) - before).max() > 0.05
    assert "compress" not in renderer.render(VIEW).timings_ms
    renderer.release()
    fresh.release()


@pytest.mark.computes
def test_textures_out_of_sight_and_packs_without_textures_cost_nothing(graphics: GraphicsContext) -> None:
    renderer = renderer_of(graphics)
    away = Camera("away", (0.0, 50.0, 0.0), (0.0, 60.0, 0.0), up=(1.0, 0.0, 0.0))
    frame = renderer.render(replace(VIEW, camera=away))
    assert frame.skipped["textures_not_compressed"] == 4
    assert frame.loads[SLOT].bytes == 0
    renderer.set_packs({"p": random_pack([(8, 8)], (0,))})
    renderer.render(VIEW)
    shown = renderer.picture(SLOT)
    np.testing.assert_array_equal(shown, renderer.picture(replace(SLOT, path="cached")))
    renderer.release()


def test_a_driver_without_compute_shaders_is_told_so(graphics: GraphicsContext) -> None:
    drawing = replace(graphics, features=replace(graphics.features, compute=False, weights_in_image=True))
    assert "BC7" in unsupported_paths(drawing)["on-load"]
    renderer = renderer_of(drawing)
    with pytest.raises(InputError, match="on-load needs compute shaders"):
        renderer.render(VIEW)
    renderer.release()
