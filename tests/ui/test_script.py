"""Scripts played on the window's content: inputs, pictures, views, moving cameras, and what ends them."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from imgui_bundle import imgui
from PIL import Image
from PIL.WebPImagePlugin import WebPImageFile

from ntc.errors import InputError
from tests.support.driven_app import DrivenApp
from viewer.commands import COMMANDS
from viewer.scene.images import read_image
from viewer.script.script import parse_script
from viewer.state.session import Toast


def play(app: DrivenApp, *lines: str) -> None:
    app.play(parse_script("\n".join(lines), "test"))


def test_a_film_shows_what_changed(app: DrivenApp, tmp_path: Path) -> None:
    play(
        app,
        "film a.webp",
        "wait seconds 0.2",
        "compare.mode a",
        "wait seconds 0.2",
        "window.panels",
        "wait seconds 0.2",
    )
    play(app, "film end", "expect toast a.webp")
    with Image.open(tmp_path / "pictures" / "a.webp") as film:
        assert isinstance(film, WebPImageFile)
        assert film.size == app.size
        assert film.n_frames >= 2


def test_keys_and_clicks_that_come_at_once_are_all_taken(app: DrivenApp) -> None:
    io = imgui.get_io()
    for _ in range(5):
        io.add_key_event(imgui.Key.h, True)
        io.add_key_event(imgui.Key.h, False)
    play(app, "wait settled", "expect panels off", "key H", "wait settled")
    place = app.widgets.centre("flicker")
    io.add_mouse_pos_event(*place)
    for _ in range(3):
        io.add_mouse_button_event(0, True)
        io.add_mouse_button_event(0, False)
    play(app, "wait settled")
    assert app.session.window.flickers


def test_pictures_that_are_there_stay(app: DrivenApp) -> None:
    folder = app.session.pictures_folder
    play(app, "file.screenshot a.png", "file.screenshot a.png", "file.screenshot-picture a a.png", "wait settled")
    assert sorted(file.name for file in folder.glob("a*.png")) == ["a-2.png", "a-3.png", "a.png"]
    before = (folder / "a.png").stat().st_mtime_ns
    play(app, "screenshot a.png", "wait settled")
    assert (folder / "a.png").stat().st_mtime_ns > before, "a script says exactly which file it means"


def test_pictures(app: DrivenApp, tmp_path: Path) -> None:
    play(
        app,
        "overlay.kind divergence",
        "wait settled",
        "screenshot window.png",
        *(f"file.screenshot-picture {kind} {kind}.png" for kind in ("shown", "a", "b", "split", "plain")),
        "file.screenshot again.png",
        "wait settled",
        "expect toast again.png",
        "expect waiting off",
    )
    folder = tmp_path / "pictures"
    shots = {file.stem: read_image(file).astype(int) for file in folder.iterdir()}
    assert set(shots) == {"window", "shown", "a", "b", "split", "plain", "again"}
    width = shots["a"].shape[1]
    left, right = slice(0, width // 2 - 2), slice(width // 2 + 2, width)
    np.testing.assert_array_equal(shots["split"], shots["shown"])
    np.testing.assert_array_equal(shots["split"][:, left], shots["a"][:, left])
    np.testing.assert_array_equal(shots["split"][:, right], shots["b"][:, right])
    assert (shots["plain"] != shots["shown"]).any()
    assert shots["shown"].shape[:2] == app.session.window.picture_size[::-1]
    assert shots["window"].shape[:2] == app.size[::-1]
    with pytest.raises(InputError, match=r"must end in \.png"):
        play(app, "file.screenshot a.jpg")


def test_views_go_through_files_and_the_clipboard(app: DrivenApp, tmp_path: Path) -> None:
    changes = ("slot.path a cached", "compare.divider 0.3", "view.resolution 0.5", "camera.bookmark here")
    play(app, *changes, "view.save v.json", "view.copy")
    view, bookmarks = app.session.view, app.session.bookmarks
    for restore in ("view.load v.json", f"view.load {tmp_path / 'pictures' / 'v.json'}", "view.paste"):
        app.session.navigation.bookmarks = {}
        play(app, "slot.path a deferred", "compare.mode a", "camera.look 0 0 9 0 0 0", "view.resolution 1", restore)
        assert app.session.view == view
        assert app.session.resolution == 0.5
        assert app.session.bookmarks == bookmarks
    play(app, "camera.look 0 0 9 0 0 0", "camera.go-bookmark here", "expect camera here")


def test_a_view_with_a_source_that_is_not_open(app: DrivenApp) -> None:
    play(app, "view.copy")
    content = json.loads(app.context.read_clipboard())
    content["slots"]["a"]["source"], content["scene"] = "elsewhere", "another"
    app.context.write_clipboard(json.dumps(content))
    play(app, "view.paste", "expect source clustered", "expect toast 'not open: elsewhere'", "expect toast another")
    app.context.write_clipboard("nothing of the kind")
    before = app.session.view
    with pytest.raises(InputError, match="clipboard: not valid JSON"):
        play(app, "view.paste")
    assert app.session.view == before


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        (("camera.turntable 90", "wait settled"), "test:2: wait settled: the camera moves"),
        (("wait trained",), "test:1: wait trained: no training has begun"),
        (("wait frames 1", "click Nothing"), "test:2: click: nothing is called 'Nothing'"),
        (("click 'A sourc'",), "there are A source"),
        (("slot.source a missing",), "test:1: slot.source: source 'missing': must be one of reference"),
        (("file.open missing.glb",), "test:1: .*missing.glb"),
        (("expect source reference",), "test:1: expected that source is 'reference'; it is 'clustered'"),
        (("expect toast hello",), "test:1: expected that toast contains 'hello'"),
        (("view.load missing.json",), "test:1: .*missing.json: cannot be read"),
        (("camera.turntable 0",), "not 0"),
        (("camera.bookmark ''",), "one line"),
    ],
)
def test_what_ends_a_script(app: DrivenApp, lines: tuple[str, ...], message: str) -> None:
    with pytest.raises(InputError, match=message) as caught:
        play(app, *lines)
    assert "\n" not in str(caught.value)


def test_keys_of_the_users_own(app: DrivenApp) -> None:
    app.session.settings = replace(app.session.settings, keys={"window.panels": "Ctrl+H", "slot.source": "Ctrl+G"})
    play(app, "key H", "expect panels on", "key Ctrl+H", "expect panels off")
    play(app, "key Ctrl+G", "expect palette on", "type b", "key Enter", "type single", "key Enter")
    play(app, "expect source-b single", "expect palette off")


def test_no_command_breaks_the_window(app: DrivenApp) -> None:
    """Without arguments each runs, or says in one line what it lacks."""
    for command in COMMANDS:
        app.session.window.toasts = ()
        app.run(command.id)
        app.frame()
        toasts: tuple[Toast, ...] = app.session.window.toasts
        assert not any("\n" in toast.text for toast in toasts)
