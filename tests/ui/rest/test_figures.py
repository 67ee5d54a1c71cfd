"""What panels say of the picture: figures are called current only beside the picture that `render` draws, and are those of it."""

from pathlib import Path

import pytest

from tests.support.rest.records import ALONE, share_equal
from tests.support.rest.truth import LEAST_SHARE, Truth
from tests.ui.rest.conftest import Start

pytestmark = [pytest.mark.process, pytest.mark.slow, pytest.mark.nightly]

WITH_PANELS = {**ALONE, "show_panels": True}
SIZE = (1000, 600)
LARGEST_ERROR_DB = 0.01


@pytest.mark.parametrize(
    ("path", "slowest"),
    [
        ("deferred", 1.5),
        ("deferred", 0.0),
        ("cached", 0.0),
        ("cached", 1.5),
    ],
)
def test_figures_are_of_the_final_picture(start: Start, truth: Truth, wall: Path, path: str, slowest: float) -> None:
    """`slowest`: seconds by which answers of the GPU may come later."""
    played = start(
        *(str(wall), "--path", path), settings=WITH_PANELS, size=SIZE, records_figures=True, slowest_answer=slowest
    )
    rest = played.of("start")
    right = truth.picture(rest)
    current = [figures for figures in rest.figures if figures.is_current]
    assert current, "the window rests without figures"
    equal = [share_equal(figures.picture, right) for figures in current if figures.picture is not None]
    assert len(equal) == len(current)
    wrong = [
        f"frame {figures.frame} of {rest.frames}: {figures.psnr_db:.2f} dB beside a picture of which {100 * share:.2f} % is right"
        for figures, share in zip(current, equal, strict=True)
        if share < LEAST_SHARE
    ]
    assert not wrong, wrong[0]
    assert current[-1].psnr_db == pytest.approx(truth.figure(rest), abs=LARGEST_ERROR_DB)
