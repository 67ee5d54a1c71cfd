"""Scenes and packs that are dropped on the window or named in it, good and bad ones."""

import os
import threading
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from imgui_bundle import imgui
from PIL import Image

from lab.bench.random_pack import random_pack
from ntc.errors import InputError
from ntc.pack.file import read_pack, write_pack
from tests.end_to_end.conftest import two_squares
from tests.support.driven_app import DrivenApp
from tests.ui.conftest import hide_panels, write_scene
from viewer.commands import run, run_or_notify
from viewer.jobs.job import JobReport
from viewer.scene.load import load_scene
from viewer.scene.model import Scene
from viewer.state.view_state import REFERENCE

STATUS_BAR = 24
"""Pixels at the lower edge that hold it."""


def test_a_dropped_pack_goes_into_slot_a(app: DrivenApp, scene_path: Path, tmp_path: Path) -> None:
    pack = read_pack(scene_path.with_name("scene.single.ntc"))
    write_pack(tmp_path / "mine.ntc", pack)
    app.drop(tmp_path / "mine.ntc")
    assert app.session.view.slot_a.source == "mine"
    assert "mine" in app.session.sources


def test_a_dropped_scene_replaces_the_old_one(app: DrivenApp, tmp_path: Path) -> None:
    path = write_scene(tmp_path, seed=8)
    app.drop(path)
    assert app.session.scene.path == path
    assert app.session.view.slot_a.source == "clustered"
    assert app.screenshot().std() > 5


@pytest.mark.parametrize("name", ["missing.glb", "broken.glb", "broken.ntc", "words.txt"])
def test_a_bad_file_is_a_message_and_the_old_scene_stays(app: DrivenApp, tmp_path: Path, name: str) -> None:
    path = tmp_path / name
    if name != "missing.glb":
        path.write_bytes(b"nothing that could be opened")
    before = app.session.scene, app.session.view
    app.drop(path)
    assert (app.session.scene, app.session.view) == before
    (toast,) = app.session.window.toasts
    assert toast.kind == "error"
    assert name in toast.text
    assert app.screenshot().std() > 5


def test_a_broken_pack_beside_a_scene_does_not_keep_it_closed(app: DrivenApp, tmp_path: Path) -> None:
    path = write_scene(tmp_path, seed=10)
    path.with_name("scene.clustered.ntc").write_bytes(b"")
    app.drop(path)
    assert app.session.scene.path == path
    assert app.session.open_sources == (REFERENCE, "single")
    assert any("scene.clustered.ntc" in toast.text and toast.kind == "error" for toast in app.session.window.toasts)


def test_a_pack_of_another_scene_is_refused(app: DrivenApp, tmp_path: Path) -> None:
    other = write_scene(tmp_path, seed=9)
    app.drop(other.with_name("scene.single.ntc"))
    assert app.session.view.slot_a.source == "clustered"
    assert "0 of 2 textures match" in app.session.window.toasts[-1].text


def dialog(app: DrivenApp) -> None:
    """Open the dialog by its key."""
    imgui.get_io().add_key_event(imgui.Key.mod_ctrl, True)
    app.press(imgui.Key.o)
    imgui.get_io().add_key_event(imgui.Key.mod_ctrl, False)
    app.settle()
    assert app.session.window.file_dialog


@pytest.mark.parametrize("what", ["a scene", "images"])
def test_the_dialog_opens_a_folder(app: DrivenApp, tmp_path: Path, what: str) -> None:
    folder = tmp_path / "own"
    folder.mkdir()
    expected = write_scene(folder, seed=11) if what == "a scene" else folder
    if what == "images":
        Image.fromarray(np.arange(192, dtype=np.uint8).reshape(8, 8, 3)).save(folder / "tile.png")
    dialog(app)
    app.type(f"{folder}/")
    app.press(imgui.Key.enter)
    assert app.session.window.file_dialog
    app.click("Open folder")
    app.settle()
    assert not app.session.window.file_dialog
    assert app.session.scene.path == expected
    assert len(app.session.scene.textures) == (2 if what == "a scene" else 1)


