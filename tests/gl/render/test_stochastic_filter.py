"""The stochastic filter: each sample is a texel of the footprint, their mean is what is filtered, and a view at rest stops drawing."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from lab.bench.filtering import filter_decoded, wrapped
from lab.bench.random_pack import random_block_pack, random_pack
from ntc.codec import reference
from ntc.codec.block.config import BlockConfig
from ntc.codec.latents import latent_levels
from ntc.codec.mips import linear_to_srgb, srgb_to_linear
from ntc.codec.model import Pack
from tests.gl.render.test_frame_parity import CASES, SIZE, SIZES, TOLERANCE, renderer_of_cases
from tests.gl.small_scenes import FRONT, objects
from tests.support import noise
from tests.support.noise import words
from tests.support.picture_scenes import straight_camera, texture
from viewer.gl.context import GraphicsContext
from viewer.render.frames import FrameResult
from viewer.render.renderer import Renderer
from viewer.render.resources.accumulator import SAMPLES
from viewer.state.navigation import turned
from viewer.state.view_state import Slot, ViewState

CONFIG = BlockConfig(block_words=(2, 3, 6), mean_words=3, modes=8, coefficients=60)
TRILINEAR = [name for name in CASES if not name.startswith("n")]
DEFERRED = Slot("p", "deferred", filter="stochastic")
WHOLE = (0, 0, *SIZE)


def pack_of(codec: str, sizes: tuple[tuple[int, int], ...], hashes: list[str], seed: int = 0) -> Pack:
    groups = tuple(number % 2 for number in range(len(sizes)))
    if codec == "block":
        return random_block_pack(sizes, groups, CONFIG, hashes, seed=seed)
    return random_pack(sizes, groups, hashes=hashes, seed=seed)


@pytest.fixture(scope="module", params=["grid", "block"])
def pack(request: pytest.FixtureRequest) -> Pack:
    """Latents for all textures, in either codec."""
    return pack_of(request.param, SIZES, [texture(2 * w, 2 * h, w).pixel_hash for w, h in SIZES])


@pytest.fixture(scope="module", params=["software", "gpu"], ids=["alone", "together"])
def renderer(request: pytest.FixtureRequest, graphics: GraphicsContext, pack: Pack) -> Iterator[Renderer]:
    """Codes are decoded by each pixel, or by work groups."""
    if request.param == "gpu" and not isinstance(pack.config, BlockConfig):
        pytest.skip("decoded alone")
    made = renderer_of_cases(graphics, {"p": pack}, request.param)
    yield made
    made.release()


def draw(renderer: Renderer, name: str, slot: Slot, whole: bool) -> NDArray[np.float64]:
    """[H * W, 3] linear: a case, as one sample or `whole`. What was drawn before does not count."""
    view = ViewState(straight_camera(list(CASES).index(name)), SIZE, slot)
    renderer.render(replace(view, slot_a=Slot()))
    renderer.render(view, whole)
    found = renderer.picture_in(slot, WHOLE)
    assert found is not None
    return found.reshape(-1, 3).astype(np.float64)


def chosen_texels(pack: Pack, name: str, number: int) -> NDArray[np.float64]:
    """[H * W, 3] float64: the texel that sample `number` takes for each pixel, by the twin of the noise."""
    case = CASES[name]
    levels = latent_levels(*SIZES[case.texture], pack.config)
    lod = float(np.clip(case.map.lod(SIZES[case.texture]), 0.0, len(levels) - 1.0))
    rows, columns = np.mgrid[: SIZE[1], : SIZE[0]]
    # OpenGL counts rows from the bottom.
    x, y = words(columns.ravel()), words(SIZE[1] - 1 - rows.ravel())
    threshold = noise.filter_threshold(x, y, np.full_like(x, number))
    coarser, threshold, limit = noise.second_taken(threshold, np.zeros_like(x), np.full_like(x, int(lod % 1.0 * 2**32)))
    at = int(lod) + coarser
    size = np.array([(level.texel_width, level.texel_height) for level in levels])[at]
    centres = np.empty((len(x), 2))
    for axis, uv in enumerate(case.map.uv(SIZE).T):
        mode = case.wrap[axis]
        mirrored = np.abs(uv - 2.0 * np.rint(uv / 2.0))
        folded = uv % 1.0 if mode == "repeat" else mirrored if mode == "mirror" else np.clip(uv, 0.0, 1.0)
        place = folded * size[:, axis] - 0.5
        second, threshold, limit = noise.second_taken(threshold, limit, words(place % 1.0 * 2**32))
        texel = wrapped(np.floor(place).astype(np.int64) + second, size[:, axis], mode)
        centres[:, axis] = (texel + 0.5) / size[:, axis]
    return reference.decode_texels(pack, case.texture, centres, at.astype(np.float64), case.wrap)


@pytest.mark.driver
@pytest.mark.parametrize("name", TRILINEAR)
def test_the_texel_is_that_of_the_noise(renderer: Renderer, pack: Pack, name: str) -> None:
    shown = linear_to_srgb(draw(renderer, name, Slot("p", "forward", filter="stochastic"), whole=False))
    expected = chosen_texels(pack, name, 0)
    # Where a share is the threshold but for rounding, another one may be taken.
    assert (np.abs(expected - shown).max(-1) <= 2 * TOLERANCE).mean() >= 0.99


@pytest.mark.parametrize("name", TRILINEAR)
def test_samples_approach_the_filtered_texels(renderer: Renderer, pack: Pack, name: str) -> None:
    case = CASES[name]
    lod = np.full(SIZE[0] * SIZE[1], case.map.lod(SIZES[case.texture]))
    sampler = replace(case.sampler, wrap=case.wrap)
    expected = srgb_to_linear(filter_decoded(pack, case.texture, case.map.uv(SIZE), lod, sampler))
    one = draw(renderer, name, DEFERRED, whole=False) - expected
    mean = draw(renderer, name, DEFERRED, whole=True) - expected
    assert np.abs(mean.mean(0)).max() <= 0.01
    assert np.sqrt(np.mean(mean**2)) <= np.sqrt(np.mean(one**2)) / 4.0 + 1e-4


def opened(graphics: GraphicsContext, codec: str = "block") -> Renderer:
    """The scene of objects with its pack."""
    made = Renderer(graphics, objects())
    made.set_packs({"p": pack_of_objects(codec)})
    return made


def pack_of_objects(codec: str, seed: int = 0) -> Pack:
    textures = objects().textures
    sizes = tuple((t.pixels.shape[1], t.pixels.shape[0]) for t in textures)
    return pack_of(codec, sizes, [t.pixel_hash for t in textures], seed)


def frame(renderer: Renderer, slot: Slot = DEFERRED, degrees: float = 0.0) -> FrameResult:
    """A view, turned by so much."""
    return renderer.render(ViewState(turned(FRONT, degrees), (120, 72), slot))


@pytest.mark.computes
def test_a_view_at_rest_gathers_samples_and_then_draws_nothing(graphics: GraphicsContext) -> None:
    renderer = opened(graphics)
    for number in range(1, SAMPLES + 1):
        drawn = frame(renderer)
        assert drawn.samples == {DEFERRED: number}
        assert sum(item.left for item in drawn.pending) == SAMPLES - number
        assert "decode_deferred" in drawn.timings_ms
    rest = frame(renderer)
    assert "decode_deferred" not in rest.timings_ms
    assert "composite" not in rest.timings_ms
    gathered = renderer.picture(DEFERRED)
    # Another view begins anew, and all samples at once are the same picture.
    assert frame(renderer, degrees=1.0).samples == {DEFERRED: 1}
    renderer.render(ViewState(FRONT, (120, 72), DEFERRED), whole=True)
    np.testing.assert_array_equal(renderer.picture(DEFERRED), gathered)
    renderer.release()


def test_tiles_and_the_reference_are_filtered_as_ever(graphics: GraphicsContext) -> None:
    renderer = opened(graphics)
    for slot in (Slot("p", "cached"), Slot()):
        frame(renderer, slot)
        expected = renderer.picture(slot)
        other = replace(slot, filter="stochastic")
        assert frame(renderer, other).samples == {}
        np.testing.assert_array_equal(renderer.picture(other), expected)
    renderer.release()
