"""Whole frames of both decode paths against the float64 codec at each pixel's own texture coordinate and lod."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np
import pytest
from numpy.typing import NDArray

from lab.bench.filtering import decode_filtered
from lab.bench.random_pack import random_pack
from ntc.codec.config import WrapMode
from ntc.codec.gpu import VariantName
from ntc.codec.mips import linear_to_srgb
from ntc.codec.model import Pack
from tests.support.picture_scenes import WHITE, PixelMap, scene_of, straight_camera, texture
from viewer.gl.context import GraphicsContext
from viewer.render.renderer import Renderer
from viewer.scene.model import Material, Sampler
from viewer.state.view_state import DecodePath, Precision, Slot, ViewState

SIZE = (48, 32)
SIZES = ((64, 64), (40, 24), (17, 33))
"""Of the textures in the pack; the scene's images are larger, as after `encode --texture-size`."""
TOLERANCE = 1e-4
"""In sRGB-coded [0, 1]."""


TRILINEAR = Sampler()
NEAREST = Sampler(magnify_linear=False, minify_linear=False, mipmap="nearest")


@dataclass(frozen=True)
class Case:
    """One full-screen quad."""

    map: PixelMap
    texture: int = 0
    wrap: tuple[WrapMode, WrapMode] = ("repeat", "repeat")
    sampler: Sampler = TRILINEAR
    """Filters; `wrap` holds for the modes."""


CASES = {
    "magnified": Case(PixelMap((0.1, 0.2), (1 / 256, 0.0), (0.0, -1 / 256))),
    "one texel a pixel": Case(PixelMap((0.0, 0.0), (1 / 64, 0.0), (0.0, 1 / 64))),
    "between levels, turned": Case(PixelMap((-0.3, 0.7), (3 / 128, 1 / 128), (-1 / 128, 5 / 256))),
    "lod 2, mirror and clamp": Case(PixelMap((-0.9, -0.4), (1 / 16, 0.0), (0.0, 1 / 32)), 0, ("mirror", "clamp")),
    "coarsest, far out": Case(PixelMap((-11.7, 3.1), (0.5, 0.0), (0.0, -0.25))),
    "not square": Case(PixelMap((0.4, -1.2), (5 / 256, 0.0), (1 / 128, 3 / 64)), 1, ("clamp", "repeat")),
    "odd sides": Case(PixelMap((-0.6, 1.9), (3 / 64, -1 / 64), (1 / 32, -7 / 128)), 2, ("mirror", "mirror")),
    "shrunk along y alone": Case(PixelMap((0.0, 0.0), (1 / 512, 0.0), (0.0, 7 / 64)), 2, ("repeat", "clamp")),
    "nearest texel": Case(PixelMap((-0.31, 0.62), (1 / 256, 1 / 512), (0.0, -1 / 256)), sampler=NEAREST),
    "nearest of a small mip": Case(PixelMap((0.01, 0.02), (1 / 16, 0.0), (0.0, 3 / 128)), 1, sampler=NEAREST),
    "no mips": Case(PixelMap((0.01, 0.02), (1 / 16, 0.0), (0.0, 3 / 128)), sampler=Sampler(mipmap="none")),
    "nearest mip": Case(PixelMap((0.01, 0.02), (3 / 64, 0.0), (0.0, 3 / 128)), sampler=Sampler(mipmap="nearest")),
    # 0.0371 and the others have no short binary form: the stored footprint is rounded.
    "any gradients": Case(PixelMap((0.2, 0.1), (0.0371, 0.0113), (-0.0057, 0.0219))),
}


@pytest.fixture(scope="module")
def pack() -> Pack:
    """Latents for all textures of the scene."""
    return random_pack(SIZES, (0, 1, 0), hashes=[texture(2 * w, 2 * h, w).pixel_hash for w, h in SIZES])


def renderer_of_cases(
    graphics: GraphicsContext, packs: Mapping[str, Pack], variant: VariantName | None = None
) -> Renderer:
    """All cases, one quad behind the other."""
    materials = [Material("m", case.texture, WHITE, replace(case.sampler, wrap=case.wrap)) for case in CASES.values()]
    parts = [case.map.quad(SIZE, layer, layer) for layer, case in enumerate(CASES.values())]
    images = [texture(2 * w, 2 * h, w) for w, h in SIZES]
    made = Renderer(graphics, scene_of(parts, materials, images), variant=variant)
    made.set_packs(packs)
    return made


@pytest.fixture(scope="module")
def renderer(graphics: GraphicsContext, pack: Pack) -> Iterator[Renderer]:
    made = renderer_of_cases(graphics, {"p": pack})
    yield made
    made.release()


def shown(renderer: Renderer, name: str, path: DecodePath, precision: Precision = "fp32") -> NDArray[np.float64]:
    """[H * W, 3] sRGB-coded picture of a case."""
    slot = Slot("p", path, precision)
    renderer.render(ViewState(straight_camera(list(CASES).index(name)), SIZE, slot))
    assert renderer.covered().all()
    pixels: NDArray[np.float64] = renderer.picture(slot).astype(np.float64)
    return np.asarray(linear_to_srgb(pixels).reshape(-1, 3), np.float64)


def expected(pack: Pack, name: str) -> NDArray[np.float64]:
    """[H * W, 3] what docs/reference/codecs.md says about a case."""
    case = CASES[name]
    lod = np.full(SIZE[0] * SIZE[1], case.map.lod(SIZES[case.texture]))
    sampler = replace(case.sampler, wrap=case.wrap)
    return decode_filtered(pack, case.texture, case.map.uv(SIZE), lod, sampler)


@pytest.mark.parametrize("path", ["deferred", "forward", "binned"])
@pytest.mark.parametrize("name", CASES)
def test_frames_agree_with_float64(renderer: Renderer, pack: Pack, name: str, path: DecodePath) -> None:
    assert np.abs(shown(renderer, name, path) - expected(pack, name)).max() <= TOLERANCE


@pytest.mark.parametrize("path", ["deferred", "forward", "binned"])
def test_half_float_weights_stay_close_in_a_frame(renderer: Renderer, pack: Pack, path: DecodePath) -> None:
    error = np.abs(shown(renderer, "odd sides", path, "fp16") - expected(pack, "odd sides")).max()
    assert 1e-5 < error <= 2e-3