def test_a_path_can_be_typed_and_completed(app: DrivenApp, tmp_path: Path) -> None:
    path = write_scene(tmp_path, seed=11)
    dialog(app)
    app.type(f"{tmp_path}/sce")
    app.press(imgui.Key.tab)
    app.type("glb")
    app.press(imgui.Key.enter)
    assert app.session.scene.path == path
    assert not app.session.window.file_dialog


def test_the_dialog_goes_through_folders_and_filters(app: DrivenApp, tmp_path: Path) -> None:
    (tmp_path / "town").mkdir()
    (tmp_path / "town" / "notes.txt").write_text("")
    path = write_scene(tmp_path / "town", seed=17)
    dialog(app)
    app.type(f"{tmp_path}/")
    app.press(imgui.Key.enter)
    app.click("file: town/")
    listed = [label for label in app.widgets.labels() if label.startswith("file: scene")]
    assert listed == ["file: scene.clustered.ntc", "file: scene.glb", "file: scene.single.ntc"]
    app.type("glb")
    assert [label for label in app.widgets.labels() if label.startswith("file: scene.")] == ["file: scene.glb"]
    app.click("Open file")
    assert app.session.scene.path == path


def test_a_double_click_opens_and_recent_files_are_listed(app: DrivenApp, scene_path: Path, tmp_path: Path) -> None:
    path = write_scene(tmp_path, seed=18)
    dialog(app)
    app.type(f"{tmp_path}/")
    app.press(imgui.Key.enter)
    app.double_click("file: scene.glb")
    assert app.session.scene.path == path
    dialog(app)
    app.click("file: courtyard")
    assert app.session.scene.name == "courtyard"
    dialog(app)
    app.click(f"file: recent {scene_path.parent.name}/scene.glb")
    assert app.session.scene.path in (path, scene_path)


class AnsweredDialog:
    """Stands for the desktop's own dialog, in which a file has been chosen."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def ready(self, _timeout: int) -> bool:
        return True

    def result(self) -> list[str]:
        return [str(self.path)]


def test_the_desktops_own_dialog_is_offered_where_there_is_one(
    app: DrivenApp, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = write_scene(tmp_path, seed=19)
    system = app.frontend.interface._file_dialog.system
    for is_available in (False, True):
        monkeypatch.setattr(system, "is_available", is_available)
        app.run("file.open")
        app.settle()
        assert ("System dialog..." in app.widgets.labels()) == is_available
    asked = "viewer.ui.file_dialog.portable_file_dialogs.open_file"
    monkeypatch.setattr(asked, lambda *_: AnsweredDialog(path))
    app.click("System dialog...")
    assert app.session.scene.path == path
    assert not app.session.window.file_dialog


def test_a_folder_with_an_odd_name_can_be_shown(
    app: DrivenApp, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = Path(os.fsdecode(os.fsencode(tmp_path) + b"/\xff\xfe"))
    folder.mkdir()
    write_scene(folder, seed=20)
    monkeypatch.chdir(folder)
    app.session.settings = replace(app.session.settings, recent_files=())
    app.run("file.open")
    app.settle()
    assert "file: scene.glb" in app.widgets.labels()
    app.click("Open file")
    assert app.session.scene.path == folder / "scene.glb"


def test_a_scene_that_cannot_be_drawn_is_put_away(
    app: DrivenApp, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise InputError("other.glb: has too many textures")

    app.rest()
    scene, packs, view, shown = app.session.scene, app.session.packs, app.session.view, app.screenshot()
    monkeypatch.setattr("viewer.render.viewport.Renderer", refuse)
    app.drop(two_squares(9).write(tmp_path / "other.glb"))
    assert app.session.scene is scene
    assert app.session.packs == packs
    assert app.session.view == view
    assert [toast.text for toast in app.session.window.toasts if toast.kind == "error"] == [
        "other.glb: has too many textures"
    ]
    app.session.window.toasts = ()
    app.rest()
    # All but the status bar, which goes on showing the last message.
    assert (app.screenshot()[:-STATUS_BAR] == shown[:-STATUS_BAR]).all()


def test_a_pack_that_was_encoded_anew_is_drawn_anew(app: DrivenApp, scene: Scene, tmp_path: Path) -> None:
    hashes = [texture.pixel_hash for texture in scene.textures]
    hide_panels(app)
    pictures = []
    for seed in (1, 2):
        write_pack(tmp_path / "again.ntc", random_pack(((32, 32), (32, 32)), (0, 1), hashes=hashes, seed=seed))
        app.drop(tmp_path / "again.ntc")
        app.session.window.toasts = ()
        app.settle()
        pictures.append(app.screenshot())
    assert app.session.view.slot_a.source == "random"
    assert (pictures[0] != pictures[1]).any()


def test_cameras_beside_a_scene_are_there_when_it_opens(app: DrivenApp, tmp_path: Path) -> None:
    path = write_scene(tmp_path, seed=12)
    path.with_name("cameras.json").write_text('[{"name": "street", "eye": [0, 1, 5], "target": [0, 1, 0]}]')
    app.drop(path)
    assert [camera.name for camera in app.session.scene.cameras] == ["street"]
    assert app.session.view.camera.name == "street"


def test_opened_files_can_be_opened_again(app: DrivenApp, scene_path: Path, tmp_path: Path) -> None:
    path = write_scene(tmp_path, seed=15)
    app.drop(path)
    app.drop(tmp_path / "missing.glb")
    assert app.session.settings.recent_files == (str(path), str(scene_path))
    app.run("file.open-recent", str(scene_path))
    assert app.session.scene.path == scene_path
    assert app.session.settings.recent_files == (str(scene_path), str(path))


class HeldReading:
    """Reads scenes when it is let go, and tells how far it is before."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.may_go_on, self.began = threading.Event(), threading.Event()
        monkeypatch.setattr("viewer.state.open_files.load_scene", self._load)

    def _load(self, path: Path, report: JobReport) -> Scene:
        report.progress(1, 4)
        self.began.set()
        assert self.may_go_on.wait(60.0)
        report.progress(2, 4)
        return load_scene(path)


