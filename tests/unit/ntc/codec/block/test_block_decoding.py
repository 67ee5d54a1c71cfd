"""Codec `block` at any place and level of detail: the float64 decode follows docs/reference/codecs.md, and torch does the same."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from numpy.typing import NDArray

from lab.bench.random_pack import random_block_pack, random_pack
from ntc.codec.block import reference
from ntc.codec.block.config import BlockConfig
from ntc.codec.block.model import block_parts
from ntc.codec.block.reference import image_of
from ntc.codec.block.torch_twin import TorchBlock
from ntc.codec.config import WrapMode
from ntc.codec.grid.torch_twin import TorchGrid
from ntc.codec.latents import latent_levels
from ntc.codec.model import Pack
from ntc.codec.reference import decode_image, decode_texels, texel_centres
from ntc.codec.registry import codec_of
from ntc.errors import InputError
from tests.support.packs.parity import assert_torch_agrees

SIZES = ((64, 64), (17, 33), (1, 1), (200, 3))
MODES: tuple[WrapMode, ...] = ("repeat", "mirror", "clamp")
WRAPS = tuple(product(MODES, MODES))


def four_textures(channels: int = 3, side: int = 8, levels: int | None = None) -> Pack:
    """A pack of all SIZES in two groups."""
    shape = {"block_side": side, "block_words": (1, 2, 4, 7)[: side // 2], "coefficients": 16, "modes": 8}
    config = BlockConfig(**shape, output_channels=channels, levels=levels)  # type: ignore[arg-type]
    return random_block_pack(SIZES, (0, 1, 0, 1), config)


def texels_of(pack: Pack, index: int, level: int) -> NDArray[np.float64]:
    """[h, w, C] float64 of a level, not clamped."""
    own = block_parts(pack)
    texture, config = own.textures[index], own.config
    decoder = own.decoders[texture.group]
    geometry = latent_levels(texture.width, texture.height, config)[level]
    values = reference.block_values(texture, reference.texture_codes(texture, config, level), decoder, config)
    return image_of(values, geometry, config.block_side).astype(np.float64)


@pytest.mark.parametrize("wrap", WRAPS)
@pytest.mark.parametrize("levels", [None, 1, 2])
def test_random_places(wrap: tuple[WrapMode, WrapMode], levels: int | None) -> None:
    pack = four_textures(levels=levels)
    random = np.random.default_rng(3)
    for index in range(len(SIZES)):
        uv = random.uniform(-5.0, 5.0, (400, 2)).astype(np.float32)
        assert_torch_agrees(pack, index, uv, random.uniform(-1.0, 10.0, 400).astype(np.float32), wrap)


@pytest.mark.parametrize("wrap", WRAPS)
def test_hostile_numbers_decode_to_something_finite(wrap: tuple[WrapMode, WrapMode]) -> None:
    pack = four_textures()
    hostile = np.array([np.nan, np.inf, -np.inf, 3e38, -3e38, 1e-45, -0.0, 0.5], np.float32)
    u, v, lod = (axis.ravel() for axis in np.meshgrid(hostile, hostile, hostile))
    for index in range(len(SIZES)):
        assert_torch_agrees(pack, index, np.stack([u, v], axis=-1), lod, wrap)


@pytest.mark.parametrize("channels", [1, 2, 3, 4])
@pytest.mark.parametrize("side", [4, 8])
def test_images_are_what_texel_centres_decode_to(channels: int, side: int) -> None:
    pack = four_textures(channels, side)
    codec = TorchBlock(pack, "cpu")
    for index, size in enumerate(SIZES):
        for number, level in enumerate(latent_levels(*size, pack.config)):
            uv = texel_centres(level.texel_width, level.texel_height)
            at_centres = decode_texels(pack, index, uv, np.full(len(uv), float(number)))
            truth, fast = decode_image(pack, index, number), codec.decode_image(index, number)
            assert truth.shape == fast.shape == (level.texel_height, level.texel_width, channels)
            assert np.abs(at_centres.reshape(truth.shape) * 255.0 - truth).max() < 0.5001
            assert np.abs(truth.astype(int) - fast.astype(int)).max() <= 1


@pytest.mark.parametrize("wrap", MODES)
def test_neighbours_are_those_of_the_wrap_mode_and_values_are_clamped_last(wrap: WrapMode) -> None:
    pack = four_textures()
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
    pack = four_textures()
    # The centre of texel (5, 9) of level 1 lies between four texels of level 0.
    fine, coarse = texels_of(pack, 0, 0), texels_of(pack, 0, 1)
    uv = np.array([[5.5 / 32.0, 9.5 / 32.0]])
    below, above = fine[18:20, 10:12].mean((0, 1)), coarse[9, 5]
    for lod in (0.0, 0.25, 0.75, 1.0):
        expected = np.clip(below * (1.0 - lod) + above * lod, 0.0, 1.0)
        np.testing.assert_allclose(decode_texels(pack, 0, uv, np.array([lod]))[0], expected, atol=1e-9)


def test_further_channels_are_dropped_and_nothing_decodes_to_nothing() -> None:
    pack = four_textures(channels=4)
    two = replace(pack, textures=tuple(replace(texture, channels=2) for texture in pack.textures))
    uv, lod = np.full((1, 2), 0.3), np.zeros(1)
    np.testing.assert_array_equal(decode_texels(two, 0, uv, lod), decode_texels(pack, 0, uv, lod)[:, :2])
    assert decode_image(two, 0, 2).shape == TorchBlock(two, "cpu").decode_image(0, 2).shape == (16, 16, 2)
    assert_torch_agrees(pack, 0, np.zeros((0, 2), np.float32), np.zeros(0, np.float32), None)


def test_each_codec_has_its_decoder() -> None:
    for pack, kind in ((random_pack(), TorchGrid), (four_textures(), TorchBlock)):
        assert isinstance(codec_of(pack.config).torch_twin(pack, "cpu"), kind)
    with pytest.raises(InputError, match="codec block has no hidden layers"):
        TorchGrid(four_textures(), "cpu")
    with pytest.raises(InputError, match="codec grid has no basis"):
        TorchBlock(random_pack(), "cpu")
