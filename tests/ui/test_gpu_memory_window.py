"""The window while the GPU has no memory: it stays open, says so once, and shows what it can."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from ntc.pack.file import read_pack, write_pack
from tests.end_to_end.conftest import two_squares
from tests.support.driven_app import DrivenApp
from tests.ui.conftest import SIZE, Opener
from viewer.gl.allocation import GpuMemoryError
from viewer.state.view_state import REFERENCE

Refuse = Callable[[DrivenApp, str], None]


@pytest.fixture
def refuse(monkeypatch: pytest.MonkeyPatch) -> Refuse:
    """From now on the GPU has no memory for what has this in its name; "" for anything."""

    def begin(app: DrivenApp, word: str) -> None:
        monkeypatch.setattr(app.graphics.memory, "allows", lambda what, _size: word not in what)

    return begin


@pytest.fixture
def bare(open_window: Opener) -> DrivenApp:
    """A window that has drawn nothing yet."""
    return open_window(live_figures=False, column_folded=False)


def errors(app: DrivenApp) -> list[str]:
    return [entry.text for entry in app.session.window.log if entry.kind == "error"]


def picture(app: DrivenApp) -> NDArray[np.uint8]:
    """The scene's part of the window at rest: messages and panels lie elsewhere."""
    app.rest()
    frontend = app.frontend
    assert frontend.picture.last is not None
    image = frontend.picture.last.image
    return np.frombuffer(image.read(), np.uint8).reshape(image.height, image.width, 4).copy()


def test_a_pack_is_refused_by_name_and_the_others_stay(app: DrivenApp, scene_path: Path, refuse: Refuse) -> None:
    before, view, packs = picture(app), app.session.view, app.session.packs
    more = scene_path.with_name("scene.more.ntc")
    write_pack(more, read_pack(scene_path.with_name("scene.single.ntc")))
    refuse(app, "latents")
    app.drop(more)
    more.unlink()
    assert [line.split(": the GPU")[0] for line in errors(app)] == ["pack scene.more: latents"]
    assert app.session.packs is packs
    assert app.session.view == view
    np.testing.assert_array_equal(picture(app), before)
    assert not app.frontend.needs_frame(SIZE)


@pytest.mark.parametrize("word", ["vertices", "visibility buffer", "colours of a picture", "draw commands", ""])
def test_a_scene_is_refused_and_the_old_one_stays(app: DrivenApp, tmp_path: Path, refuse: Refuse, word: str) -> None:
    before, scene = picture(app), app.session.scene
    other = two_squares(9).write(tmp_path / "other.glb")
    refuse(app, word)
    app.run("file.open", other)
    app.frame()
    # What the old scene needs was there before the new one took it.
    refuse(app, "nothing any more")
    app.settle()
    assert len(errors(app)) == 1
    assert "the GPU has no memory for" in errors(app)[0]
    assert app.session.scene is scene
    np.testing.assert_array_equal(picture(app), before)


def test_a_window_without_any_memory_stays_open(app: DrivenApp, tmp_path: Path, refuse: Refuse) -> None:
    before = picture(app)
    other = two_squares(9).write(tmp_path / "other.glb")
    refuse(app, "draw commands")
    app.run("file.open", other)
    app.frame()
    refuse(app, "")
    for _ in range(5):
        app.frame()
    assert len(app.session.window.log) <= 5
    assert not app.frontend.needs_frame(SIZE)
    refuse(app, "nothing any more")
    app.run("compare.mode", "a")
    app.run("compare.mode", "wipe")
    app.resize((SIZE[0] + 1, SIZE[1]))
    app.settle()
    app.resize(SIZE)
    np.testing.assert_array_equal(picture(app), before)


def test_a_larger_window_shows_the_smaller_picture(app: DrivenApp, refuse: Refuse) -> None:
    before = picture(app)
    larger = (SIZE[0] + 100, SIZE[1] + 60)
    app.resize(larger)
    refuse(app, "visibility buffer")
    for _ in range(5):
        app.frame()
    width, height = app.session.window.picture_size
    assert errors(app) == [line for line in errors(app) if f"visibility buffer {width}x{height}" in line]
    assert len(app.session.window.log) == 1
    assert app.session.window.log[0].repeats == 1
    assert not app.frontend.needs_frame(larger)
    np.testing.assert_array_equal(picture(app), before)
    refuse(app, "nothing any more")
    app.run("compare.mode", "a")
    assert app.frontend.needs_frame(larger)
    app.resize(SIZE)
    app.settle()
    assert picture(app).shape == before.shape


def test_without_its_reference_a_scene_shows_its_pack(bare: DrivenApp, refuse: Refuse) -> None:
    assert bare.session.view.slot_b.source == REFERENCE
    refuse(bare, "source images")
    bare.settle()
    assert bare.session.view.compare == "a"
    assert errors(bare)[0].startswith("the reference: ")
    assert len(errors(bare)) == 1
    shown = picture(bare)
    assert shown[..., :3].any()
    bare.run("compare.mode", "wipe")
    bare.settle()
    # It is tried again, and what was shown before stays.
    assert bare.session.view.compare == "a"
    np.testing.assert_array_equal(picture(bare), shown)


def test_what_cannot_begin_ends_with_one_line(bare: DrivenApp, refuse: Refuse) -> None:
    refuse(bare, "vertices")
    with pytest.raises(GpuMemoryError, match=r"vertices of .*: the GPU has no memory for"):
        bare.settle()
