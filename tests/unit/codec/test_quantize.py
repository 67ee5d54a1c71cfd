"""Rounding of latents to 8 bits."""

import numpy as np
import pytest

from ntc.quantize import quantize_latents


@pytest.mark.parametrize("spread", [1e-4, 0.25, 30.0])
def test_error_is_at_most_half_a_step(spread: float) -> None:
    values = np.random.default_rng(1).uniform(-spread, spread, (500, 4)).astype(np.float32)
    low, high = values.min(axis=0), values.max(axis=0)
    quantized = quantize_latents(values, low, high)
    assert quantized.stored.dtype == np.uint8
    assert quantized.scale.dtype == quantized.offset.dtype == np.float32
    error = np.abs(quantized.values() - values) / quantized.scale
    assert error.max() <= 0.5 + 1e-3
    assert quantized.stored.min() == 0
    assert quantized.stored.max() == 255


def test_rounding_rounded_values_changes_nothing() -> None:
    values = np.random.default_rng(2).normal(0.0, 1.0, (100, 4)).astype(np.float32)
    low, high = values.min(axis=0), values.max(axis=0)
    first = quantize_latents(values, low, high)
    again = quantize_latents(first.values().astype(np.float32), low, high)
    np.testing.assert_array_equal(again.stored, first.stored)


def test_values_beyond_the_range_are_clamped() -> None:
    quantized = quantize_latents(
        np.array([[-5.0], [0.501], [9.0]], np.float32), np.zeros(1, np.float32), np.ones(1, np.float32)
    )
    assert quantized.stored[:, 0].tolist() == [0, 128, 255]


def test_a_constant_channel_keeps_its_value() -> None:
    values = np.full((6, 4), 0.3, np.float32)
    quantized = quantize_latents(values, values[0], values[0])
    assert (quantized.scale > 0.0).all()
    np.testing.assert_allclose(quantized.values(), values, atol=1e-8)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_values_that_are_not_finite_raise(bad: float) -> None:
    values, low, high = np.zeros((3, 4), np.float32), np.zeros(4, np.float32), np.ones(4, np.float32)
    for target in (values, low, high):
        target.flat[0] = bad
        with pytest.raises(ValueError, match="finite"):
            quantize_latents(values, low, high)
        target.flat[0] = 0.0
