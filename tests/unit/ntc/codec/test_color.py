"""The sRGB transfer function and its inverse."""

import numpy as np
import pytest

from ntc.codec.color import linear_to_srgb, linear_to_srgb8, srgb8_to_linear_table, srgb_to_linear


def test_every_8_bit_value_survives_the_round_trip() -> None:
    values = np.arange(256, dtype=np.uint8)
    np.testing.assert_array_equal(linear_to_srgb8(srgb8_to_linear_table()), values)
    np.testing.assert_array_equal(linear_to_srgb8(srgb_to_linear(values / 255.0)), values)


def test_the_two_directions_are_inverse() -> None:
    values = np.linspace(0.0, 1.0, 4001)
    np.testing.assert_allclose(srgb_to_linear(linear_to_srgb(values)), values, atol=1e-7)
    np.testing.assert_allclose(linear_to_srgb(srgb_to_linear(values)), values, atol=1e-7)


@pytest.mark.parametrize(
    ("srgb", "linear"), [(0.0, 0.0), (1.0, 1.0), (0.5, 0.21404114), (0.04045, 0.0031308), (0.02, 0.00154799)]
)
def test_known_values_of_the_standard(srgb: float, linear: float) -> None:
    assert srgb_to_linear(np.array(srgb)) == pytest.approx(linear, abs=1e-7)
    assert linear_to_srgb(np.array(linear)) == pytest.approx(srgb, abs=1e-6)


def test_precision_of_the_input_is_kept() -> None:
    assert srgb_to_linear(np.array([0.3], np.float32)).dtype == np.float32
    assert linear_to_srgb(np.array([0.3], np.float64)).dtype == np.float64


def test_hostile_values_are_clamped() -> None:
    hostile = np.array([-1.0, np.nan, np.inf, -np.inf, 2.0])
    np.testing.assert_array_equal(linear_to_srgb8(hostile), [0, 0, 255, 0, 255])
