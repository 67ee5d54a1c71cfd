"""The reference path shows the images as glTF says: orientation, wrap modes, filters, mips, colour."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product
from typing import Literal

import numpy as np
import pytest
from numpy.typing import NDArray

from ntc.codec.config import WrapMode
from ntc.codec.mips import srgb_to_linear
from tests.support.picture_scenes import WHITE, PixelMap, scene_of, straight_camera, texture
from tests.support.sampling import sample
from viewer.gl.context import GraphicsContext
from viewer.render.renderer import Renderer
from viewer.scene.model import Material, Sampler, SceneTexture
from viewer.state.view_state import Anisotropy, ViewState

SIZE = (32, 24)
SRGB_TOLERANCE = 2e-3
"""Drivers may round the decoded sRGB texels and their filter weights to 8 bits and a little more (OpenGL 4.3, Sec. 8.24)."""
WRAPS: tuple[WrapMode, ...] = ("repeat", "mirror", "clamp")
TEXTURES: dict[str, SceneTexture] = {
    "16x16": texture(16, 16, 1),
    "16x8": texture(16, 8, 2),
    "5x3": texture(5, 3, 3),
    "1x7": texture(1, 7, 4),
}
TRILINEAR = Sampler()


@dataclass(frozen=True)
class Case:
    """One full-screen quad."""

    texture: str
    map: PixelMap
    sampler: Sampler = TRILINEAR
    factor: tuple[float, float, float, float] = WHITE


def one_to_one(name: str) -> PixelMap:
    """One texel a pixel, the image upright, whole images beyond all its edges."""
    height, width = TEXTURES[name].pixels.shape[:2]
    return PixelMap((-1.0, SIZE[1] / height - 1.0), (1.0 / width, 0.0), (0.0, -1.0 / height))


def cases() -> dict[str, Case]:
    """All quads by name."""
    found: dict[str, Case] = {}
    for name, wrap in product(TEXTURES, product(WRAPS, WRAPS)):
        found[f"exact {name} {wrap}"] = Case(name, one_to_one(name), Sampler(wrap))
    maps = {
        "magnified": PixelMap((-0.63, 0.21), (1 / 128, 1 / 512), (0.0, -1 / 256)),
        "lod 0.585": PixelMap((-0.41, 0.33), (3 / 32, 0.0), (0.0, -1 / 32)),
        "lod 1": PixelMap((0.13, 0.29), (0.0, 1 / 8), (1 / 8, 0.0)),
        "lod 2.3": PixelMap((-2.2, 0.7), (5 / 16, 0.0), (1 / 32, 1 / 8)),
        "lod 6": PixelMap((0.0, 0.3), (4.0, 0.0), (0.0, 1.0)),
    }
    mips: tuple[Literal["none", "nearest", "linear"], ...] = ("none", "nearest", "linear")
    filters = product((True, False), (True, False), mips)
    for magnify, minify, mipmap in filters:
        sampler = Sampler(("mirror", "repeat"), magnify, minify, mipmap)
        for name, pixel_map in maps.items():
            found[f"{name} {magnify} {minify} {mipmap}"] = Case("16x16", pixel_map, sampler)
    wraps: tuple[tuple[WrapMode, WrapMode], ...] = (("clamp", "mirror"), ("repeat", "clamp"))
    for name, wrap in product(maps, wraps):
        found[f"{name} {wrap}"] = Case("16x8", maps[name], Sampler(wrap))
        found[f"{name} {wrap} odd"] = Case("5x3", maps[name], Sampler(wrap))
    found["factor"] = Case("16x16", one_to_one("16x16"), factor=(0.5, 0.25, 0.9, 1.0))
    return found


CASES = cases()


@pytest.fixture(scope="module")
def renderer(graphics: GraphicsContext) -> Iterator[Renderer]:
    """All cases, one quad behind the other."""
    names = list(TEXTURES)
    materials = [Material("m", names.index(case.texture), case.factor, case.sampler) for case in CASES.values()]
    parts = [case.map.quad(SIZE, layer, layer) for layer, case in enumerate(CASES.values())]
    made = Renderer(graphics, scene_of(parts, materials, list(TEXTURES.values())))
    yield made
    made.release()


def shown(renderer: Renderer, name: str, anisotropy: Anisotropy = 1) -> NDArray[np.float32]:
    """[H, W, 3] linear picture of a case."""
    view = ViewState(straight_camera(list(CASES).index(name)), SIZE, anisotropy=anisotropy)
    renderer.render(view)
    return renderer.picture(view.slot_a)


def index(texels: int, count: int, start: int, mode: WrapMode) -> list[int]:
    """Texels seen by `count` pixels from texel `start` on, by looking at the wrapped image."""
    forth = list(range(texels))
    if mode == "repeat":
        return [forth[i % texels] for i in range(start, start + count)]
    if mode == "mirror":
        both = forth + forth[::-1]
        return [both[i % (2 * texels)] for i in range(start, start + count)]
    return [min(max(i, 0), texels - 1) for i in range(start, start + count)]


@pytest.mark.parametrize("wrap", list(product(WRAPS, WRAPS)), ids="-".join)
@pytest.mark.parametrize("name", TEXTURES)
def test_texels_are_shown_where_they_belong(renderer: Renderer, name: str, wrap: tuple[WrapMode, WrapMode]) -> None:
    pixels = TEXTURES[name].pixels
    height, width = pixels.shape[:2]
    columns, rows = index(width, SIZE[0], -width, wrap[0]), index(height, SIZE[1], -height, wrap[1])
    expected = srgb_to_linear(pixels[np.ix_(rows, columns)] / 255.0)
    assert np.abs(shown(renderer, f"exact {name} {wrap}") - expected).max() <= SRGB_TOLERANCE


@pytest.mark.parametrize("name", [name for name in CASES if not name.startswith(("exact", "factor"))])
def test_filters_and_mips_agree_with_numpy(renderer: Renderer, name: str) -> None:
    case = CASES[name]
    pixels = TEXTURES[case.texture].pixels
    lod = case.map.lod((pixels.shape[1], pixels.shape[0]))
    expected = sample(pixels, case.map.uv(SIZE), lod, case.sampler)
    assert np.abs(shown(renderer, name).reshape(-1, 3) - expected).max() <= 2.0 * SRGB_TOLERANCE


def test_the_factor_multiplies_in_linear_light(renderer: Renderer) -> None:
    plain = shown(renderer, f"exact 16x16 {('repeat', 'repeat')}")
    assert np.allclose(
        shown(renderer, "factor"), plain * [0.5, 0.25, 0.9], atol=5e-4
    )  # the albedo is kept in half floats


def test_anisotropy_keeps_more_detail_of_stretched_footprints(renderer: Renderer) -> None:
    # Square footprints are left out: llvmpipe's anisotropic filter (Gaussian weights) blurs those too.
    stretched = f"lod 0.585 {('repeat', 'clamp')}"
    if np.array_equal(shown(renderer, stretched, 1), shown(renderer, stretched, 8)):
        pytest.skip("this driver does not filter anisotropically here")
    assert shown(renderer, stretched, 8).std() > shown(renderer, stretched, 1).std()
