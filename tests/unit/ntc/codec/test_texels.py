"""Colour, mips, levels of latents and quality: what all codecs share about texels."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from lab.bench.random_pack import random_block_pack
from ntc.codec.block.config import BlockConfig
from ntc.codec.config import ColorSpace
from ntc.codec.grid.model import GridConfig
from ntc.codec.latents import latent_cell_count, latent_levels
from ntc.codec.maps import BASE_ALONE, MapName
from ntc.codec.mips import linear_to_srgb, linear_to_srgb8, mip_chain, srgb8_to_linear_table, srgb_to_linear
from ntc.codec.quality import map_psnr_db, measured_texture, normal_angles
from ntc.metrics.metrics import psnr_table
from tests.support.gltf_builder import noise


def test_every_8_bit_value_survives_the_round_trip() -> None:
    values = np.arange(256, dtype=np.uint8)
    np.testing.assert_array_equal(linear_to_srgb8(srgb8_to_linear_table()), values)
    np.testing.assert_array_equal(linear_to_srgb8(srgb_to_linear(values / 255.0)), values)
    hostile = np.array([-1.0, np.nan, np.inf, -np.inf, 2.0])
    np.testing.assert_array_equal(linear_to_srgb8(hostile), [0, 0, 255, 0, 255])
    many = np.linspace(0.0, 1.0, 4001)
    np.testing.assert_allclose(srgb_to_linear(linear_to_srgb(many)), many, atol=1e-7)
    np.testing.assert_allclose(linear_to_srgb(srgb_to_linear(many)), many, atol=1e-7)
    assert srgb_to_linear(np.array([0.3], np.float32)).dtype == np.float32
    assert linear_to_srgb(np.array([0.3], np.float64)).dtype == np.float64


@pytest.mark.parametrize(
    ("srgb", "linear"), [(0.0, 0.0), (1.0, 1.0), (0.5, 0.21404114), (0.04045, 0.0031308), (0.02, 0.00154799)]
)
def test_known_values_of_the_standard(srgb: float, linear: float) -> None:
    assert srgb_to_linear(np.array(srgb)) == pytest.approx(linear, abs=1e-7)
    assert linear_to_srgb(np.array(linear)) == pytest.approx(srgb, abs=1e-6)


IMAGE_SIZES = [(64, 64), (17, 33), (1, 7), (5, 1), (1, 1), (31, 2), (3, 3)]


def shares(rows: int, size: int) -> NDArray[np.float64]:
    """[size, rows] float64: the share of each input row in each output row."""
    matrix = np.zeros((size, rows))
    for output in range(size):
        start, end = output * rows / size, (output + 1) * rows / size
        for row in range(rows):
            matrix[output, row] = max(0.0, min(row + 1, end) - max(row, start)) / (end - start)
    return matrix


def brute_chain(pixels: NDArray[np.uint8], color_space: ColorSpace) -> list[NDArray[np.float64]]:
    """All mips as unrounded 8-bit steps."""
    channels = pixels.shape[2]
    alpha = channels - 1 if channels in (2, 4) else None
    coded = np.array([color_space == "srgb" and channel != alpha for channel in range(channels)])
    values = pixels / 255.0
    linear = np.where(coded, srgb_to_linear(values), values)
    chain = []
    while True:
        chain.append(np.where(coded, linear_to_srgb(linear), linear) * 255.0)
        height, width = linear.shape[:2]
        if height == 1 and width == 1:
            return chain
        linear = np.einsum("yi,ijc->yjc", shares(height, max(1, height // 2)), linear)
        linear = np.einsum("xj,yjc->yxc", shares(width, max(1, width // 2)), linear)


@pytest.mark.parametrize("color_space", ["srgb", "linear"])
@pytest.mark.parametrize("channels", [1, 2, 3, 4])
@pytest.mark.parametrize("size", IMAGE_SIZES)
def test_chain_agrees_with_brute_force(size: tuple[int, int], channels: int, color_space: ColorSpace) -> None:
    pixels = noise(size[1], size[0], channels)
    chain, truth = mip_chain(pixels, color_space), brute_chain(pixels, color_space)
    np.testing.assert_array_equal(chain[0], pixels)
    assert len(chain) == len(truth) == max(size).bit_length()
    for level, (mip, exact) in enumerate(zip(chain, truth, strict=True)):
        assert mip.dtype == np.uint8
        assert mip.shape == (max(1, size[1] >> level), max(1, size[0] >> level), channels)
        assert np.abs(mip - exact).max() <= 0.5 + 1e-3, f"level {level}"


def test_a_checkerboard_is_averaged_in_linear_light() -> None:
    board = ((np.indices((8, 8)).sum(axis=0) % 2) * 255).astype(np.uint8)[..., None].repeat(4, axis=2)
    for mip in mip_chain(board, "srgb")[1:]:
        assert (mip[..., :3] == 188).all()
        assert (mip[..., 3] == 128).all(), "alpha is not sRGB-coded"
    for mip in mip_chain(board, "linear")[1:]:
        assert (mip == 128).all()


SIZES = [(1024, 1024), (1024, 256), (17, 33), (200, 3), (1, 1), (2, 5000), (16, 16), (20, 20)]


def test_a_non_square_texture_ends_when_its_longer_side_is_small() -> None:
    levels = latent_levels(1024, 64, GridConfig())
    assert [(level.width, level.height) for level in levels] == [
        (256, 16), (128, 8), (64, 4), (32, 2), (16, 1), (8, 1), (4, 1),
    ]  # fmt: skip
    assert levels[-1].texel_height == 1
    # One level only, as the paper has it.
    assert len(latent_levels(4096, 4096, GridConfig(levels=1))) == 1


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("limit", [None, 1, 3])
@pytest.mark.parametrize("downscale", [1, 3, 4])
def test_levels_follow_one_another_and_cover_their_mips(
    size: tuple[int, int], limit: int | None, downscale: int
) -> None:
    config = GridConfig(levels=limit, downscale=downscale)
    levels = latent_levels(*size, config)
    assert 1 <= len(levels) <= (limit or 99)
    first = 0
    for number, level in enumerate(levels):
        assert level.first_cell == first
        assert (level.texel_width, level.texel_height) == (max(1, size[0] >> number), max(1, size[1] >> number))
        assert level.texel_width <= level.width * downscale < level.texel_width + downscale
        assert level.texel_height <= level.height * downscale < level.texel_height + downscale
        assert (max(level.width, level.height) <= 4) == (number == len(levels) - 1) or limit is not None
        first += level.cells
    assert latent_cell_count(*size, config) == first


MAPS: tuple[MapName, ...] = ("base", "normal", "roughness")


def coded(x: float, y: float) -> np.ndarray:
    """[1, 1, 2] uint8: a normal as a picture holds it."""
    return np.rint(np.array([[[x, y]]]) * 127.5 + 127.5).astype(np.uint8)


@pytest.mark.parametrize("degrees", [0.0, 5.0, 30.0, 80.0])
def test_angles_are_those_between_the_vectors(degrees: float) -> None:
    tilted = coded(np.sin(np.radians(degrees)), 0.0)
    assert float(normal_angles(coded(0.0, 0.0), tilted)[0, 0]) == pytest.approx(degrees, abs=1.5)
    assert float(normal_angles(tilted, tilted)[0, 0]) == 0.0
    # Normals that are too long have an angle too.
    found = normal_angles(np.array([[[255, 255]]], np.uint8), np.array([[[0, 0]]], np.uint8))
    assert float(found[0, 0]) == pytest.approx(180.0)
    assert np.isfinite(normal_angles(np.zeros((3, 5, 2), np.uint8), np.full((3, 5, 2), 128, np.uint8))).all()


def test_each_map_has_its_own_psnr_and_the_table_shows_them() -> None:
    config = BlockConfig(coefficients=8, modes=8, output_channels=6, maps=MAPS)
    pack = random_block_pack(((8, 8),), (0,), config)
    pixels = np.full((8, 8, 6), 100, np.uint8)
    decoded = pixels.copy()
    decoded[..., 3:5] += 10
    assert map_psnr_db(MAPS, decoded, pixels) == (np.inf, pytest.approx(28.13, abs=0.01), np.inf)
    found = measured_texture(pack.textures[0], decoded, pixels)
    assert found.normal_degrees is not None
    assert found.normal_degrees[0] == pytest.approx(found.normal_degrees[1])
    table = psnr_table(replace(pack, textures=(found,)))
    assert "base exact, normal 28.13 dB (" in table.lines()[2]
    expected = {"base": None, "normal": found.map_psnr_db[1], "roughness": None}
    assert table.json()["textures"][0]["map_psnr_db"] == expected
    # Of a texture that is no set one number says all.
    plain = random_block_pack(((8, 8),), (0,)).textures[0]
    assert measured_texture(plain, decoded[..., :3], pixels[..., :3]).map_psnr_db == ()


@pytest.mark.parametrize("size", [(32, 64), (2, 2), (10, 6), (5, 8)])
@pytest.mark.parametrize(
    ("maps", "channels", "color_space"),
    [
        (BASE_ALONE, 3, "srgb"),
        (BASE_ALONE, 4, "srgb"),
        (BASE_ALONE, 1, "linear"),
        (("base", "normal", "roughness", "metalness", "emissive", "occlusion"), 11, "srgb"),
    ],
)
def test_compiled_code_gives_the_same_mips(
    maps: tuple[MapName, ...],
    channels: int,
    color_space: ColorSpace,
    size: tuple[int, int],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    pixels = np.random.default_rng(3).integers(0, 256, (size[1], size[0], channels), dtype=np.uint8)
    expected = mip_chain(pixels, color_space, maps)
    monkeypatch.setattr("ntc.codec.mips.LEAST_COMPILED", 0)
    for found, mip in zip(mip_chain(pixels, color_space, maps), expected, strict=True):
        np.testing.assert_array_equal(found, mip)


def test_compiled_code_gives_the_same_angles(monkeypatch: pytest.MonkeyPatch) -> None:
    one, other = np.random.default_rng(4).integers(0, 256, (2, 20, 30, 2), dtype=np.uint8)
    expected = normal_angles(one, other)
    monkeypatch.setattr("ntc.codec.mips.LEAST_COMPILED", 0)
    np.testing.assert_allclose(normal_angles(one, other), expected, atol=1e-9)
