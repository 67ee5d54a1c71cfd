"""The cached path: hardware-filtered tiles of the float64 decode, decoded once, within a budget, kept while they hold."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache, partial

import numpy as np
import pytest
from numpy.typing import NDArray

from lab.bench.random_pack import random_block_pack, random_pack
from ntc.codec import reference
from ntc.codec.block.config import BlockConfig
from ntc.codec.config import WrapMode
from ntc.codec.latents import latent_levels
from ntc.codec.mips import srgb_to_linear
from ntc.codec.model import Pack
from ntc.errors import InputError
from tests.gl.render import test_frame_parity
from tests.gl.render.test_frame_parity import Case
from tests.gl.small_scenes import ABOVE, FRONT, INSIDE, objects, pack_of
from tests.support.picture_scenes import PixelMap, scene_of, straight_camera, texture
from tests.support.sampling import sample_chain
from viewer.gl.allocation import GpuMemory
from viewer.gl.context import GraphicsContext
from viewer.gl.texture_arrays import TileAtlas
from viewer.render.frames import FrameResult
from viewer.render.renderer import Renderer
from viewer.render.resources import layout
from viewer.render.resources.tile_cache import cache as tile_cache
from viewer.render.resources.tile_cache.budget import TileCacheConfig, TileCounts
from viewer.render.resources.tile_cache.cache import PAGE_BYTES
from viewer.scene.model import Camera, Material
from viewer.state.navigation import turned
from viewer.state.view_state import Anisotropy, DecodePath, Slot, ViewState

SIZE = (48, 32)
SIZES = ((150, 90), (40, 24), (17, 33), (64, 32))
"""Several tiles a side, a part of one, odd sides, and whole tiles."""
CORNERS = {"first": (-0.02, -0.03), "last": (0.98, 0.97), "tiles meet": (0.48, 0.97)}
"""Begins of magnified parts of a texture."""
WRAPS: tuple[tuple[WrapMode, WrapMode], ...] = (("repeat", "repeat"), ("mirror", "clamp"), ("clamp", "mirror"))
CASES = test_frame_parity.CASES | {
    f"{corner}, {wrap[0]} and {wrap[1]}, {SIZES[number][0]} texels": Case(
        PixelMap(begin, (1 / 1024, 0.0), (0.0, 1 / 512)), number, wrap
    )
    for (corner, begin), wrap in zip(CORNERS.items(), WRAPS, strict=True)
    for number in (2, 3)
}
CACHED = Slot("p", "cached")
STEP = 0.5 * 2.4 / 255.0
"""Half an 8-bit sRGB step in linear light where the curve is steepest."""
ELSEWHERE = 1e-3
"""A tile on another page is sampled at other coordinates, which are rounded elsewhere."""
HARDWARE = 4e-3
"""Drivers may round filter weights to 8 bits (OpenGL 4.3, Sec. 8.24)."""


SMALL_BLOCKS = BlockConfig(block_side=4, block_words=(1, 2), mean_words=1.5, coefficients=30, modes=8)
FOUR_MIPS = BlockConfig(block_words=(2, 16), mean_words=6.0, modes=8, coefficients=192, mips=4)
CODECS: dict[str, Callable[..., Pack]] = {
    "grid": random_pack,
    "block": random_block_pack,
    "block, 4x4 texels": partial(random_block_pack, config=SMALL_BLOCKS),
    "block, four mips": partial(random_block_pack, config=FOUR_MIPS),
}


@pytest.fixture(scope="module", params=CODECS)
def pack(request: pytest.FixtureRequest) -> Pack:
    """Latents for all textures, in every codec."""
    hashes = [texture(w, h, w).pixel_hash for w, h in SIZES]
    made: Pack = CODECS[request.param](SIZES, (0, 1, 0, 1), hashes=hashes)
    return made


@pytest.fixture(scope="module", params=["software", "gpu"], ids=["alone", "together"])
def renderer(request: pytest.FixtureRequest, graphics: GraphicsContext, pack: Pack) -> Iterator[Renderer]:
    """All cases, one quad behind the other; codes are decoded by each invocation, or by work groups."""
    if request.param == "gpu" and not isinstance(pack.config, BlockConfig):
        pytest.skip("decoded alone")
    materials = [
        Material("m", case.texture, (0.9, 1.0, 0.7, 1.0), replace(case.sampler, wrap=case.wrap))
        for case in CASES.values()
    ]
    parts = [case.map.quad(SIZE, layer, layer) for layer, case in enumerate(CASES.values())]
    made = Renderer(graphics, scene_of(parts, materials, [texture(w, h, w) for w, h in SIZES]), variant=request.param)
    made.set_packs({"p": pack})
    yield made
    made.release()


@cache
def decoded_mips(pack: Pack, texture: int, wrap: tuple[WrapMode, WrapMode]) -> list[NDArray[np.float64]]:
    """All mips of a texture by the float64 decode, in linear light."""
    levels = latent_levels(*SIZES[texture], pack.config)
    decode = partial(reference.decode_texels, pack, wrap=wrap)
    images = [reference.image_of_texels(pack, texture, level, decode) for level in range(len(levels))]
    return [np.asarray(srgb_to_linear(image / 255.0), np.float64) for image in images]


@pytest.mark.parametrize("name", CASES)
def test_frames_are_the_filtered_decode(renderer: Renderer, pack: Pack, name: str) -> None:
    case = CASES[name]
    size, chain = SIZES[case.texture], decoded_mips(pack, case.texture, case.wrap)
    renderer.render(ViewState(straight_camera(list(CASES).index(name)), SIZE, CACHED))
    assert renderer.covered().all()
    shown = renderer.picture(CACHED).reshape(-1, 3)
    sampler = replace(case.sampler, wrap=case.wrap)
    expected = sample_chain(chain, case.map.uv(SIZE), case.map.lod(size), sampler) * [0.9, 1.0, 0.7]
    error = np.abs(shown - expected)
    # A decoded number near the middle between two 8-bit steps may be rounded to either.
    assert error.max() <= 2 * STEP + HARDWARE
    assert error.mean() <= 1e-3


def render(renderer: Renderer, camera: Camera = FRONT, whole: bool = False) -> FrameResult:
    """A view by the cached path."""
    return renderer.render(ViewState(camera, (120, 72), CACHED), whole)


def counts(frame: FrameResult) -> TileCounts:
    """Of the only slot."""
    return frame.tiles[CACHED]


def picture(renderer: Renderer, camera: Camera = FRONT) -> NDArray[np.float32]:
    """What the cached path shows when all has come."""
    render(renderer, camera, whole=True)
    return renderer.picture(CACHED)


def opened(graphics: GraphicsContext, config: TileCacheConfig | None = None) -> Renderer:
    """The scene of objects with its pack."""
    scene = objects()
    made = Renderer(graphics, scene, tile_cache=config)
    made.set_packs({"p": pack_of(scene)})
    return made


def test_a_small_turn_decodes_only_what_comes_into_sight(graphics: GraphicsContext) -> None:
    renderer = opened(graphics)
    first = counts(render(renderer)).decoded
    moved = render(renderer, turned(FRONT, 0.5))
    assert counts(moved).decoded - first < 0.3 * first
    assert moved.skipped["tiles_kept"] == first
    back = render(renderer)
    assert counts(back).decoded == counts(moved).decoded
    renderer.release()


def test_missing_tiles_come_within_the_promised_frames(graphics: GraphicsContext) -> None:
    eager, patient = opened(graphics), opened(graphics, TileCacheConfig(milliseconds=0.0, least_tiles=2))
    truth = picture(eager)
    missing = counts(render(eager)).decoded
    # All that stand in for finer ones come with the first.
    first = counts(render(patient)).decoded
    assert first > 2
    frames = 2
    while not (frame := render(patient)).is_complete:
        frames += 1
        assert counts(frame).decoded == first + 2 * (frames - 2)
        assert frames <= missing
    assert frames <= -(-counts(frame).decoded // 2)
    np.testing.assert_allclose(patient.picture(CACHED), truth, atol=ELSEWHERE)
    for made in (eager, patient):
        made.release()


def test_a_coarser_tile_stands_in_for_a_missing_one_from_the_first_frame_on(graphics: GraphicsContext) -> None:
    patient = opened(graphics, TileCacheConfig(milliseconds=0.0, least_tiles=1))
    # `picture` would finish it: look at what the frame itself shows.
    image = np.frombuffer(render(patient).image.read(), np.uint8).reshape(72, 120, 4)[::-1, :, :3]
    whole = opened(graphics)
    full = np.frombuffer(render(whole).image.read(), np.uint8).reshape(72, 120, 4)[::-1, :, :3]
    textured = patient.texture_ids() >= 0
    assert np.array_equal(image[~textured], full[~textured])
    assert 0 < np.abs(image[textured].astype(int) - full[textured]).mean() < 80
    grey = np.all(image[textured] == 124, axis=1)
    assert not grey.any(), "what is shown where no tile is there"
    for made in (patient, whole):
        made.release()


def test_a_full_cache_lets_the_oldest_tiles_go_and_shows_the_same(graphics: GraphicsContext) -> None:
    plain = opened(graphics)
    cameras = (FRONT, INSIDE, replace(ABOVE, eye=(0.0, 90.0, 0.0)), FRONT)
    alone = [opened(graphics) for _ in cameras]
    needed = max(counts(render(one, camera)).decoded for one, camera in zip(alone, cameras, strict=True))
    small = opened(graphics, TileCacheConfig(budget_bytes=needed * PAGE_BYTES))
    for camera in cameras:
        np.testing.assert_allclose(picture(small, camera), picture(plain, camera), atol=ELSEWHERE)
        assert counts(render(small, camera)).resident <= needed
    assert counts(render(small)).evicted > 0
    for made in (plain, small, *alone):
        made.release()


def test_a_budget_below_what_is_seen_says_so_and_still_draws(graphics: GraphicsContext) -> None:
    renderer = opened(graphics, TileCacheConfig(budget_bytes=3 * PAGE_BYTES))
    for degrees in (0.0, 20.0, 0.0):
        frame = render(renderer, turned(FRONT, degrees))
        assert counts(frame).starved > 0
        assert frame.is_complete
        assert counts(frame).resident == 3
    assert np.isfinite(renderer.picture(CACHED)).all()
    renderer.release()


def test_more_missing_tiles_than_a_request_can_list(graphics: GraphicsContext, monkeypatch: pytest.MonkeyPatch) -> None:
    plain = opened(graphics)
    truth = picture(plain)
    monkeypatch.setattr(layout, "MAX_TILE_REQUESTS", 5)
    monkeypatch.setattr(tile_cache, "MAX_TILE_REQUESTS", 5)
    few = opened(graphics)
    np.testing.assert_allclose(picture(few), truth, atol=ELSEWHERE)
    assert counts(render(few)).waiting == 0
    for made in (plain, few):
        made.release()


@pytest.mark.parametrize("name", ["between levels, turned", "lod 2, mirror and clamp", "shrunk along y alone"])
def test_long_footprints_are_probed_along_their_longer_side(renderer: Renderer, pack: Pack, name: str) -> None:
    """After EXT_texture_filter_anisotropic."""
    case = CASES[name]
    most: Anisotropy = 4
    size = SIZES[case.texture]
    view = ViewState(straight_camera(list(CASES).index(name)), SIZE, CACHED, anisotropy=most)
    renderer.render(view)
    shown = renderer.picture(CACHED).reshape(-1, 3)
    sides = [np.array(side) for side in (case.map.per_x, case.map.per_y)]
    lengths = [float(np.linalg.norm(side * size)) for side in sides]
    count = min(int(np.ceil(max(lengths) / min(lengths) - 1e-4)), most)
    assert count > 1
    longer = sides[int(np.argmax(lengths))]
    offsets = [longer * (number / (count + 1) - 0.5) for number in range(1, count + 1)]
    chain = decoded_mips(pack, case.texture, case.wrap)
    sampler, lod = replace(case.sampler, wrap=case.wrap), float(np.log2(max(lengths) / count))
    probes = [sample_chain(chain, case.map.uv(SIZE) + offset, lod, sampler) for offset in offsets]
    error = np.abs(shown - np.mean(probes, axis=0) * [0.9, 1.0, 0.7])
    assert error.max() <= 2 * STEP + HARDWARE
    assert error.mean() <= 1e-3
    # Without it the picture is another.
    renderer.render(replace(view, anisotropy=1))
    assert np.abs(renderer.picture(CACHED).reshape(-1, 3) - shown).mean() > 5e-3


def test_a_gpu_without_memory_makes_the_cache_smaller(
    graphics: GraphicsContext, monkeypatch: pytest.MonkeyPatch
) -> None:
    plain = opened(graphics)
    needed = counts(render(plain)).decoded
    plain.release()
    # Pages of a layer are so few here that a second layer is asked for, and refused as a driver would.
    monkeypatch.setattr(tile_cache, "LAYER_PAGES", needed // 2)
    grow = TileAtlas.grow
    monkeypatch.setattr(TileAtlas, "grow", lambda atlas, layers: grow(atlas, layers) if layers <= 1 else False)
    renderer = opened(graphics)
    frame = render(renderer)
    assert counts(frame).out_of_memory
    assert counts(frame).resident == needed // 2
    assert counts(frame).starved > 0
    assert frame.is_complete
    assert np.isfinite(renderer.picture(CACHED)).all()
    monkeypatch.setattr(TileAtlas, "grow", lambda *_: False)
    none = opened(graphics)
    with pytest.raises(InputError, match="no memory for a tile cache"):
        render(none)
    for made in (renderer, none):
        made.release()


@pytest.mark.computes
@pytest.mark.parametrize("path", ["binned", "cached"])
def test_more_work_groups_than_fit_into_a_row_lie_in_several(graphics: GraphicsContext, path: DecodePath) -> None:
    """As with 65535 of them and a picture of more than 16 million pixels."""
    slot, pictures = Slot("p", path), []
    for across in (65535, 3):
        limits = replace(graphics.memory.limits, groups_across=across)
        made = Renderer(replace(graphics, memory=GpuMemory(graphics.gl, limits=limits)), objects())
        made.set_packs({"p": pack_of(made.scene)})
        made.render(ViewState(FRONT, (120, 72), slot), whole=True)
        pictures.append(made.picture(slot))
        made.release()
    np.testing.assert_allclose(pictures[1], pictures[0], atol=ELSEWHERE)
