"""Which surface is seen: against a ray caster, against drawing everything, and forward against deferred."""

from collections.abc import Iterator

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.gl.small_scenes import CAMERAS, FLAT, INSIDE, SCENES, pack_of
from tests.support.ray_caster import cast_scene
from viewer.gl.context import GraphicsContext
from viewer.render.renderer import Renderer
from viewer.render.resources import culling
from viewer.scene.model import Camera, Scene
from viewer.state.view_state import Slot, ViewState

SIZE = (120, 72)


@pytest.fixture(scope="module", params=SCENES)
def drawn(request: pytest.FixtureRequest, graphics: GraphicsContext) -> Iterator[tuple[Scene, Renderer]]:
    """Each small scene with its renderer and a pack of its textures."""
    scene = SCENES[request.param]()
    with pytest.MonkeyPatch.context() as patched:
        # Small clusters, so that small scenes have many.
        patched.setattr(culling, "CPU_CLUSTER_TRIANGLES", 12)
        renderer = Renderer(graphics, scene)
    renderer.set_packs({"p": pack_of(scene)})
    yield scene, renderer
    renderer.release()


@pytest.mark.parametrize("camera", CAMERAS, ids=lambda camera: camera.name)
def test_texture_ids_agree_with_a_ray_caster(drawn: tuple[Scene, Renderer], camera: Camera) -> None:
    scene, renderer = drawn
    renderer.render(ViewState(camera, SIZE))
    cast = cast_scene(scene, camera, SIZE)
    covered, cast_covered = renderer.covered(), cast.material >= 0
    either = covered | cast_covered
    assert cast_covered.mean() > 0.2
    assert (covered != cast_covered)[either].mean() <= 0.005
    same = renderer.texture_ids() == cast.texture_id
    assert same[either].mean() >= 0.995
    assert len(np.unique(cast.texture_id[cast_covered])) >= 2


def everything(renderer: Renderer, camera: Camera, monkeypatch: pytest.MonkeyPatch) -> NDArray[np.float32]:
    """The reference picture with nothing culled."""
    with monkeypatch.context() as patched:
        patched.setattr(culling, "frustum_planes", lambda matrix: np.zeros((6, 4)))
        patched.setattr(culling.Culling, "_faces_away", lambda self, eye, rows: np.zeros(len(rows), bool))
        frame = renderer.render(ViewState(camera, (SIZE[0] + 1, SIZE[1])))
        assert frame.skipped["clusters_culled"] == 0
        return renderer.picture(Slot())


@pytest.mark.parametrize("camera", CAMERAS, ids=lambda camera: camera.name)
def test_culling_changes_no_pixel(
    drawn: tuple[Scene, Renderer], camera: Camera, monkeypatch: pytest.MonkeyPatch
) -> None:
    _, renderer = drawn
    whole = everything(renderer, camera, monkeypatch)
    renderer.render(ViewState(camera, SIZE))
    frame = renderer.render(ViewState(camera, (SIZE[0] + 1, SIZE[1])))
    assert np.array_equal(renderer.picture(Slot()), whole)
    assert frame.drawn["triangles"] > 0


def test_a_camera_inside_sees_less_and_draws_less(drawn: tuple[Scene, Renderer]) -> None:
    _, renderer = drawn
    inside = renderer.render(ViewState(INSIDE, SIZE))
    flat = renderer.render(ViewState(FLAT, SIZE))
    assert inside.skipped["clusters_culled"] > 0
    assert inside.drawn["triangles"] + inside.skipped["triangles_culled"] == (
        flat.drawn["triangles"] + flat.skipped["triangles_culled"]
    )
