"""Lit pictures at the edges: no scene, tiny, huge and flat ones, suns straight above and below, parallel rays, blinding light."""

from dataclasses import replace

import numpy as np
import pytest

from tests.support.picture_scenes import WHITE, Part, cube, placed, scene_of, straight_camera
from viewer.gl.context import GraphicsContext
from viewer.render.renderer import Renderer
from viewer.scene.model import Camera, Material, Scene
from viewer.state.framing import frame_all
from viewer.state.view_state import STUDIO, Lighting, Slot, ViewState

PLAIN = [Material("m", -1, WHITE)]
CUBE = scene_of([cube(0)], PLAIN)
SCENES = {
    "nothing": scene_of([], []),
    "tiny and far": scene_of([cube(0, placed(1e4, 0.0, 1e4, (1e-3, 1e-3, 1e-3)))], PLAIN),
    "huge": scene_of([cube(0, placed(0.0, 0.0, 0.0, (1e7, 1e7, 1e7)))], PLAIN),
    "flat": scene_of([Part(0)], PLAIN),
}
LIGHTINGS = {
    "zenith": Lighting(sun_elevation=90.0),
    "nadir": Lighting(sun_elevation=-90.0),
    "horizon": Lighting(sun_elevation=0.0, sun_azimuth=720.0),
    "blinding": Lighting(exposure=40.0, sun_strength=1e6, tone_map="agx"),
    "studio": Lighting(environment=STUDIO, sun_strength=0.0),
    "black": Lighting(exposure=-200.0),
}
CAMERAS = {
    "parallel rays": Camera("c", (3.0, 3.0, 3.0), (0.0, 0.0, 0.0), orthographic_height=4.0),
    "inside": Camera("c", (0.0, 0.0, 0.0), (0.0, 0.0, 1.0)),
}


def lit(graphics: GraphicsContext, scene: Scene, camera: Camera, lighting: Lighting) -> np.ndarray:
    """[H, W, 3] linear picture, checked to be one."""
    renderer = Renderer(graphics, scene)
    renderer.render(ViewState(camera, (64, 48), material_view="lit", lighting=lighting), whole=True)
    picture = renderer.picture(Slot())
    renderer.release()
    assert np.isfinite(picture).all()
    assert picture.min() >= 0.0
    assert picture.max() <= 1.0
    return picture


@pytest.mark.parametrize("name", SCENES)
def test_scenes_of_any_size_are_lit(graphics: GraphicsContext, name: str) -> None:
    scene = SCENES[name]
    assert lit(graphics, scene, frame_all(scene), Lighting()).max() > 0.2


@pytest.mark.parametrize("name", LIGHTINGS)
def test_any_light_makes_a_picture(graphics: GraphicsContext, name: str) -> None:
    picture = lit(graphics, CUBE, frame_all(CUBE), LIGHTINGS[name])
    assert (picture.mean() > 0.01) == (name not in ("nadir", "black"))


@pytest.mark.parametrize("name", CAMERAS)
def test_any_camera_sees_light(graphics: GraphicsContext, name: str) -> None:
    both_sides = replace(CUBE, materials=(replace(PLAIN[0], double_sided=True),))
    assert lit(graphics, both_sides, CAMERAS[name], Lighting()).mean() > 0.05


def test_a_pattern_stands_for_an_image_that_is_missing(graphics: GraphicsContext) -> None:
    scene = scene_of([Part(0)], [Material("m", -1, WHITE, missing_base=True)])
    renderer = Renderer(graphics, scene)
    renderer.render(ViewState(straight_camera(), (64, 64)), whole=True)
    picture = renderer.picture(Slot())
    renderer.release()
    square = picture[4::8, 4::8]
    assert not np.allclose(square[0, 0], square[0, 1], atol=0.1)
    np.testing.assert_allclose(square[1:, 1:], square[:-1, :-1], atol=1e-3)
