"""Triangle-wave positional encoding."""

import numpy as np

from ntc.codec.positional import positional_encoding, triangle_wave


def test_wave_has_period_1_and_known_values() -> None:
    np.testing.assert_allclose(
        triangle_wave(np.array([0.0, 0.25, 0.5, 0.75, 1.0, -0.25, 7.5])), [1, 0, -1, 0, 1, 0, -1]
    )


def test_order_is_axis_octave_phase() -> None:
    x, y = 0.7, 5.3
    expected = []
    for coordinate in (x, y):
        for period in (2.0, 4.0, 8.0):
            for phase in (0.0, 0.25):
                turn = coordinate / period + phase
                expected.append(4.0 * abs(turn - np.floor(turn) - 0.5) - 1.0)
    np.testing.assert_allclose(positional_encoding(np.array([[x, y]]), 3)[0], expected)


def test_values_stay_in_range_and_repeat_with_the_longest_period() -> None:
    texels = np.random.default_rng(0).uniform(-100.0, 100.0, (500, 2))
    encoded = positional_encoding(texels, 3)
    assert encoded.shape == (500, 12)
    assert np.abs(encoded).max() <= 1.0
    np.testing.assert_allclose(positional_encoding(texels + 8.0, 3), encoded, atol=1e-12)


def test_texels_of_one_latent_cell_differ() -> None:
    texels = np.stack(np.meshgrid(np.arange(8) + 0.5, np.arange(8) + 0.5), axis=-1).reshape(-1, 2)
    assert len(np.unique(np.round(positional_encoding(texels, 3), 9), axis=0)) == 64
