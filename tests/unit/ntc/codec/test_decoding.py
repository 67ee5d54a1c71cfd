"""Codecs at any place and level of detail: the float64 decode does what docs/reference/codecs.md says, and torch does the same."""

from dataclasses import replace
from itertools import product
from typing import Any, Literal

import numpy as np
import pytest
from numpy.typing import NDArray

from lab.bench.random_pack import random_block_pack, random_pack
from ntc.codec.block import reference
from ntc.codec.block.config import BlockConfig
from ntc.codec.block.model import block_parts
from ntc.codec.block.reference import image_of
from ntc.codec.config import WrapMode
from ntc.codec.grid.model import GridConfig, grid_parts
from ntc.codec.grid.reference import run_decoder
from ntc.codec.grid.torch_twin import TorchGrid
from ntc.codec.latents import latent_levels, texture_levels
from ntc.codec.model import Pack
from ntc.codec.reference import decode_image, decode_texels, texel_centres
from ntc.codec.registry import codec_of
from ntc.errors import InputError
from tests.support.packs.parity import assert_torch_agrees

SIZES = ((64, 64), (17, 33), (1, 1), (200, 3))
MODES: tuple[WrapMode, ...] = ("repeat", "mirror", "clamp")
WRAPS = tuple(product(MODES, MODES))
Kind = Literal["grid", "block 4x4", "block 8x8"]
every_codec = pytest.mark.parametrize("kind", ["grid", "block 8x8"])


def four_textures(kind: Kind, channels: int = 3, levels: int | None = None) -> Pack:
    """A pack of all SIZES in two groups."""
    if kind == "grid":
        return random_pack(SIZES, (0, 1, 0, 1), GridConfig(output_channels=channels, levels=levels))
    shape: dict[str, Any] = {"block_side": 4, "block_words": (1, 2), "coefficients": 16, "modes": 8}
    if kind == "block 8x8":
        shape |= {"block_side": 8, "block_words": (1, 2, 4, 7)}
    return random_block_pack(SIZES, (0, 1, 0, 1), BlockConfig(**shape, output_channels=channels, levels=levels))


def texels_of(pack: Pack, index: int, level: int) -> NDArray[np.float64]:
    """[h, w, C] float64 of a level, not clamped."""
    own = block_parts(pack)
    texture, config = own.textures[index], own.config
    decoder = own.decoders[texture.group]
    geometry = texture_levels(texture, config)[level]
    stored = reference.texture_codes(texture, config, level)
    values = reference.block_values(texture, stored, decoder, config, geometry.mip_of_cell)
    return image_of(values, geometry, config).astype(np.float64)


@pytest.mark.parametrize("wrap", WRAPS)
@pytest.mark.parametrize("levels", [None, 1, 2])
def test_random_places(wrap: tuple[WrapMode, WrapMode], levels: int | None) -> None:
    pack = four_textures("grid", levels=levels)
    random = np.random.default_rng(3)
    for index in range(len(SIZES)):
        uv = random.uniform(-5.0, 5.0, (400, 2)).astype(np.float32)
        assert_torch_agrees(pack, index, uv, random.uniform(-1.0, 10.0, 400).astype(np.float32), wrap)


@every_codec
@pytest.mark.parametrize("wrap", WRAPS)
def test_hostile_numbers_decode_to_something_finite(kind: Kind, wrap: tuple[WrapMode, WrapMode]) -> None:
    pack = four_textures(kind)
    hostile = np.array([np.nan, np.inf, -np.inf, 3e38, -3e38, 1e-45, -0.0, 0.5], np.float32)
    u, v, lod = (axis.ravel() for axis in np.meshgrid(hostile, hostile, hostile))
    for index in range(len(SIZES)):
        assert_torch_agrees(pack, index, np.stack([u, v], axis=-1), lod, wrap)


