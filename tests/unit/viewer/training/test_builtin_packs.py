"""Packs accepted for a built-in scene: in the user's data folder, and open again with that scene."""

import shutil
from pathlib import Path

import pytest

from tests.support.spoilt_files import accept, errors, finished, open_context, settle, write_scene
from viewer import locations
from viewer.commands import run_or_notify
from viewer.state.pack_files import packs_beside


@pytest.fixture
def installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder of an installation's assets, of which the scene is the only one."""
    assets = tmp_path / "installed"
    assets.mkdir()
    write_scene(assets)
    monkeypatch.setattr(locations, "assets_folder", lambda: assets)
    monkeypatch.setattr(locations, "builtin_scene_path", lambda name="": assets / "scene.gltf")
    monkeypatch.setenv(locations.DATA_FOLDER_VARIABLE, str(tmp_path / "data"))
    return assets


def test_an_accepted_pack_lies_in_the_data_folder_and_is_opened_with_the_scene(installed: Path, tmp_path: Path) -> None:
    before = sorted(installed.iterdir())
    scene_path, packs = installed / "scene.gltf", tmp_path / "data" / "packs"
    context = open_context(scene_path)
    for _ in range(2):
        finished(context)
        accept(context)
    assert errors(context) == []
    assert sorted(installed.iterdir()) == before
    written = (packs / "scene.random-2.ntc", packs / "scene.random.ntc")
    assert packs_beside(scene_path) == (installed / "scene.single.ntc", *written)
    run_or_notify(context, "file.open", scene_path)
    assert {pack.path for pack in context.session.packs.values()} == set(packs_beside(scene_path))


def test_leaving_says_where_the_pack_is_kept(installed: Path, tmp_path: Path) -> None:
    context = open_context(installed / "scene.gltf")
    finished(context)
    other = tmp_path / "other"
    other.mkdir()
    run_or_notify(context, "file.open", write_scene(other, 1))
    question = context.session.window.question
    assert question is not None
    assert "in the data folder" in question.text
    run_or_notify(context, "question.answer", "Keep")
    settle(context)
    assert (tmp_path / "data" / "packs" / "scene.random.ntc").is_file()


def test_the_same_file_elsewhere_keeps_its_packs_beside_it(installed: Path, tmp_path: Path) -> None:
    copied = Path(shutil.copytree(installed, tmp_path / "copied")) / "scene.gltf"
    assert locations.packs_folder(copied) == copied.parent
