"""Original images under a budget: the same picture where there is room for what is in sight, a coarser one where there is not."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.support.picture_scenes import WHITE, cube, placed, scene_of, texture
from viewer.gl.context import GraphicsContext
from viewer.render.frames import read_picture
from viewer.render.image_sources import ImageSources
from viewer.render.renderer import Renderer
from viewer.scene.model import Camera, Material, Scene
from viewer.state.view_state import REFERENCE, Slot, ViewState

COUNT = 9
SIZE = (96, 64)
ABOVE = Camera("above", (0.0, 0.0, 40.0), (0.0, 0.0, 0.0))
CLOSE = Camera("close", (0.0, 0.0, 4.0), (0.0, 0.0, 0.0), fov_degrees=30.0)


def scene() -> Scene:
    """Cubes in a row, each with an image of 64 texels a side."""
    parts = [cube(number, placed(x=4.0 * (number - COUNT // 2))) for number in range(COUNT)]
    materials = [Material(f"{number}", number, WHITE) for number in range(COUNT)]
    return scene_of(parts, materials, [texture(64, 64, number) for number in range(COUNT)])


def view(camera: Camera) -> ViewState:
    return ViewState(camera, SIZE, Slot(REFERENCE), Slot(REFERENCE), material_view="base")


@pytest.fixture
def bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    """Room for two images of nine."""
    monkeypatch.setattr(
        "viewer.render.renderer.ImageSources", partial(ImageSources, most_bytes=2 * 64 * 64 * 4 * 4 // 3)
    )


@pytest.fixture
def expected(graphics: GraphicsContext) -> dict[str, NDArray[np.uint8]]:
    """Pictures by camera, drawn with room for all images."""
    renderer = Renderer(graphics, scene())
    pictures = {camera.name: read_picture(renderer.render(view(camera)).image) for camera in (ABOVE, CLOSE)}
    renderer.release()
    return pictures


@pytest.mark.once
def test_what_there_is_room_for_is_as_without_a_budget(
    graphics: GraphicsContext, expected: dict[str, NDArray[np.uint8]], request: pytest.FixtureRequest
) -> None:
    request.getfixturevalue("bounded")
    renderer = Renderer(graphics, scene())
    for camera in (CLOSE, ABOVE, CLOSE):
        # From above no pixel reads a mip that is left out.
        np.testing.assert_array_equal(read_picture(renderer.render(view(camera)).image), expected[camera.name])
    assert renderer.images.largest_side == 64
    renderer.release()


@pytest.mark.once
def test_images_that_come_beside_the_frames_end_in_the_same_picture(
    graphics: GraphicsContext, expected: dict[str, NDArray[np.uint8]], request: pytest.FixtureRequest
) -> None:
    request.getfixturevalue("bounded")
    renderer = Renderer(replace(graphics, waits=False), scene())
    for camera in (ABOVE, CLOSE, ABOVE):
        frame = renderer.render(view(camera))
        while not frame.is_complete:
            frame = renderer.render(view(camera))
        np.testing.assert_array_equal(read_picture(frame.image), expected[camera.name])
    renderer.release()
