"""The error against float64 that `bench` reports: small where a path is right, as large as the fault where it is not."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from lab.bench.float64_error import Float64Error, float64_pixels
from lab.bench.random_pack import random_pack
from ntc.codec.grid.model import GridConfig, grid_parts
from ntc.codec.model import Pack
from tests.support.picture_scenes import PixelMap, scene_of, straight_camera, texture
from viewer.gl.context import GraphicsContext
from viewer.render.renderer import Renderer
from viewer.scene.model import Material, Sampler
from viewer.state.view_state import Slot, ViewState

SIZE = (80, 72)
SIZES = ((64, 64), (40, 24))
CODEC = GridConfig(hidden_width=4, positional_octaves=1)
CLAMPED = Sampler(("mirror", "clamp"))
MATERIALS = (
    Material("plain", 0, (1.0, 1.0, 1.0, 1.0)),
    Material("tinted", 1, (0.5, 0.25, 0.8, 1.0), CLAMPED),
    Material("half dark", 1, (1.0, 0.0, 1e-5, 1.0), CLAMPED),
    Material("no texture", -1, (0.3, 0.6, 0.9, 1.0)),
    Material("not in the pack", 2, (1.0, 1.0, 1.0, 1.0)),
)
MAP = PixelMap((-0.3, 0.7), (3 / 128, 1 / 128), (-1 / 128, 5 / 256))


IMAGES = [texture(2 * width, 2 * height, width) for width, height in SIZES]


@pytest.fixture(scope="module")
def pack() -> Pack:
    """Latents for two of the scene's three textures."""
    return random_pack(SIZES, (0, 1), CODEC, hashes=[image.pixel_hash for image in IMAGES])


@pytest.fixture(scope="module")
def renderer(graphics: GraphicsContext, pack: Pack) -> Iterator[Renderer]:
    """One quad for each material, the tinted one with vertex colours; the pack, and one that is brighter than it should be."""
    colors = np.array([[0.2, 0.9, 0.5, 1.0]] * 4, np.float32)
    parts = [replace(MAP.quad(SIZE, layer, layer), colors=colors if layer == 1 else None) for layer in range(5)]
    made = Renderer(graphics, scene_of(parts, MATERIALS, [*IMAGES, texture(16, 16, 5)]))
    brighter = tuple(replace(one, biases=(*one.biases[:2], one.biases[2] + 0.25)) for one in grid_parts(pack).decoders)
    made.set_packs({"good": pack, "faulty": replace(pack, decoders=brighter)})
    yield made
    made.release()


def error_of(renderer: Renderer, pack: Pack, layer: int, slot: Slot) -> Float64Error:
    """The error of what a slot shows of a quad, against `pack`."""
    renderer.render(ViewState(straight_camera(layer), SIZE, slot))
    pixels = float64_pixels(renderer.visibility, renderer.scene, pack, renderer.matches["good"], slot.path)
    return pixels.compare(renderer.picture(slot))


def test_a_fault_is_found(renderer: Renderer, pack: Pack) -> None:
    error = error_of(renderer, pack, 1, Slot("faulty"))
    assert error.largest == pytest.approx(0.25, abs=0.01)
    assert error.largest_step > 10
    assert error.psnr_db is not None
    assert 10.0 < error.psnr_db < 30.0


@pytest.mark.parametrize("layer", [3, 4])
def test_what_shows_no_texture_of_the_pack_is_left_out(renderer: Renderer, pack: Pack, layer: int) -> None:
    error = error_of(renderer, pack, layer, Slot("good"))
    assert (error.pixels, error.largest, error.psnr_db) == (0, 0.0, None)
