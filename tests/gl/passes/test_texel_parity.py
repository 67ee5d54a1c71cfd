"""The GLSL codec against its float64 twin: every level, wrap mode and odd size; hostile input stays finite."""

from collections.abc import Iterator
from itertools import product

import numpy as np
import pytest

from lab.bench.random_pack import random_pack
from ntc.codec import reference
from ntc.codec.config import WrapMode
from ntc.codec.grid.model import GridConfig
from ntc.codec.latents import latent_levels
from ntc.codec.model import Pack
from tests.support.packs.parity import largest_difference
from viewer.gl.context import GraphicsContext
from viewer.render.passes.decode_texels import GlTexelDecoder

pytestmark = [pytest.mark.computes, pytest.mark.driver]

SIZES = ((64, 64), (17, 33), (1, 1), (200, 3), (1024, 1024))
WRAPS: tuple[WrapMode, ...] = ("repeat", "mirror", "clamp")
WRAP_PAIRS = tuple(product(WRAPS, WRAPS))
FP32_TOLERANCE = 1e-4
FULL = GridConfig()
PAPER = GridConfig(levels=1)
ADAPTED = GridConfig(adapters=True)
NIBBLES = GridConfig(latent_channels=8, latent_bits=4, adapters=True, adapter_output=True)
PADDED = GridConfig(latent_channels=12, latent_bits=4, hidden_width=16, output_channels=2)
WIDE = GridConfig(latent_channels=8, hidden_width=32, positional_octaves=2, output_channels=4, downscale=2)


def packed(config: GridConfig) -> Pack:
    """A random pack of textures of all SIZES, in two groups."""
    return random_pack(SIZES, (0, 1, 0, 1, 0), config)


@pytest.fixture(scope="module", params=["full", "paper", "wide", "adapted", "nibbles", "padded"])
def codec(request: pytest.FixtureRequest, graphics: GraphicsContext) -> Iterator[tuple[Pack, GlTexelDecoder]]:
    """Packs of six codec shapes with their GLSL decoders."""
    shapes = {"full": FULL, "paper": PAPER, "wide": WIDE, "adapted": ADAPTED, "nibbles": NIBBLES, "padded": PADDED}
    pack = packed(shapes[request.param])
    decoder = GlTexelDecoder(graphics, pack)
    yield pack, decoder
    decoder.release()


@pytest.fixture(scope="module")
def full(graphics: GraphicsContext) -> Iterator[tuple[Pack, GlTexelDecoder]]:
    """The default codec."""
    pack = packed(FULL)
    decoder = GlTexelDecoder(graphics, pack)
    yield pack, decoder
    decoder.release()


def largest_error(
    codec: tuple[Pack, GlTexelDecoder], texture: int, uv: np.ndarray, lod: np.ndarray, wrap: tuple[WrapMode, WrapMode]
) -> float:
    """Largest difference between GLSL and float64 at these float32 requests."""
    pack, decoder = codec
    return largest_difference(pack, decoder.decode_texels, texture, uv, lod, wrap)


@pytest.mark.parametrize("wrap", WRAP_PAIRS, ids="-".join)
def test_all_wrap_modes_agree_at_random_coordinates(
    codec: tuple[Pack, GlTexelDecoder], wrap: tuple[WrapMode, WrapMode]
) -> None:
    random = np.random.default_rng(1)
    for texture in range(len(SIZES)):
        uv, lod = random.uniform(-2.0, 2.0, (1500, 2)), random.uniform(-1.0, 10.0, 1500)
        assert largest_error(codec, texture, uv, lod, wrap) <= FP32_TOLERANCE, SIZES[texture]


def test_every_level_agrees(codec: tuple[Pack, GlTexelDecoder]) -> None:
    random = np.random.default_rng(2)
    pack, _ = codec
    for texture, size in enumerate(SIZES):
        for level in range(len(latent_levels(*size, pack.config))):
            uv = random.uniform(-2.0, 2.0, (400, 2))
            error = largest_error(codec, texture, uv, np.full(400, float(level)), ("repeat", "mirror"))
            assert error <= FP32_TOLERANCE, (size, level)


@pytest.mark.parametrize("wrap", WRAP_PAIRS, ids="-".join)
def test_texel_edges_and_corners_agree(full: tuple[Pack, GlTexelDecoder], wrap: tuple[WrapMode, WrapMode]) -> None:
    random = np.random.default_rng(3)
    for texture, size in enumerate(SIZES):
        texels = random.integers(-2 * max(size), 2 * max(size) + 1, (600, 2)) / 2.0
        uv = np.concatenate([texels / size, np.array(list(product((-2.0, -1.0, -0.0, 0.0, 0.5, 1.0, 2.0), repeat=2)))])
        # Where a side is no power of two, the edge itself is no float32 number: both sides get the same rounded one.
        assert largest_error(full, texture, uv, np.zeros(len(uv)), wrap) <= FP32_TOLERANCE, size


@pytest.mark.parametrize("wrap", WRAP_PAIRS, ids="-".join)
def test_hostile_coordinates_and_lods_stay_finite(
    full: tuple[Pack, GlTexelDecoder], wrap: tuple[WrapMode, WrapMode]
) -> None:
    _, decoder = full
    hostile = [np.nan, np.inf, -np.inf, 3.4e38, -3.4e38, 1e20, -1e9, 16777217.0, 1e-45, -1e-30, -0.0, 0.25]
    uv = np.array(list(product(hostile, hostile)))
    for lod, texture in product([*hostile, 1000.0, -1000.0], range(len(SIZES))):
        values = decoder.decode_texels(texture, uv, np.full(len(uv), lod), wrap)
        assert np.isfinite(values).all()
        assert values.min() >= 0.0
        assert values.max() <= 1.0


def test_not_finite_counts_as_zero(full: tuple[Pack, GlTexelDecoder]) -> None:
    _, decoder = full
    bad = np.array([[np.nan, 0.3], [0.3, np.inf], [-np.inf, np.nan]])
    good = np.array([[0.0, 0.3], [0.3, 0.0], [0.0, 0.0]])
    lod = np.array([np.nan, np.inf, -np.inf])
    assert np.array_equal(decoder.decode_texels(0, bad, lod), decoder.decode_texels(0, good, np.zeros(3)))


def test_whole_pictures_of_every_level_agree(full: tuple[Pack, GlTexelDecoder]) -> None:
    pack, decoder = full
    for texture in (0, 1, 2, 3):
        for level in range(len(latent_levels(*SIZES[texture], pack.config))):
            expected = reference.decode_image(pack, texture, level)
            found = decoder.decode_image(texture, level)
            assert found.shape == expected.shape
            assert np.abs(found.astype(int) - expected).max() <= 1
            assert (found == expected).mean() > 0.98


def test_no_texels_are_an_empty_answer(full: tuple[Pack, GlTexelDecoder]) -> None:
    assert full[1].decode_texels(0, np.zeros((0, 2)), np.zeros(0)).shape == (0, 3)


def test_more_texels_than_one_batch(full: tuple[Pack, GlTexelDecoder], monkeypatch: pytest.MonkeyPatch) -> None:
    uv, lod = np.random.default_rng(5).uniform(0.0, 1.0, (1000, 2)), np.zeros(1000)
    whole = full[1].decode_texels(0, uv, lod)
    monkeypatch.setattr("viewer.render.passes.decode_texels.TEXELS_AT_ONCE", 300)
    assert np.array_equal(full[1].decode_texels(0, uv, lod), whole)
