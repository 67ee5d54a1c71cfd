"""Codec `block` in GLSL against its float64 twin: sizes, channels, block sides, code lengths, wrap modes, hostile requests."""

from collections.abc import Iterator
from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from numpy.typing import NDArray

from lab.bench.random_pack import random_block_pack
from ntc.codec import reference
from ntc.codec.block.config import BlockConfig
from ntc.codec.block.gpu import trellis_subsets
from ntc.codec.block.trellis import BRANCHES
from ntc.codec.config import WrapMode
from ntc.codec.gpu import GPU, SOFTWARE
from ntc.codec.latents import latent_levels
from ntc.codec.model import Pack
from tests.support.packs.parity import largest_difference
from viewer.gl.context import GraphicsContext
from viewer.render.passes.decode_texels import GlTexelDecoder

pytestmark = [pytest.mark.computes, pytest.mark.driver]

SIZES = ((64, 64), (17, 33), (1, 1), (8, 4), (9, 200), (256, 256))
GROUPS = (0, 1, 0, 1, 2, 0)
WRAPS: tuple[WrapMode, ...] = ("repeat", "mirror", "clamp")
WRAP_PAIRS = tuple(product(WRAPS, WRAPS))
TOLERANCE = 1e-4
SHAPES = {
    "default": BlockConfig(),
    "one-word": BlockConfig(block_words=(1,), mean_words=1.0, modes=8, coefficients=20),
    "three-words-4x4": BlockConfig(block_side=4, block_words=(3,), mean_words=3.0, modes=64, coefficients=48),
    "sixteen-words": BlockConfig(block_words=(16,), mean_words=16.0, modes=8, coefficients=192, mips=4),
    "four-channels": BlockConfig(block_words=(7,), mean_words=7.0, coefficients=256, output_channels=4, modes=8),
    "one-channel-4x4": BlockConfig(
        block_side=4, block_words=(2,), mean_words=2.0, coefficients=16, output_channels=1, modes=16
    ),
    "two-channels": BlockConfig(block_words=(5,), mean_words=5.0, coefficients=100, output_channels=2, levels=2),
    "two-sizes-4x4": BlockConfig(block_side=4, block_words=(1, 2), mean_words=1.5, coefficients=30, modes=8),
    "three-sizes-alpha": BlockConfig(
        block_words=(2, 3, 16), mean_words=3.0, coefficients=150, output_channels=4, maps=("base", "alpha"), modes=16
    ),
    "one-coefficient": BlockConfig(block_words=(2,), mean_words=2.0, coefficients=1, modes=8, mips=1),
}
Codec = tuple[Pack, GlTexelDecoder]
TOGETHER = ("default", "sixteen-words", "four-channels", "two-sizes-4x4", "one-coefficient")
"""Shapes that work groups decode together, too."""


@pytest.fixture(
    scope="module",
    params=[(shape, 0) for shape in SHAPES] + [(shape, 1) for shape in TOGETHER],
    ids=lambda p: f"{p[0]}-{p[1]}",
)
def codec(request: pytest.FixtureRequest, graphics: GraphicsContext) -> Iterator[Codec]:
    """Packs of several shapes with random codes, and their GLSL decoders: each pixel for itself, or a work group together."""
    shape, together = request.param
    fewer = (None, 1, None, None, 1, 2) if SHAPES[shape].mips == 4 else ()
    pack = random_block_pack(SIZES, GROUPS, SHAPES[shape], code_mips=fewer)
    decoder = GlTexelDecoder(graphics, pack, variant=replace(SOFTWARE, together=together))
    yield pack, decoder
    decoder.release()


@pytest.fixture(scope="module")
def default(graphics: GraphicsContext) -> Iterator[Codec]:
    """The default shape."""
    pack = random_block_pack(SIZES, GROUPS, SHAPES["default"])
    decoder = GlTexelDecoder(graphics, pack)
    yield pack, decoder
    decoder.release()


def largest_error(
    codec: Codec, texture: int, uv: NDArray[np.float64], lod: NDArray[np.float64], wrap: tuple[WrapMode, WrapMode]
) -> float:
    """Largest difference between GLSL and float64 at these requests, rounded to what both can represent."""
    pack, decoder = codec
    return largest_difference(pack, decoder.decode_texels, texture, uv, lod, wrap)


@pytest.mark.parametrize(
    "wrap",
    [
        pytest.param(
            pair,
            marks=() if pair[0] == pair[1] else (pytest.mark.once, pytest.mark.guards("drawing")),
            id="-".join(pair),
        )
        for pair in WRAP_PAIRS
    ],
)
def test_all_wrap_modes_agree_at_random_coordinates(codec: Codec, wrap: tuple[WrapMode, WrapMode]) -> None:
    random = np.random.default_rng(1)
    for texture in range(len(SIZES)):
        uv, lod = random.uniform(-2.0, 2.0, (200, 2)), random.uniform(-1.0, 8.0, 200)
        assert largest_error(codec, texture, uv, lod, wrap) <= TOLERANCE, SIZES[texture]


