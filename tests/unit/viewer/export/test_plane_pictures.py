"""Pictures of original planes as exported pages read them."""

from types import SimpleNamespace
from typing import cast

import numpy as np

from viewer.export.web.packed import plane_picture
from viewer.scene.model import SceneTexture


def test_maps_that_a_texture_lacks_are_neutral() -> None:
    roughness = np.full((2, 3, 1), 77, np.uint8)
    texture = cast(SceneTexture, SimpleNamespace(size=(3, 2), further_maps={"roughness": roughness}))
    surface = plane_picture(texture, "surface")
    assert surface.shape == (4, 3, 3)
    # No tilt, the roughness, and below them a factor of 1 for metalness.
    assert np.all(surface[:2] == (128, 128, 77))
    assert np.all(surface[2:] == 255)
    assert np.all(plane_picture(texture, "emission") == 255)
