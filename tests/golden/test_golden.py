"""The built-in scene looks as it did when somebody last looked: to the bit where the accepted pictures were drawn."""

import json
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
import pytest

from tests.golden import pictures
from tests.golden.pictures import FOLDER, HALF_PATHS, SLOTS, GoldenPicture, Studio
from viewer.state.view_state import Precision, Slot

TOLERANCE = 1
"""Of 255, under another llvmpipe than the recorded one, and zink on lavapipe."""
ALLOWED_SHARE = 0.001
"""Of the pixels that may differ by more, there: at edges, where a triangle covers a pixel or not."""


@pytest.fixture(scope="module")
def studio() -> Iterator[Studio]:
    made = Studio()
    yield made
    made.release()


@pytest.mark.parametrize("slot", SLOTS, ids=lambda slot: f"{slot.source}-{slot.path}")
def test_pictures_are_as_accepted(studio: Studio, slot: Slot) -> None:
    drawn = [picture for picture in studio.pictures() if picture.slot == slot]
    assert len(drawn) >= 5
    compare(studio, drawn)


def test_divergence_maps_are_as_accepted(studio: Studio) -> None:
    compare(studio, studio.maps())


def test_pictures_of_path_cached_are_as_accepted(studio: Studio) -> None:
    compare(studio, studio.cached())


def test_other_paths_and_groupings_of_codec_block_are_as_accepted(studio: Studio) -> None:
    compare(studio, studio.blocks())


@pytest.mark.once
@pytest.mark.parametrize(
    "precision", ["fp16", "fp16-accumulate", pytest.param("fp16-arithmetic", marks=pytest.mark.guards("drawing"))]
)
def test_pictures_in_halves_are_as_accepted(studio: Studio, precision: Precision) -> None:
    assert precision in HALF_PATHS
    compare(studio, studio.halves(precision))


def test_every_accepted_picture_is_compared(studio: Studio) -> None:
    assert {picture.path for picture in studio.all_pictures()} == set(FOLDER.glob("*.png"))


def test_a_picture_that_differs_is_kept(studio: Studio, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pictures, "FAILED", tmp_path / "failed")
    picture = studio.cached()[0]
    image = studio.draw(picture)
    assert picture.share_beyond(image, TOLERANCE) == 0.0
    assert not (tmp_path / "failed").exists()
    image[:45] = 255 - image[:45]
    assert picture.share_beyond(image, TOLERANCE) > 0.4
    assert sorted(file.name for file in (tmp_path / "failed").iterdir()) == [
        f"{picture.path.stem}.{kind}.png" for kind in ("difference", "drawn")
    ]
    with pytest.raises(AssertionError, match=r"entrance.clustered-cached.png: 50.000% of the pixels"):
        assert_accepted({picture: image}, 0, 0.0)


def compare(studio: Studio, golden: Sequence[GoldenPicture]) -> None:
    """Draw and compare with what was accepted: exactly under the recorded renderer, within TOLERANCE under any other llvmpipe
    and zink on lavapipe, but for what OpenGL leaves to the driver."""
    drawn = {picture: studio.draw(picture) for picture in golden}
    for picture, image in drawn.items():
        assert image.std() > 5.0, f"{picture.path.name}: nothing to see"
    recorded, here = json.loads((FOLDER / "renderer.json").read_text()), studio.renderer_description()
    if recorded == here:
        assert_accepted(drawn, 0, 0.0)
    elif "llvmpipe" in here["renderer"]:
        same = {picture: image for picture, image in drawn.items() if not picture.is_filtered_by_driver}
        assert_accepted(same, TOLERANCE, ALLOWED_SHARE)
    else:
        pytest.skip(f"accepted pictures are from {recorded}, this is {here}")


def assert_accepted(drawn: dict[GoldenPicture, np.ndarray], tolerance: int, allowed_share: float) -> None:
    """All of `drawn` are as accepted, but for a share of the pixels; says of all that are not."""
    shares = {picture.path.name: picture.share_beyond(image, tolerance) for picture, image in drawn.items()}
    wrong = [
        f"{name}: {share:.3%} of the pixels differ by more than {tolerance} of 255"
        for name, share in shares.items()
        if share > allowed_share
    ]
    assert not wrong, "\n".join([*wrong, f"drawn and differences: {pictures.FAILED}"])