def test_every_level_agrees(codec: Codec) -> None:
    random = np.random.default_rng(2)
    pack, _ = codec
    for texture, size in enumerate(SIZES):
        for level in range(len(latent_levels(*size, pack.config))):
            uv = random.uniform(-2.0, 2.0, (100, 2))
            error = largest_error(codec, texture, uv, np.full(100, float(level)), ("repeat", "mirror"))
            assert error <= TOLERANCE, (size, level)


def test_edge_parts_of_linear_colours_are_averaged_as_they_are_stored(graphics: GraphicsContext) -> None:
    coded = random_block_pack(SIZES, GROUPS, SHAPES["sixteen-words"])
    linear = replace(coded, textures=tuple(replace(each, color_space="linear") for each in coded.textures))
    images = [reference.decode_image(pack, 0, 1).astype(int) for pack in (coded, linear)]
    assert np.abs(images[0] - images[1]).max() > 8
    decoder = GlTexelDecoder(graphics, linear)
    random = np.random.default_rng(4)
    uv, lod = random.uniform(-2.0, 2.0, (800, 2)), random.uniform(0.0, 4.0, 800)
    assert largest_error((linear, decoder), 0, uv, lod, ("repeat", "repeat")) <= TOLERANCE
    decoder.release()


@pytest.mark.parametrize("wrap", WRAP_PAIRS, ids="-".join)
def test_texel_edges_centres_and_corners_agree(default: Codec, wrap: tuple[WrapMode, WrapMode]) -> None:
    random = np.random.default_rng(3)
    for texture, size in enumerate(SIZES):
        texels = random.integers(-2 * max(size), 2 * max(size) + 1, (600, 2)) / 2.0
        uv = np.concatenate([texels / size, np.array(list(product((-2.0, -1.0, -0.0, 0.0, 0.5, 1.0, 2.0), repeat=2)))])
        assert largest_error(default, texture, uv, np.zeros(len(uv)), wrap) <= TOLERANCE, size


@pytest.mark.parametrize("wrap", WRAP_PAIRS, ids="-".join)
def test_hostile_coordinates_and_lods_stay_finite(default: Codec, wrap: tuple[WrapMode, WrapMode]) -> None:
    _, decoder = default
    hostile = [np.nan, np.inf, -np.inf, 3.4e38, -3.4e38, 1e20, -1e9, 16777217.0, 1e-45, -1e-30, -0.0, 0.25]
    uv = np.array(list(product(hostile, hostile)))
    for lod, texture in product([*hostile, 1000.0, -1000.0], range(len(SIZES))):
        values = decoder.decode_texels(texture, uv, np.full(len(uv), lod), wrap)
        assert np.isfinite(values).all()
        assert values.min() >= 0.0
        assert values.max() <= 1.0


def test_pictures_of_every_level_agree(default: Codec) -> None:
    pack, decoder = default
    for texture in range(5):
        for level in range(len(latent_levels(*SIZES[texture], pack.config))):
            expected = reference.decode_image(pack, texture, level)
            found = decoder.decode_image(texture, level)
            assert np.abs(found.astype(int) - expected).max() <= 1
            assert (found == expected).mean() > 0.98


@pytest.mark.parametrize("in_image", [False, True])
@pytest.mark.parametrize("together", [0, 1])
def test_tables_in_a_buffer_and_in_an_image_decode_alike(
    graphics: GraphicsContext, in_image: bool, together: int
) -> None:
    variant = replace(GPU, weights="image" if in_image else "storage", together=together)
    pack = random_block_pack(SIZES[:3], GROUPS[:3], SHAPES["default"])
    decoder = GlTexelDecoder(graphics, pack, variant=variant)
    random = np.random.default_rng(5)
    uv, lod = random.uniform(-2.0, 2.0, (500, 2)), random.uniform(0.0, 3.0, 500)
    assert largest_error((pack, decoder), 1, uv, lod, ("mirror", "clamp")) <= TOLERANCE
    decoder.release()


def test_other_precisions_are_decoded_in_fp32(graphics: GraphicsContext, default: Codec) -> None:
    pack, exact = default
    random = np.random.default_rng(6)
    uv, lod = random.uniform(-2.0, 2.0, (500, 2)), random.uniform(0.0, 3.0, 500)
    for precision in ("fp16", "fp16-arithmetic", "fp16-accumulate"):
        decoder = GlTexelDecoder(graphics, pack, precision)
        assert np.array_equal(decoder.decode_texels(0, uv, lod), exact.decode_texels(0, uv, lod))
        decoder.release()


def test_the_shader_walks_the_trellis_of_the_encoder() -> None:
    subsets = trellis_subsets()
    for state, branch in product(range(8), range(2)):
        following, subset = BRANCHES[state][branch]
        assert following == ((state << 1) & 6) | branch
        # The three bits before a branch are the state, the first of them highest.
        window = state >> 2 | (state & 2) | (state & 1) << 2 | branch << 3
        assert subset == (subsets >> (2 * window)) & 3