@pytest.mark.parametrize("kind", ["grid", "block 4x4", "block 8x8"])
@pytest.mark.parametrize("channels", [1, 2, 3, 4])
@pytest.mark.parametrize("levels", [None, 1])
def test_images_are_what_texel_centres_decode_to(kind: Kind, channels: int, levels: int | None) -> None:
    pack = four_textures(kind, channels, levels)
    codec = codec_of(pack.config).torch_twin(pack, "cpu")
    for index, size in enumerate(SIZES):
        for number, level in enumerate(latent_levels(*size, pack.config)):
            uv = texel_centres(level.texel_width, level.texel_height)
            assert_torch_agrees(pack, index, uv.astype(np.float32), np.full(len(uv), number, np.float32), None)
            at_centres = decode_texels(pack, index, uv, np.full(len(uv), float(number)))
            truth, fast = decode_image(pack, index, number), codec.decode_image(index, number)
            assert truth.shape == fast.shape == (level.texel_height, level.texel_width, channels)
            np.testing.assert_allclose(codec.mip(index, number).numpy() * 255.0, truth, atol=0.51)
            assert np.abs(at_centres.reshape(truth.shape) * 255.0 - truth).max() < 0.5001
            assert np.abs(truth.astype(int) - fast.astype(int)).max() <= 1


@every_codec
def test_further_channels_are_dropped_and_nothing_decodes_to_nothing(kind: Kind) -> None:
    pack = four_textures(kind, channels=4)
    two = replace(pack, textures=tuple(replace(texture, channels=2) for texture in pack.textures))
    uv, lod = np.full((1, 2), 0.3), np.zeros(1)
    np.testing.assert_array_equal(decode_texels(two, 0, uv, lod), decode_texels(pack, 0, uv, lod)[:, :2])
    fast = codec_of(two.config).torch_twin(two, "cpu").decode_image(0, 2)
    assert decode_image(two, 0, 2).shape == fast.shape == (16, 16, 2)
    assert_torch_agrees(pack, 0, np.zeros((0, 2), np.float32), np.zeros(0, np.float32), None)


def test_decoders_refuse_packs_of_the_other_codec() -> None:
    with pytest.raises(InputError, match="codec block has no hidden layers"):
        TorchGrid(four_textures("block 8x8"), "cpu")
    with pytest.raises(InputError, match="codec grid has no basis"):
        block_parts(four_textures("grid"))


@pytest.mark.parametrize("wrap", MODES)
def test_neighbours_are_those_of_the_wrap_mode_and_values_are_clamped_last(wrap: WrapMode) -> None:
    pack = four_textures("block 8x8")
    texels, level = texels_of(pack, 1, 0), latent_levels(17, 33, pack.config)[0]
    random = np.random.default_rng(7)
    for _ in range(60):
        # Inside the texture, so that only neighbours are wrapped: half a texel at most beyond the edge.
        x, y = random.uniform(-0.5, level.texel_width - 0.5), random.uniform(-0.5, level.texel_height - 0.5)
        column, row = int(np.floor(x)), int(np.floor(y))

        def texel(u: int, v: int) -> NDArray[np.float64]:
            if wrap == "repeat":
                return np.asarray(texels[v % level.texel_height, u % level.texel_width])
            return np.asarray(texels[min(max(v, 0), level.texel_height - 1), min(max(u, 0), level.texel_width - 1)])

        fx, fy = x - column, y - row
        expected = (1 - fy) * ((1 - fx) * texel(column, row) + fx * texel(column + 1, row)) + fy * (
            (1 - fx) * texel(column, row + 1) + fx * texel(column + 1, row + 1)
        )
        uv = np.array([[(x + 0.5) / level.texel_width, (y + 0.5) / level.texel_height]])
        found = decode_texels(pack, 1, uv, np.zeros(1), (wrap, wrap))[0]
        np.testing.assert_allclose(found, np.clip(expected, 0.0, 1.0), atol=1e-9)
    assert (texels < 0.0).any()
    assert (texels > 1.0).any()


def test_levels_are_blended_before_clamping() -> None:
    pack = four_textures("block 8x8")
    # The centre of texel (5, 9) of level 1 lies between four texels of level 0.
    fine, coarse = texels_of(pack, 0, 0), texels_of(pack, 0, 1)
    uv = np.array([[5.5 / 32.0, 9.5 / 32.0]])
    below, above = fine[18:20, 10:12].mean((0, 1)), coarse[9, 5]
    for lod in (0.0, 0.25, 0.75, 1.0):
        expected = np.clip(below * (1.0 - lod) + above * lod, 0.0, 1.0)
        np.testing.assert_allclose(decode_texels(pack, 0, uv, np.array([lod]))[0], expected, atol=1e-9)


