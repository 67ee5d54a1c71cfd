"""Tone maps against their published formulas, written out for one colour at a time."""

import math

import numpy as np
import pytest

from viewer.lighting.directions import Array
from viewer.lighting.tone_maps import TONE_MAPS, tone_mapped
from viewer.state.view_state import ToneMap

COLORS = np.concatenate(
    [
        np.random.default_rng(0).uniform(0.0, 1.0, (50, 3)),
        np.exp(np.random.default_rng(1).uniform(-9.0, 6.0, (50, 3))),
        [[0.0, 0.0, 0.0], [0.76, 0.76, 0.76], [0.8, 0.8, 0.8], [1e4, 0.0, 0.0], [0.08, 0.5, 0.08]],
    ]
)


def neutral(color: list[float]) -> list[float]:
    """KhronosGroup/ToneMapping, PBR_Neutral/README.md."""
    start, desaturation = 0.8 - 0.04, 0.15
    x = min(color)
    offset = x - 6.25 * x * x if x < 0.08 else 0.04
    color = [channel - offset for channel in color]
    peak = max(color)
    if peak < start:
        return color
    d = 1.0 - start
    new_peak = 1.0 - d * d / (peak + d - start)
    color = [channel * new_peak / peak for channel in color]
    g = 1.0 - 1.0 / (desaturation * (peak - new_peak) + 1.0)
    return [channel * (1.0 - g) + new_peak * g for channel in color]


def test_neutral_is_khronos_pbr_neutral() -> None:
    expected = [neutral(color) for color in COLORS.tolist()]
    np.testing.assert_allclose(TONE_MAPS["neutral"](COLORS), expected, atol=1e-12)


def agx_grey(value: float) -> float:
    """AgX of a grey, whose matrices have rows that sum to 1: the fitted curve alone."""
    x = (min(max(math.log2(value), -12.47393), 4.026069) + 12.47393) / (4.026069 + 12.47393)
    powers = (-0.00232, 0.1191, 0.4298, -6.868, 31.96, -40.14, 15.5)
    return max(0.0, min(1.0, sum(factor * x**power for power, factor in enumerate(powers)))) ** 2.2


def test_agx_of_greys_is_the_published_curve() -> None:
    values = np.exp2(np.linspace(-13.0, 5.0, 30))
    found = TONE_MAPS["agx"](np.repeat(values[:, None], 3, axis=1))
    np.testing.assert_allclose(found, [[agx_grey(value)] * 3 for value in values.tolist()], atol=1e-3)


@pytest.mark.parametrize("tone_map", ["neutral", "agx", "none"])
def test_results_are_pictures_and_grow_with_light(tone_map: ToneMap) -> None:
    mapped: Array = tone_mapped(COLORS, 0.0, tone_map)
    assert np.isfinite(mapped).all()
    assert mapped.min() >= 0.0
    assert mapped.max() <= 1.0
    greys = tone_mapped(np.repeat(np.geomspace(1e-3, 100.0, 200)[:, None], 3, axis=1), 0.0, tone_map)
    assert (np.diff(greys[:, 0]) > -2e-3).all()


def test_exposure_is_in_stops_and_negative_light_is_none() -> None:
    np.testing.assert_allclose(tone_mapped(np.array([[0.1, 0.2, 0.3]]), 1.0, "none"), [[0.2, 0.4, 0.6]])
    assert not tone_mapped(np.array([[-1.0, 0.0, 0.0]]), 0.0, "neutral").any()
