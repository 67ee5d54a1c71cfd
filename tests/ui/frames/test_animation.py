"""Animations in the window: the time line plays, scrubs, rests, and is not offered where nothing moves."""

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.gl.render.test_poses import moving_scene
from tests.support.driven_app import DrivenApp
from tests.support.gltf_builder import GltfBuilder
from tests.ui.conftest import Opener
from viewer.commands import run
from viewer.render.frames import read_picture
from viewer.scene.load import load_scene
from viewer.scene.model import Pose

SIZE = (900, 600)


@pytest.fixture
def app(open_window: Opener) -> DrivenApp:
    made = open_window(SIZE, moving_scene())
    made.settle()
    made.show_panel("Scene")
    return made


def picture(app: DrivenApp) -> NDArray[np.int64]:
    app.settle()
    # What moves is drawn coarser until it has rested for a while.
    while app.frontend.picture.is_coarse():
        app.frame()
    app.frame()
    shown = app.frontend.picture.last
    assert shown is not None
    return read_picture(shown.image).astype(np.int64)


def test_the_time_line_plays_pauses_and_rests(app: DrivenApp) -> None:
    session, at_rest = app.session, picture(app)
    app.click("Play")
    assert session.is_moving
    for _ in range(30):
        app.frame()
    assert session.view.pose is not None
    assert session.view.pose.animation == "move"
    assert 0.0 < session.view.pose.seconds < 2.0
    app.click("Play")
    assert not session.is_moving
    paused = session.view.pose
    moved = picture(app)
    assert np.abs(moved - at_rest).max() > 50
    assert session.view.pose == paused
    app.click("Rest")
    assert session.view.pose is None
    # The first one was posed in double precision.
    assert (np.abs(picture(app) - at_rest) <= 1).mean() >= 0.999


def test_a_moment_can_be_chosen_while_it_plays(app: DrivenApp) -> None:
    session = app.session
    run(app.context, "animation.speed", 0.5)
    run(app.context, "animation.repeat")
    run(app.context, "animation.play")
    run(app.context, "animation.time", 1.999)
    for _ in range(200):
        app.frame()
        if not session.is_moving:
            break
    assert (session.is_moving, session.view.pose) == (False, Pose("move", 2.0))
    # From its end it begins anew.
    run(app.context, "animation.play")
    assert session.view.pose == Pose("move", 0.0)


def test_a_moment_at_which_transforms_overflow_is_one_message_and_the_scene_at_rest(
    open_window: Opener, tmp_path: Path
) -> None:
    builder = GltfBuilder()
    builder.add("nodes", children=[1])
    builder.add("nodes", mesh=builder.mesh(builder.triangle()), scale=[10.0, 10.0, 10.0])
    sizes = np.array([[1, 1, 1], [3e38, 3e38, 3e38]], np.float32)
    sampler = {"input": builder.accessor(np.array([0.0, 1.0], np.float32)), "output": builder.accessor(sizes)}
    channel = {"sampler": 0, "target": {"node": 0, "path": "scale"}}
    builder.add("animations", name="grow", samplers=[sampler], channels=[channel])
    app = open_window(SIZE, load_scene(builder.write(tmp_path / "grow.glb")))
    at_rest = picture(app)
    run(app.context, "animation.play")
    run(app.context, "animation.time", 1.0)
    for _ in range(5):
        app.frame()
    texts = [toast.text for toast in app.session.window.toasts]
    assert len([text for text in texts if "overflows" in text]) == 1
    assert (app.session.is_moving, app.session.view.pose) == (False, None)
    np.testing.assert_array_equal(picture(app), at_rest)