def test_frames_go_on_while_a_scene_is_read(app: DrivenApp, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    reading, path, before = HeldReading(monkeypatch), write_scene(tmp_path, seed=19), app.session.scene
    run_or_notify(app.context, "file.open", path)
    app.frame(2)
    assert reading.began.wait(60.0)
    app.frame(3)
    assert app.session.scene is before
    assert app.widgets.explanation("work").startswith("opening scene.glb: 25 %")
    assert not app.is_settled
    run_or_notify(app.context, "view.magnify", 2.0)
    assert app.session.view.zoom.factor == 2.0
    reading.may_go_on.set()
    app.settle()
    assert app.session.scene.path == path


@pytest.mark.parametrize("by", ["Escape", "button"])
def test_reading_can_be_ended(app: DrivenApp, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, by: str) -> None:
    reading, path, before = HeldReading(monkeypatch), write_scene(tmp_path, seed=19), app.session.scene
    packs, view = app.session.packs, app.session.view
    run_or_notify(app.context, "file.open", path)
    app.frame(2)
    assert reading.began.wait(60.0)
    run_or_notify(app.context, "window.dismiss") if by == "Escape" else run_or_notify(
        app.context, "file.cancel-opening"
    )
    reading.may_go_on.set()
    app.settle()
    assert (app.session.scene, app.session.packs, app.session.view) == (before, packs, view)
    assert app.session.window.log[-1].text == "scene.glb: opening was cancelled"
    run_or_notify(app.context, "file.open", path)
    app.settle()
    assert app.session.scene.path == path


@pytest.mark.process
def test_a_scene_is_exported_beside_the_frames(app: DrivenApp, scene_path: Path, tmp_path: Path) -> None:
    folder = tmp_path / "exported"
    app.run("file.export", "gltf", folder)
    app.frame()
    assert app.widgets.explanation("work").startswith("exporting clustered as glTF with the pack")
    with pytest.raises(InputError, match="another export is under way"):
        run(app.context, "file.export", "page")
    app.until(lambda: not app.effects.exporting.is_under_way)
    assert (folder / "scene.gltf").is_file()
    entry = app.session.window.log[-1]
    assert entry.text == f"exported into {folder}"
    assert "wrote" in entry.details
    app.run("file.export", "gltf-ktx2", folder)
    app.frame()
    app.click("cancel work")
    app.until(lambda: not app.effects.exporting.is_under_way)
    assert "was cancelled" in app.session.window.log[-1].text
