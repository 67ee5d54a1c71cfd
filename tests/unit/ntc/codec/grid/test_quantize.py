"""Rounding of latents, and how they lie in files."""

import numpy as np
import pytest

from ntc.codec.grid.tensors import packed_cells, quantize_latents, unpacked_cells


@pytest.mark.parametrize("largest", [15, 255])
@pytest.mark.parametrize("spread", [1e-4, 0.25, 30.0])
def test_error_is_at_most_half_a_step(spread: float, largest: int) -> None:
    values = np.random.default_rng(1).uniform(-spread, spread, (500, 4)).astype(np.float32)
    low, high = values.min(axis=0), values.max(axis=0)
    quantized = quantize_latents(values, low, high, largest)
    assert quantized.stored.dtype == np.uint8
    assert quantized.scale.dtype == quantized.offset.dtype == np.float32
    error = np.abs(quantized.values() - values) / quantized.scale
    assert error.max() <= 0.5 + 1e-3
    assert quantized.stored.min() == 0
    assert quantized.stored.max() == largest


def test_rounding_rounded_values_changes_nothing() -> None:
    values = np.random.default_rng(2).normal(0.0, 1.0, (100, 4)).astype(np.float32)
    low, high = values.min(axis=0), values.max(axis=0)
    first = quantize_latents(values, low, high, 255)
    again = quantize_latents(first.values().astype(np.float32), low, high, 255)
    np.testing.assert_array_equal(again.stored, first.stored)


def test_values_beyond_the_range_are_clamped() -> None:
    quantized = quantize_latents(
        np.array([[-5.0], [0.501], [9.0]], np.float32), np.zeros(1, np.float32), np.ones(1, np.float32), 255
    )
    assert quantized.stored[:, 0].tolist() == [0, 128, 255]


def test_a_constant_channel_keeps_its_value() -> None:
    values = np.full((6, 4), 0.3, np.float32)
    quantized = quantize_latents(values, values[0], values[0], 255)
    assert (quantized.scale > 0.0).all()
    np.testing.assert_allclose(quantized.values(), values, atol=1e-8)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_values_that_are_not_finite_raise(bad: float) -> None:
    values, low, high = np.zeros((3, 4), np.float32), np.zeros(4, np.float32), np.ones(4, np.float32)
    for target in (values, low, high):
        target.flat[0] = bad
        with pytest.raises(ValueError, match="finite"):
            quantize_latents(values, low, high, 255)
        target.flat[0] = 0.0


@pytest.mark.parametrize(("bits", "channels"), [(4, 4), (4, 8), (4, 12), (8, 4)])
def test_cells_survive_packing(bits: int, channels: int) -> None:
    stored = np.random.default_rng(3).integers(0, 1 << bits, (7, channels), np.uint8)
    packed = packed_cells(stored, bits)
    assert packed.shape == (7, channels * bits // 8)
    np.testing.assert_array_equal(unpacked_cells(packed, bits), stored)


def test_the_first_of_two_four_bit_integers_lies_in_the_low_half() -> None:
    assert packed_cells(np.array([[1, 2, 3, 15]], np.uint8), 4).tolist() == [[0x21, 0xF3]]
