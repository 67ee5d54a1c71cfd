"""Codec `grid`: settings, rounding, positional encoding and the float64 network."""

from typing import Any

import numpy as np
import pytest

from ntc.codec.grid.model import GridConfig
from ntc.codec.grid.reference import positional_encoding, triangle_wave
from ntc.codec.grid.tensors import packed_cells, quantize_latents, unpacked_cells


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("latent_channels", 0), ("latent_channels", 3), ("latent_channels", 20), ("latent_channels", -4),
        ("downscale", 0), ("downscale", 65), ("levels", 0), ("levels", 17), ("levels", -1),
        ("positional_octaves", 0), ("positional_octaves", 9), ("hidden_width", 0), ("hidden_width", 30),
        ("hidden_width", 260), ("leaky_slope", -0.1), ("leaky_slope", 1.0), ("leaky_slope", float("nan")),
        ("output_channels", 0), ("output_channels", 5), ("latent_bits", 5), ("latent_bits", 16),
        ("adapter_output", True), ("weight_bits", 8),
    ],
)  # fmt: skip
def test_bad_fields_are_named(field: str, value: Any) -> None:
    with pytest.raises(ValueError, match=f"codec.{field} = "):
        GridConfig(**{field: value})


def test_sizes_of_the_paper() -> None:
    config = GridConfig(levels=1)
    assert config.decoder_inputs == 16
    assert config.layer_shapes == ((64, 16), (64, 64), (3, 64))
    assert config.multiply_adds == 5312
    # Several levels add the lod input.
    assert GridConfig().decoder_inputs == 17
    assert GridConfig(levels=2, latent_channels=8, positional_octaves=2).decoder_inputs == 8 + 8 + 1
    narrow, wide = GridConfig(), GridConfig(latent_channels=8, latent_bits=4)
    assert narrow.cell_bytes == wide.cell_bytes == 4
    assert (narrow.largest_stored, wide.largest_stored) == (255, 15)


def test_wave_has_period_1_and_known_values() -> None:
    np.testing.assert_allclose(
        triangle_wave(np.array([0.0, 0.25, 0.5, 0.75, 1.0, -0.25, 7.5])), [1, 0, -1, 0, 1, 0, -1]
    )


def test_order_is_axis_octave_phase() -> None:
    # At x = 1: half a turn of period 2, a quarter of period 4, an eighth of period 8; each again a quarter turn on.
    at_x = [-1.0, 0.0, 0.0, -1.0, 0.5, -0.5]
    at_y = [-1.0, 0.0, 0.0, 1.0, -0.5, -0.5]
    at_zero = [1.0, 0.0] * 3
    texels = np.array([[1.0, 0.0], [0.0, 3.0], [1.0, 3.0]])
    np.testing.assert_allclose(
        positional_encoding(texels, 3), [[*at_x, *at_zero], [*at_zero, *at_y], [*at_x, *at_y]], atol=1e-12
    )


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
    # The first of two integers lies in the low half.
    assert packed_cells(np.array([[1, 2, 3, 15]], np.uint8), 4).tolist() == [[0x21, 0xF3]]
