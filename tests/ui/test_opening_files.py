"""Scenes and packs that are dropped on the window or named in it, good and bad ones."""

import os
import threading
from dataclasses import replace
from pathlib import Path

import pytest

from lab.bench.random_pack import random_pack
from ntc.errors import InputError
from ntc.pack.file import write_pack
from tests.end_to_end.conftest import two_squares
from tests.support.driven_app import DrivenApp
from tests.ui.conftest import hide_panels, write_scene
from viewer.commands import run, run_or_notify
from viewer.jobs.job import JobReport
from viewer.scene.load import load_scene
from viewer.scene.model import Scene

STATUS_BAR = 24
"""Pixels at the lower edge that hold it."""


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
    assert app.widgets.tips["work"].startswith("opening scene.glb: 25 %")
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
    assert app.widgets.tips["work"].startswith("exporting clustered as glTF with the pack")
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