@pytest.mark.parametrize("wrap", WRAPS)
def test_edges_of_texels_cells_and_the_texture(wrap: tuple[WrapMode, WrapMode]) -> None:
    # A power of two a side: these edges are exact in float32, so both sides take the same cell.
    pack = four_textures("grid")
    edges = (np.arange(-64, 129) / 64.0).astype(np.float32)
    for coordinates in ((edges, edges[::-1]), (edges, np.zeros_like(edges)), (np.ones_like(edges), edges)):
        uv = np.stack(coordinates, axis=-1)
        for lod in (0.0, 0.5, 1.0, 3.0):
            assert_torch_agrees(pack, 0, uv, np.full(len(uv), lod, np.float32), wrap)


def test_what_is_not_finite_counts_as_0() -> None:
    pack = four_textures("grid")
    bad = np.array([[np.nan, 0.25], [np.inf, 0.25], [-np.inf, 0.25]])
    expected = decode_texels(pack, 0, np.array([[0.0, 0.25]]), np.zeros(1))
    decoded = decode_texels(pack, 0, bad, np.array([np.nan, np.inf, -np.inf]))
    np.testing.assert_allclose(decoded, expected.repeat(3, axis=0), atol=1e-12)


def test_the_textures_own_wrap_is_the_default() -> None:
    pack = random_pack(((17, 33),), (0,), wrap=("mirror", "clamp"))
    uv, lod = np.random.default_rng(0).uniform(-3.0, 3.0, (50, 2)), np.zeros(50)
    own = decode_texels(pack, 0, uv, lod)
    np.testing.assert_array_equal(own, decode_texels(pack, 0, uv, lod, ("mirror", "clamp")))
    assert not np.array_equal(own, decode_texels(pack, 0, uv, lod, ("repeat", "repeat")))


def test_mirror_and_clamp_are_what_their_names_say() -> None:
    pack = four_textures("grid")
    inside, lod = np.array([[0.3, 0.6]]), np.zeros(1)
    mirrored = decode_texels(pack, 1, inside, lod, ("mirror", "mirror"))
    np.testing.assert_allclose(
        decode_texels(pack, 1, np.array([[-0.3, 1.4]]), lod, ("mirror", "mirror")), mirrored, atol=1e-9
    )
    edge = decode_texels(pack, 1, np.array([[0.0, 1.0]]), lod, ("clamp", "clamp"))
    np.testing.assert_array_equal(decode_texels(pack, 1, np.array([[-4.0, 7.0]]), lod, ("clamp", "clamp")), edge)
    repeated = decode_texels(pack, 1, np.array([[2.3, -1.4]]), lod, ("repeat", "repeat"))
    np.testing.assert_allclose(
        repeated, decode_texels(pack, 1, np.array([[0.3, 0.6]]), lod, ("repeat", "repeat")), atol=1e-9
    )


def test_an_adapter_scales_and_shifts_hidden_layers_in_place_of_the_bias() -> None:
    pack = random_pack(((8, 8),), (0,), GridConfig(hidden_width=8, adapters=True))
    adapter, decoder = grid_parts(pack).textures[0].adapter, grid_parts(pack).decoders[0]
    assert adapter is not None
    values = layer = np.linspace(-1.0, 1.0, grid_parts(pack).config.decoder_inputs)
    for number, weight in enumerate(decoder.weights):
        layer = weight.astype(np.float64) @ layer
        if number < 2:
            layer = adapter.scales[number] * layer + adapter.biases[number]
            layer = np.where(layer > 0.0, layer, 0.01 * layer)
        else:
            layer = layer + decoder.biases[2]
    np.testing.assert_allclose(run_decoder(decoder, values[None], 0.01, adapter)[0], layer, atol=1e-9)
    without = run_decoder(decoder, values[None], 0.01)[0]
    assert np.abs(without - layer).max() > 0.01


@pytest.mark.parametrize(
    "config",
    [
        GridConfig(latent_channels=12, hidden_width=16, positional_octaves=1, downscale=8),
        GridConfig(latent_channels=16, hidden_width=128, positional_octaves=8, downscale=1, leaky_slope=0.2),
        GridConfig(adapters=True),
        GridConfig(latent_channels=8, latent_bits=4, adapters=True, adapter_output=True),
        GridConfig(latent_channels=12, latent_bits=4, output_channels=4),
    ],
)
def test_other_shapes_agree_too(config: GridConfig) -> None:
    pack = random_pack(((40, 24),), (0,), config)
    random = np.random.default_rng(5)
    uv = random.uniform(-2.0, 2.0, (200, 2)).astype(np.float32)
    assert_torch_agrees(pack, 0, uv, random.uniform(0.0, 5.0, 200).astype(np.float32), None)
