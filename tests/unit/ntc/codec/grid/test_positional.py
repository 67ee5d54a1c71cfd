"""Triangle-wave positional encoding."""

import numpy as np

from ntc.codec.grid.reference import positional_encoding, triangle_wave


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


def test_values_stay_in_range_and_repeat_with_the_longest_period() -> None:
    texels = np.random.default_rng(0).uniform(-100.0, 100.0, (500, 2))
    encoded = positional_encoding(texels, 3)
    assert encoded.shape == (500, 12)
    assert np.abs(encoded).max() <= 1.0
    np.testing.assert_allclose(positional_encoding(texels + 8.0, 3), encoded, atol=1e-12)


def test_texels_of_one_latent_cell_differ() -> None:
    texels = np.stack(np.meshgrid(np.arange(8) + 0.5, np.arange(8) + 0.5), axis=-1).reshape(-1, 2)
    assert len(np.unique(np.round(positional_encoding(texels, 3), 9), axis=0)) == 64
