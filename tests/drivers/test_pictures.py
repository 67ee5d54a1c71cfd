"""Pictures look the same with this driver as with the system's, which `python -m tests.drivers` has drawn before."""

import os
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from tests.drivers.pictures import PICTURES, SLOTS
from tests.golden.pictures import Studio
from viewer.gl.program import ShaderError
from viewer.render.path_choice import drawable_paths
from viewer.scene.images import read_image, write_png
from viewer.state.view_state import FILTERED_PATHS, Slot

pytestmark = pytest.mark.driver

FOLDER_VARIABLE = "NTC_VIEWER_SYSTEM_PICTURES"
TOLERANCE = 1
"""Of 255."""
ALLOWED_SHARE = 0.001
"""Of the pixels that may differ by more: at silhouettes, where a triangle covers a pixel or not."""


@pytest.fixture(scope="module")
def accepted() -> Path:
    """Folder of the system driver's pictures."""
    if FOLDER_VARIABLE not in os.environ:
        pytest.skip("there is one driver; python -m tests.drivers compares several")
    return Path(os.environ[FOLDER_VARIABLE])


@pytest.fixture(scope="module")
def studio(accepted: Path) -> Iterator[Studio]:
    """The built-in scene, drawn with this driver."""
    assert accepted.is_dir()
    made = Studio()
    yield made
    made.release()


@pytest.mark.parametrize("slot", SLOTS, ids=lambda slot: f"{slot.source}-{slot.path}-{slot.precision}-{slot.filter}")
def test_pictures_are_those_of_the_systems_driver(studio: Studio, accepted: Path, tmp_path: Path, slot: Slot) -> None:
    if slot.path in FILTERED_PATHS and slot.path not in drawable_paths(studio.context):
        pytest.skip(f"path {slot.path} needs compute shaders; forward replaces it, with another filter")
    beyond = dict[str, float]()
    for picture in PICTURES:
        if picture.slot != slot:
            continue
        try:
            drawn = picture.draw(studio)
        except ShaderError as error:
            if "computing needs OpenGL" not in str(error):
                raise
            pytest.skip(str(error))
        expected = read_image(accepted / picture.name)[..., :3]
        assert drawn.std() > 5.0, f"{picture.name}: nothing to see"
        apart = np.abs(drawn.astype(int) - expected.astype(int)).max(axis=-1)
        beyond[picture.name] = float((apart > TOLERANCE).mean())
        write_png(tmp_path / picture.name, drawn)
    assert beyond
    assert max(beyond.values()) <= ALLOWED_SHARE, f"{beyond}; drawn: {tmp_path}"
