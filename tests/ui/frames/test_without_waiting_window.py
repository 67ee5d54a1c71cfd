"""The window's way of drawing, which does not wait for the GPU: 120 frames moving through the built-in scene wait for nothing."""

from collections.abc import Iterator
from dataclasses import replace
from unittest import mock

import pytest

from lab.bench.scene import nudged
from tests.support.blocking_watch import watched_calls
from tests.support.driven_app import DrivenApp
from viewer.gl.context import GraphicsContext, create_headless_context
from viewer.locations import builtin_scene_path
from viewer.scene.load import load_scene
from viewer.state.navigation import turned
from viewer.state.pack_files import open_packs, packs_beside
from viewer.state.settings import ViewerSettings
from viewer.state.view_state import Slot

FRAMES = 120
SIZE = (640, 400)
SLOT = Slot("clustered", "cached")


def late_context(device: str | None) -> GraphicsContext:
    """A context whose frames go on without waiting for the GPU, as those of a window do."""
    return replace(create_headless_context(device), waits=False)


@pytest.fixture(scope="module")
def drawn(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[DrivenApp, list[str]]]:
    """An app that has come to rest, and the calls that wait, as they are made."""
    path = builtin_scene_path()
    with watched_calls() as calls:
        scene, packs = load_scene(path), open_packs(packs_beside(path))
        settings = ViewerSettings(coarse_while_moving=False, column_folded=False)
        with mock.patch("viewer.app.headless.create_headless_context", late_context):
            app = DrivenApp(scene, packs, SIZE, tmp_path_factory.mktemp("pictures"), settings)
        app.session.view = replace(app.session.view, slot_a=SLOT, slot_b=SLOT, compare="a", material_view="base")
        app.settle()
        app.rest()
        yield app, calls
        app.close()


MIDDLE = (0.5, 0.5)
"""Of the picture, as shares."""


def test_nothing_waits_in_motion(drawn: tuple[DrivenApp, list[str]]) -> None:
    """With the panel of times, the pixel and the block at a place, and the map of decoders."""
    app, calls = drawn
    camera = app.session.view.camera
    app.show_panel("Memory")
    overlay = app.session.view.overlay
    app.session.view = replace(app.session.view, overlay=replace(overlay, kind="divergence"))
    app.session.inspection.pixel = app.session.inspection.block = MIDDLE
    app.show_panel("Pixel")
    app.show_panel("Timings")
    app.run("camera.set", turned(camera, 0.2))
    app.rest()
    calls.clear()
    counts, timed, reads = list[int](), 0, app.frontend.reader.pixels.reads
    for number in range(FRAMES):
        app.run("camera.set", nudged(turned(camera, 0.2 * min(number, FRAMES - number)), number))
        app.frame()
        last = app.frontend.picture.last
        assert last is not None
        counts.append(last.blocking_calls)
        timed += bool(last.timings_ms)
    assert calls == []
    assert counts == [0] * FRAMES
    facts = app.frontend.facts()
    assert facts.frame.blocking_calls == 0
    # Times arrive some frames later.
    assert timed > 0
    assert facts.pixel is not None
    assert facts.block is not None
    assert app.frontend.reader.pixels.reads - reads >= FRAMES - 1
    app.session.view = replace(app.session.view, overlay=overlay)
    app.session.inspection.pixel = app.session.inspection.block = None
    app.run("camera.set", camera)
