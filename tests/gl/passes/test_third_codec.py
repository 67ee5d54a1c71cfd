"""A codec that the registry gets from tests, whose shader lies outside shaders/ and whose decoders hold nothing, on all paths."""

from collections.abc import Iterator
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from ntc.codec import reference
from ntc.codec.latents import latent_levels
from ntc.codec.maps import MAPS
from ntc.codec.mips import srgb_to_linear
from ntc.codec.model import Pack
from ntc.codec.textures import SourceTexture, hash_pixels
from tests.gl.render.test_frame_parity import CASES, SIZE, SIZES, TOLERANCE, expected, renderer_of_cases, shown
from tests.gl.tile_cache.test_decode_cached import HARDWARE, STEP
from tests.support.packs.parity import largest_difference
from tests.support.picture_scenes import texture
from tests.support.sampling import sample_chain
from tests.support.two_colors import encoded, registered
from viewer.gl.context import GraphicsContext
from viewer.render.passes.decode_texels import GlTexelDecoder
from viewer.render.renderer import Renderer
from viewer.state.view_state import DecodePath


def noise(width: int, height: int, channels: int) -> SourceTexture:
    pixels = np.random.default_rng(width).integers(0, 256, (height, width, channels), np.uint8)
    return SourceTexture(f"noise {width}", pixels, hash_pixels(pixels))


@pytest.fixture(scope="module")
def pack() -> Iterator[Pack]:
    """Of textures of noise for those of the scene."""
    hashes = [texture(2 * w, 2 * h, w).pixel_hash for w, h in SIZES]
    with registered():
        yield encoded(
            [replace(noise(w, h, 3), pixel_hash=found) for (w, h), found in zip(SIZES, hashes, strict=True)], (0, 1, 0)
        )


@pytest.fixture(scope="module")
def renderer(graphics: GraphicsContext, pack: Pack) -> Iterator[Renderer]:
    made = renderer_of_cases(graphics, {"p": pack})
    yield made
    made.release()


@pytest.mark.computes
def test_texels_of_all_maps_agree_with_float64(graphics: GraphicsContext, pack: Pack) -> None:
    random = np.random.default_rng(1)
    uv, lod = random.uniform(-2.0, 3.0, (400, 2)).astype(np.float32), random.uniform(-1.0, 8.0, 400).astype(np.float32)
    own = encoded([replace(noise(30, 17, 12), maps=MAPS), noise(9, 40, 1)], (0, 0))
    for one in (pack, own):
        decoder = GlTexelDecoder(graphics, one)
        for index in range(len(one.textures)):
            assert largest_difference(one, decoder.decode_texels, index, uv, lod, ("mirror", "clamp")) <= TOLERANCE
        decoder.release()


@pytest.mark.parametrize("path", ["deferred", "forward", "binned"])
@pytest.mark.parametrize("name", CASES)
def test_frames_agree_with_float64(renderer: Renderer, pack: Pack, name: str, path: DecodePath) -> None:
    assert np.abs(shown(renderer, name, path) - expected(pack, name)).max() <= TOLERANCE


@pytest.mark.parametrize("name", CASES)
def test_cached_tiles_are_the_filtered_decode(renderer: Renderer, pack: Pack, name: str) -> None:
    case = CASES[name]
    decode = partial(reference.decode_texels, pack, wrap=case.wrap)
    levels = range(len(latent_levels(*SIZES[case.texture], pack.config)))
    images = [reference.image_of_texels(pack, case.texture, level, decode) for level in levels]
    chain = [srgb_to_linear(image / 255.0) for image in images]
    sampled = sample_chain(
        chain, case.map.uv(SIZE), case.map.lod(SIZES[case.texture]), replace(case.sampler, wrap=case.wrap)
    )
    error = np.abs(srgb_to_linear(shown(renderer, name, "cached")) - sampled)
    assert error.max() <= 2 * STEP + HARDWARE
