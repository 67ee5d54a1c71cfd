"""The window's way of drawing, which does not wait for the GPU: 300 frames moving through the built-in scene wait for nothing."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from lab.bench.scene import nudged
from tests.support.blocking_watch import watched_calls
from tests.support.driven_app import DrivenApp
from viewer.locations import builtin_scene_path
from viewer.render.renderer import Renderer
from viewer.scene.load import load_scene
from viewer.state.navigation import turned
from viewer.state.pack_files import open_packs, packs_beside
from viewer.state.settings import ViewerSettings
from viewer.state.view_state import Slot

FRAMES = 300
SIZE = (640, 400)
SLOT = Slot("clustered", "cached")
MOST_FRAMES = 2000
"""Of a picture that comes to rest."""


class WindowLikeApp(DrivenApp):
    """Draws as a window does."""

    waits = False


@pytest.fixture(scope="module")
def drawn(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[WindowLikeApp, list[str]]]:
    """An app that has come to rest, and the calls that wait, as they are made."""
    path = builtin_scene_path()
    with watched_calls() as calls:
        scene, packs = load_scene(path), open_packs(packs_beside(path))
        settings = ViewerSettings(coarse_while_moving=False, column_folded=False)
        app = WindowLikeApp(scene, packs, SIZE, tmp_path_factory.mktemp("pictures"), settings)
        app.session.view = replace(app.session.view, slot_a=SLOT, slot_b=SLOT, compare="a", material_view="base")
        app.settle()
        rest(app)
        yield app, calls
        app.close()


def rest(app: WindowLikeApp) -> None:
    """Draw until the picture is whole."""
    for _ in range(MOST_FRAMES):
        app.frame()
        if app.is_settled:
            return
    raise AssertionError("the picture does not come to rest")


@pytest.mark.parametrize("panel", ["Memory", "Timings"])
def test_nothing_waits_in_motion(drawn: tuple[WindowLikeApp, list[str]], panel: str) -> None:
    app, calls = drawn
    camera = app.session.view.camera
    app.show_panel(panel)
    app.run("camera.set", turned(camera, 0.2))
    rest(app)
    calls.clear()
    counts, timed = list[int](), 0
    for number in range(FRAMES):
        app.run("camera.set", nudged(turned(camera, 0.2 * min(number, FRAMES - number)), number))
        app.frame()
        last = app.frontend.picture.last
        assert last is not None
        counts.append(last.blocking_calls)
        timed += bool(last.timings_ms)
    assert calls == []
    assert counts == [0] * FRAMES
    assert app.frontend.facts().blocking_calls == 0
    # Without the panel nothing is measured; with it times arrive, some frames later.
    assert (timed == 0) if panel == "Memory" else (timed > 0)
    app.run("camera.set", camera)


def test_the_picture_at_rest_is_that_of_a_renderer_that_waits(drawn: tuple[WindowLikeApp, list[str]]) -> None:
    app, _ = drawn
    app.show_panel("Memory")
    rest(app)
    shown, view = app.frontend.picture.renderer, app.frontend.picture.last_view
    assert shown is not None
    assert view is not None
    exact = Renderer(app.graphics, app.session.scene)
    exact.set_packs(app.session.packs)
    exact.render(view, whole=True)
    np.testing.assert_allclose(shown.picture(SLOT), exact.picture(SLOT), rtol=0, atol=1 / 256)
    exact.release()
