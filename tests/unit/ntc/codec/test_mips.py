"""The mip chain against a float64 box filter written as plain sums."""

import numpy as np
import pytest
from numpy.typing import NDArray

from ntc.codec.color import linear_to_srgb, srgb_to_linear
from ntc.codec.config import ColorSpace
from ntc.codec.mips import mip_chain, resize_to

SIZES = [(64, 64), (17, 33), (1, 7), (5, 1), (1, 1), (31, 2), (3, 3)]


def noise(width: int, height: int, channels: int, seed: int = 0) -> NDArray[np.uint8]:
    """[height, width, channels] uint8 random pixels."""
    return np.random.default_rng(seed).integers(0, 256, (height, width, channels), np.uint8)


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
@pytest.mark.parametrize("size", SIZES)
def test_chain_agrees_with_brute_force(size: tuple[int, int], channels: int, color_space: ColorSpace) -> None:
    pixels = noise(*size, channels)
    chain, truth = mip_chain(pixels, color_space), brute_chain(pixels, color_space)
    assert len(chain) == len(truth) == max(size).bit_length()
    for level, (mip, exact) in enumerate(zip(chain, truth, strict=True)):
        assert mip.dtype == np.uint8
        assert mip.shape == (max(1, size[1] >> level), max(1, size[0] >> level), channels)
        assert np.abs(mip - exact).max() <= 0.5 + 1e-3, f"level {level}"


def test_mip_0_is_the_image_itself() -> None:
    pixels = noise(17, 33, 3)
    np.testing.assert_array_equal(mip_chain(pixels, "srgb")[0], pixels)


@pytest.mark.parametrize("color_space", ["srgb", "linear"])
@pytest.mark.parametrize("size", SIZES)
def test_a_constant_stays_constant(size: tuple[int, int], color_space: ColorSpace) -> None:
    for value in (0, 1, 10, 77, 128, 254, 255):
        for mip in mip_chain(np.full((size[1], size[0], 4), value, np.uint8), color_space):
            assert (mip == value).all()


def test_a_checkerboard_is_averaged_in_linear_light() -> None:
    board = ((np.indices((8, 8)).sum(axis=0) % 2) * 255).astype(np.uint8)[..., None].repeat(4, axis=2)
    for mip in mip_chain(board, "srgb")[1:]:
        assert (mip[..., :3] == 188).all()
        assert (mip[..., 3] == 128).all(), "alpha is not sRGB-coded"
    for mip in mip_chain(board, "linear")[1:]:
        assert (mip == 128).all()


def test_resize_keeps_the_mean_of_linear_data() -> None:
    pixels = noise(30, 20, 3)
    small = resize_to(pixels, 7, 3, "linear")
    assert small.shape == (3, 7, 3)
    np.testing.assert_allclose(small.mean(axis=(0, 1)), pixels.mean(axis=(0, 1)), atol=0.5)
