"""The built-in scene looks as it did when somebody last looked."""

import json
from collections.abc import Iterator, Sequence

import numpy as np
import pytest

from tests.golden.pictures import FOLDER, SLOTS, GoldenPicture, Studio
from viewer.scene.images import read_image
from viewer.state.view_state import Slot

TOLERANCE = 2
ALLOWED_SHARE = 0.001


@pytest.fixture(scope="module")
def studio() -> Iterator[Studio]:
    made = Studio()
    yield made
    made.renderer.release()


@pytest.mark.parametrize("slot", SLOTS, ids=lambda slot: f"{slot.source}-{slot.path}")
def test_pictures_are_as_accepted(studio: Studio, slot: Slot) -> None:
    pictures = [picture for picture in studio.pictures() if picture.slot == slot]
    assert len(pictures) >= 5
    compare(studio, pictures)


def test_divergence_maps_are_as_accepted(studio: Studio) -> None:
    compare(studio, studio.maps())


def compare(studio: Studio, pictures: Sequence[GoldenPicture]) -> None:
    """Draw and compare with what was accepted; skips on another renderer."""
    drawn = {picture: studio.draw(picture) for picture in pictures}
    for picture, image in drawn.items():
        assert image.std() > 5.0, f"{picture.path.name}: nothing to see"
    recorded = json.loads((FOLDER / "renderer.json").read_text())
    if recorded != studio.renderer_description():
        pytest.skip(f"accepted pictures are from {recorded}, this is {studio.renderer_description()}")
    for picture, image in drawn.items():
        accepted = read_image(picture.path)[..., :3]
        difference = np.abs(image.astype(int) - accepted.astype(int)).max(axis=-1)
        share = float((difference > TOLERANCE).mean())
        assert share <= ALLOWED_SHARE, f"{picture.path.name}: {share:.2%} of the pixels differ by more than {TOLERANCE}"
