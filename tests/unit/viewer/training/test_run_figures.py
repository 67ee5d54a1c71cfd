"""Figures of runs for the window."""

import math

import pytest

from viewer.training.run_figures import psnr_ends
from viewer.training.run_log import Curves


def test_the_range_of_psnr_holds_every_drawn_point() -> None:
    curves = Curves([0.0, 1.0, 2.0], {}, {0: [math.nan, 30.0, 31.0], 1: [25.0, 26.0, 60.0]}, [25.0, 28.0, 41.0])
    low, high = psnr_ends(curves, 0)
    assert low == pytest.approx(25.0, abs=1.0)
    assert 41.0 < high < 43.0
    assert psnr_ends(curves, 1)[1] > 60.0
    assert psnr_ends(Curves([0.0], {}, {0: [60.0]}, [40.0]), 0)[1] > 60.0


def test_curves_of_one_value_and_of_none_have_a_range() -> None:
    low, high = psnr_ends(Curves([0.0], {}, {}, [37.0]), None)
    assert low < 37.0 < high
    low, high = psnr_ends(Curves([0.0], {}, {}, [math.inf]), None)
    assert low < high
